"""One failure in a log: kind, time, command, evidence, confidence."""

from dataclasses import dataclass, field
from typing import Any

KINDS: tuple[str, ...] = (
    "fall",
    "stumble",
    "slip",
    "torque_saturation",
    "speed_saturation",
    "overheating",
    "packet_loss",
    "tracking",
    "limit_cycle",
    "held",
    "stopped",
    "damped",
    "motor_flicker",
    "authority_loss",
)
NOT_OF_POLICY = ("held", "stopped", "damped", "motor_flicker", "authority_loss")
"""Kinds of events that are not failures of the policy: the robot was held by hand, stopped by its operator or damped
after a fall; its motors were off for a moment, or produced almost none of the commanded torque."""

HELD, STOPPED = "held by hand", "stopped by the operator"
DAMPED, MOTORS_OFF = "damped after a fall", "its motors did not answer"


@dataclass(frozen=True, kw_only=True)
class Failure:
    """A failure in a stretch of a trial."""

    kind: str
    """One of `KINDS`."""
    time_s: float
    """Start on the trial's clock [s]."""
    until_s: float
    """End on the trial's clock [s]."""
    command: tuple[float, float, float]
    """Forward and lateral velocity [m/s] and yaw rate [rad/s] commanded at the start."""
    confidence: float
    """Confidence that the failure is of this kind, 0 to 1."""
    joint: str = ""
    """Name of the joint, if the failure concerns one joint."""
    direction: str = ""
    """Direction of a fall (`forward`, `backward`, `left`, `right`), or axis of a tracking divergence."""
    command_known: bool = True
    """Whether the log has the command; if not, `command` is zero and meaningless."""
    excuse: str = ""
    """Why the policy is not responsible; empty if it is."""
    evidence: dict[str, float | bool | str] = field(default_factory=dict)
    """Measured values by name with unit."""

    @property
    def of_policy(self) -> bool:
        """Whether it is a failure of the policy."""
        return not self.excuse and self.kind not in NOT_OF_POLICY

    def text(self) -> str:
        """One line for a report."""
        forward, lateral, yaw = self.command
        what = " ".join(part for part in (self.kind.replace("_", " "), self.direction, self.joint) if part)
        found = ", ".join(f"{name} {_shown(value)}" for name, value in self.evidence.items())
        excuse = f"; not the policy's: {self.excuse}" if self.excuse else ""
        command = f"{forward:.2f} m/s, {lateral:.2f} m/s, {yaw:.2f} rad/s" if self.command_known else "not known"
        return f"{what} at {self.time_s:.2f} s, command {command} ({found}; confidence {self.confidence:.2f}{excuse})"

    @staticmethod
    def from_dict(value: dict[str, Any]) -> "Failure":
        """Inverse of `settings.plain`."""
        return Failure(**{**value, "command": tuple(value["command"])})


def _shown(value: float | bool | str) -> str:
    if isinstance(value, bool):
        return "yes" if value else "no"
    return value if isinstance(value, str) else f"{value:.3g}"
