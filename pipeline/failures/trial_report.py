"""What a log shows: which commands it ran, for how long, and what went wrong.

`missed_bars`: failures that a validation found in a simulated trial and no detector did. Bars of a release are tighter
than what counts as a failure of a robot, and the simulation has quantities that a log has no sensor for.
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
    """Steady commands: forward, lateral [m/s], yaw rate [rad/s], and the duration of each [s]."""
    failures: tuple[Failure, ...]
    command_known: bool = True
    """Whether the log has commands; if not, commands of failures are zeros and mean nothing."""
    start_ns: int | None = None
    """Receipt of the first sample since 1970; None in reports that were made before it was kept."""
    whole: bool = True
    """Whether nothing of the log was lost."""
    fingerprint: str = ""
    """Of the sensor data, as `signals.fingerprint_of` makes it."""
    notes: tuple[str, ...] = ()
    """What could not be checked, and why."""

    @property
    def span_ns(self) -> tuple[int, int] | None:
        """Absolute time from the first sample to the end of the last one."""
        return None if self.start_ns is None else (self.start_ns, self.start_ns + round(self.seconds * 1e9))

    @staticmethod
    def from_dict(value: dict[str, Any]) -> "TrialReport":
        """The report that `settings.plain` made this of."""
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
"""Figure -> kind of failure. Power and steps while standing are of none: they are noted, and move nothing."""
NOTED = "missed in the validation and no kind of failure"
LEAST, MOST = 0.7, 0.95
"""Confidence of a bar that is just missed, and of one that is missed by half or more."""


def missed_bars(signals: Signals, found: Sequence[Failure], until_s: float) -> list[Failure]:
    """A failure for each missed bar whose kind the detectors have not found in the time that it was measured over.

    Of a trial that is not marked simulated nothing is taken. Gaits count before `until_s` alone, as with detectors.
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
    """Sentences on missed bars that are no kind of failure."""
    missed = signals.trial.missed if signals.trial.simulated else ()
    return tuple(f"{NOTED}: {bar}" for bar in missed if bar.figure not in KIND_OF)


def _same(failure: Failure, kind: str, bar: MissedBar, last_s: float) -> bool:
    """Whether a failure is what a bar says; a robot that fell once fell, whenever that was."""
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
        evidence["attitude"] = False  # otherwise the detector finds it
    if bar.axis:
        evidence |= {"commanded": bar.commanded, "achieved": bar.achieved}
    over = abs(bar.got - bar.asked) / bar.asked if bar.asked > 0.0 else 1.0
    confidence = min(LEAST + 0.5 * over, MOST)
    return signals.failure(
        kind, bar.from_s, last_s, confidence=confidence, joint=bar.joint, direction=bar.axis, evidence=evidence
    )
