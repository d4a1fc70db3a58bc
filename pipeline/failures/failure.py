"""One thing that went wrong in a log: what, when, under which command, by which evidence, how surely."""

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
"""What happened to a robot and is no failure of its policy: it was held by hand, stopped by its operator or damped
after a fall; its motors were off for a moment, or gave almost none of the commanded torque."""

HELD, STOPPED = "held by hand", "stopped by the operator"
DAMPED, MOTORS_OFF = "damped after a fall", "its motors did not answer"


@dataclass(frozen=True, kw_only=True)
class Failure:
    """A stretch of a trial in which something went wrong."""

    kind: str
    """One of `KINDS`."""
    time_s: float
    """When it began, on the trial's clock [s]."""
    until_s: float
    """When it ended [s]."""
    command: tuple[float, float, float]
    """Forward and lateral velocity [m/s] and yaw rate [rad/s] commanded at that time."""
    confidence: float
    """0 to 1: how surely it is this and not something else."""
    joint: str = ""
    """The joint, where it is one joint's."""
    direction: str = ""
    """Where to: `forward`, `backward`, `left`, `right` of falls; the axis of a tracking divergence."""
    command_known: bool = True
    """Whether the log has the command; if not, the command is zeros and means nothing."""
    excuse: str = ""
    """Why it is not a failure of the policy; empty where it is one."""
    evidence: dict[str, float | bool | str] = field(default_factory=dict)
    """What was measured, by name with unit."""

    @property
    def of_policy(self) -> bool:
        """Whether the policy is to answer for it."""
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
        """The failure that `settings.plain` made this of."""
        return Failure(**{**value, "command": tuple(value["command"])})


def _shown(value: float | bool | str) -> str:
    if isinstance(value, bool):
        return "yes" if value else "no"
    return value if isinstance(value, str) else f"{value:.3g}"
