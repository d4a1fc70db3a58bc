"""What a log shows: which commands it ran, for how long, and what went wrong."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Any

from pipeline.failures.failure import Failure

VERIFIED, UNVERIFIED = "verified", "unverified"


@dataclass(frozen=True, kw_only=True)
class TrialReport:
    """One trial, from one log file."""

    trial: str
    file: str
    """The log's file name."""
    sha256: str
    """Of the log's bytes."""
    robot: str
    policy: str
    """Digest of the policy as the log states it; empty where it does not."""
    simulated: bool
    integrity: str
    """`verified` where checksums cover all that was used, else `unverified`."""
    seconds: float
    commands: tuple[tuple[float, float, float, float], ...]
    """Steady commands: forward, lateral [m/s], yaw rate [rad/s], and how long each was asked for [s]."""
    failures: tuple[Failure, ...]
    command_known: bool = True
    """Whether the log says what was asked for; if not, commands of failures are zeros and mean nothing."""
    start_ns: int | None = None
    """Receipt of the first sample since 1970; None in reports that were made before it was kept."""
    whole: bool = True
    """Whether nothing of the log was lost."""
    fingerprint: str = ""
    """Of the sensor data, as `fingerprint.fingerprint_of` makes it."""
    notes: tuple[str, ...] = ()
    """What could not be looked at, and why."""

    @property
    def span_ns(self) -> tuple[int, int] | None:
        """Absolute time from the first sample to the end of the last one."""
        return None if self.start_ns is None else (self.start_ns, self.start_ns + round(self.seconds * 1e9))

    def to_dict(self) -> dict[str, Any]:
        """As JSON types."""
        return {
            **asdict(self),
            "commands": [list(each) for each in self.commands],
            "failures": [each.to_dict() for each in self.failures],
            "notes": list(self.notes),
        }

    @staticmethod
    def from_dict(value: dict[str, Any]) -> TrialReport:
        """The report that `to_dict` was called on."""
        return TrialReport(
            **{
                **value,
                "commands": tuple(tuple(each) for each in value["commands"]),
                "failures": tuple(Failure.from_dict(each) for each in value["failures"]),
                "notes": tuple(value["notes"]),
            }
        )
