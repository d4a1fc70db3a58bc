"""Which logs are one recording: a torn, split or newly stored copy of a log is no further witness.

Two trials are of one recording

- if they are of the same bytes, or
- if their times overlap, they are of one robot, and every half second that both have whole has the same sensor data, or
- if their times overlap or one follows the other within `PIECES_APART_S`, as the files of a split bag do, and robot,
  policy and whether they are simulated are the same. Simulated ones whose sensor data differ are not: all virtual
  robots begin at the same moment of the clock, so that there time says nothing and the data must.

Real logs need no equal data, since two recorders of one walk stamp its messages differently. The price: two robots of
one kind that walk with one policy at the same time are counted once, and so are two simulated logs that begin alike
beside a short copy that fits both. Where it is in doubt it counts less, not more.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence

from pipeline.failures.failure import Failure
from pipeline.failures.fingerprint import windows_of
from pipeline.failures.trial_report import TrialReport
from pipeline.feedback.change import experiment_of

PIECES_APART_S = 1.0
"""The files of a split bag are one message apart; no recorder is stopped and started within this time."""


@dataclasses.dataclass(frozen=True, kw_only=True)
class Heard:
    """A trial that counts."""

    report: TrialReport
    recording: str
    """The same for all trials of one recording: the SHA-256 of one of its logs."""

    @property
    def experiment(self) -> str:
        """What it counts with."""
        return experiment_of(self.report.policy, self.recording, simulated=self.report.simulated)


def recorded(reports: Sequence[TrialReport]) -> tuple[list[Heard], list[str]]:
    """The trials of each recording, by name, and what is left out of copies.

    Of copies the one is heard that has most, and of the others what fails outside of its time: a fall that a torn copy
    alone shows is its tear.
    """
    recordings = _recordings(reports)
    heard: list[TrialReport] = []
    silent: list[str] = []
    for report in sorted(reports, key=_least_whole):
        same = [each for each in heard if recordings[each.sha256] == recordings[report.sha256]]
        copies = [each for each in same if each.file != report.file and _overlap(each, report)]
        kept = tuple(each for each in report.failures if not any(_covers(copy, report, each) for copy in copies))
        if copies:
            silent.append(
                f"{report.trial} ({report.file}) is of the recording of {copies[0].file} and counts once with it"
            )
        heard.append(dataclasses.replace(report, failures=kept))
    ordered = sorted(heard, key=lambda each: each.trial)
    return [Heard(report=each, recording=recordings[each.sha256]) for each in ordered], sorted(silent)


def _recordings(reports: Sequence[TrialReport]) -> dict[str, str]:
    """SHA-256 of a log -> that of the first log of its recording."""
    first = {each.sha256: each.sha256 for each in reports}
    windows = [windows_of(each.fingerprint, each.start_ns or 0) for each in reports]
    order = sorted((each.start_ns, number) for number, each in enumerate(reports) if each.start_ns is not None)
    for place, (_, one) in enumerate(order):
        span = reports[one].span_ns
        assert span is not None
        reach = span[1] + round(PIECES_APART_S * 1e9)
        for start, other in order[place + 1 :]:
            if start > reach:
                break
            if _one_recording(reports[one], reports[other], windows[one], windows[other]):
                known = first[reports[one].sha256], first[reports[other].sha256]
                first = {log: min(known) if each in known else each for log, each in first.items()}
    return first


def _one_recording(one: TrialReport, other: TrialReport, had: dict[int, str], has: dict[int, str]) -> bool:
    """Whether trials that overlap or follow each other are of one recording."""
    both = had.keys() & has.keys()
    alike = all(had[each] == has[each] for each in both)
    if one.robot != other.robot:
        return False
    if both and alike:
        return True
    stated_alike = one.policy == other.policy and one.simulated == other.simulated
    return stated_alike and (alike or not one.simulated)


def _least_whole(report: TrialReport) -> tuple[bool, int, bool, float, str, str]:
    """Orders copies: the one that has most comes first."""
    known = len(windows_of(report.fingerprint, 0))
    return (not report.command_known, -known, not report.whole, -report.seconds, report.trial, report.file)


def _overlap(one: TrialReport, other: TrialReport) -> bool:
    """Whether two trials of one recording are copies of the same time; the same bytes are where no time is known."""
    first, second = one.span_ns, other.span_ns
    if first is None or second is None:
        return one.sha256 == other.sha256
    return first[0] < second[1] and second[0] < first[1]


def _covers(copy: TrialReport, report: TrialReport, failure: Failure) -> bool:
    """Whether a copy was there when a failure of another one began."""
    span = copy.span_ns
    if span is None or report.start_ns is None:
        return True
    return span[0] <= report.start_ns + round(failure.time_s * 1e9) <= span[1]
