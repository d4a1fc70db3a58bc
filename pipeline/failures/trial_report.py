"""Report on a log: its commands with durations, and its failures.

`missed_bars` are failures that a validation found in a simulated trial but no detector did: the thresholds of a release
are stricter than those of failures, and the simulation has quantities that a log has no sensor for.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from pipeline.failures.failure import Failure
from pipeline.failures.signals import Signals
from pipeline.hardware_logs.missed_bars import MissedBar

VERIFIED, UNVERIFIED = "verified", "unverified"


@dataclass(frozen=True, kw_only=True)
class TrialReport:
    """Report on one trial of a log file."""

    trial: str
    file: str
    """The log's file name."""
    sha256: str
    """SHA-256 of the log's bytes."""
    robot: str
    policy: str
    """Digest of the policy as stated by the log; empty if not stated."""
    simulated: bool
    integrity: str
    """`verified` if checksums cover all data used, else `unverified`."""
    seconds: float
    commands: tuple[tuple[float, float, float, float], ...]
    """Steady commands: forward, lateral [m/s], yaw rate [rad/s], and the duration of each [s]."""
    failures: tuple[Failure, ...]
    command_known: bool = True
    """Whether the log has commands; if not, commands of failures are zero and meaningless."""
    start_ns: int | None = None
    """Receipt time of the first sample since 1970 [ns]; None in reports of older versions."""
    whole: bool = True
    """Whether the log is complete."""
    fingerprint: str = ""
    """Fingerprint of the sensor data from `signals.fingerprint_of`."""
    notes: tuple[str, ...] = ()
    """What could not be checked, and why."""

    @property
    def span_ns(self) -> tuple[int, int] | None:
        """Absolute time from the first sample to the end of the last one."""
        return None if self.start_ns is None else (self.start_ns, self.start_ns + round(self.seconds * 1e9))

    @staticmethod
    def from_dict(value: dict[str, Any]) -> "TrialReport":
        """Inverse of `settings.plain`."""
        commands = tuple(tuple(each) for each in value["commands"])
        failures = tuple(Failure.from_dict(each) for each in value["failures"])
        return TrialReport(**{**value, "commands": commands, "failures": failures, "notes": tuple(value["notes"])})


KIND_OF = {
    "falls": "fall",
    "survival": "fall",
    "speed_error": "tracking",
    "yaw_rate_error": "tracking",
    "drift": "tracking",
    "slip": "slip",
    "saturation": "torque_saturation",
}
"""Figure -> kind of failure. Power and steps while standing have no kind: they are noted without further effect."""
NOTED = "missed in the validation and no kind of failure"
LEAST, MOST = 0.7, 0.95
"""Confidence of a threshold that is just missed, and of one that is missed by half or more."""


def missed_bars(signals: Signals, found: Sequence[Failure], until_s: float) -> list[Failure]:
    """A failure for each missed bar whose kind no detector found in the same time range.

    Only for trials that are marked as simulated. Figures of the gait count only before `until_s`, as for detectors.
    """
    added: list[Failure] = []
    for bar in signals.trial.missed if signals.trial.simulated else ():
        kind = KIND_OF.get(bar.figure)
        end_s = float(signals.time_s[-1])
        last_s = min(bar.until_s, end_s, end_s if kind == "fall" else until_s)
        if kind is None or bar.from_s > last_s or any(_same(each, kind, bar, last_s) for each in (*found, *added)):
            continue
        added.append(_failure(signals, kind, bar, last_s))
    return added


def without_kind(signals: Signals) -> tuple[str, ...]:
    """Sentences on missed bars without a kind of failure."""
    missed = signals.trial.missed if signals.trial.simulated else ()
    return tuple(f"{NOTED}: {bar}" for bar in missed if bar.figure not in KIND_OF)


def _same(failure: Failure, kind: str, bar: MissedBar, last_s: float) -> bool:
    """Whether a failure is the one of a missed bar; falls match at any time."""
    if failure.kind != kind:
        return False
    overlaps = failure.time_s <= last_s and failure.until_s >= bar.from_s
    return kind == "fall" or (overlaps and (kind != "tracking" or failure.direction == bar.axis))


def _failure(signals: Signals, kind: str, bar: MissedBar, last_s: float) -> Failure:
    evidence: dict[str, float | bool | str] = {
        "figure": bar.figure,
        "got": bar.got,
        "asked": bar.asked,
        "bar": f"{bar.bar} in the cell {bar.cell}",
    }
    if kind == "fall":
        evidence["attitude"] = False  # with the attitude the detector would have found it
    if bar.axis:
        evidence |= {"commanded": bar.commanded, "achieved": bar.achieved}
    over = abs(bar.got - bar.asked) / bar.asked if bar.asked > 0.0 else 1.0
    confidence = min(LEAST + 0.5 * over, MOST)
    return signals.failure(
        kind, bar.from_s, last_s, confidence=confidence, joint=bar.joint, direction=bar.axis, evidence=evidence
    )
