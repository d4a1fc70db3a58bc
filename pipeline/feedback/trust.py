"""Which logs and which failures count, and why the others do not; which logs are one recording.

A torn, split or newly stored copy of a log is no further evidence. Two trials are of one recording

- if they are of the same bytes, or
- if their times overlap, they are of one robot, and every half second that both have whole has the same sensor data, or
- if their times overlap or one follows the other within `PIECES_APART_S`, as the files of a split bag do, and robot,
  policy and whether they are simulated are the same. Simulated ones whose sensor data differ are not: all virtual
  robots begin at the same moment of the clock, so that their times are no evidence.

Real logs need no equal data, since two recorders of one walk stamp its messages differently. The price: two robots of
one kind that walk with one policy at the same time are counted once, and so are two simulated logs that begin alike
beside a short copy that fits both. In doubt it counts less, not more.
"""

import dataclasses
import math
from collections.abc import Callable, Iterable, Sequence
from fnmatch import fnmatchcase

from pipeline.failures.failure import Failure
from pipeline.failures.signals import windows_of
from pipeline.failures.trial_report import VERIFIED, TrialReport
from pipeline.feedback.change import Change, Witness, experiment_of
from pipeline.feedback.rules import FeedbackRules, TrustRules

PIECES_APART_S = 1.0
"""The files of a split bag are one message apart; no recorder is stopped and started within this time."""


@dataclasses.dataclass(frozen=True, kw_only=True)
class CountedTrial:
    report: TrialReport
    recording: str
    """The same for all trials of one recording: the SHA-256 of one of its logs."""

    @property
    def experiment(self) -> str:
        """What it counts with."""
        return experiment_of(self.report.policy, self.recording, simulated=self.report.simulated)


def recorded(reports: Sequence[TrialReport]) -> tuple[list[CountedTrial], list[str]]:
    """The trials of each recording, by name, and what is left out of copies.

    Of copies the one is heard that has most, and of the others what fails outside of its time: a fall that a torn copy
    alone shows is its tear.
    """
    recordings = _recording_of_each(reports)
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
    return [CountedTrial(report=each, recording=recordings[each.sha256]) for each in ordered], sorted(silent)


def _recording_of_each(reports: Sequence[TrialReport]) -> dict[str, str]:
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


Pair = tuple[CountedTrial, Failure]
NamedBy = Callable[[tuple[float, float, float]], str]
"""What a command is called: its cell, its skill."""


def grouped(
    pairs: Iterable[Pair], trials: Sequence[CountedTrial], kinds: tuple[str, ...], least_share: float, name: NamedBy
) -> dict[str, list[Pair]]:
    """Failures by what their command is called, where enough of what was commanded so has one.

    Each experiment with such a command weighs as much as any other, by the share of its recordings that failed.
    """
    groups: dict[str, list[Pair]] = {}
    for heard, failure in pairs:
        if failure.kind in kinds and heard.report.command_known and failure.command_known:
            groups.setdefault(name(failure.command), []).append((heard, failure))
    tried: dict[str, list[CountedTrial]] = {}
    for heard in trials:
        for *command, _ in heard.report.commands:
            tried.setdefault(name((command[0], command[1], command[2])), []).append(heard)
    return {
        key: group
        for key, group in sorted(groups.items())
        if _fails_enough([heard for heard, _ in group], tried.get(key, []), least_share)
    }


def _fails_enough(failed: Sequence[CountedTrial], tried: Sequence[CountedTrial], least_share: float) -> bool:
    """Whether the mean share of failed recordings over the experiments is large enough."""
    had, all_of = _recordings_of(failed), _recordings_of([*failed, *tried])
    shares = [len(had.get(experiment, set())) / len(recordings) for experiment, recordings in all_of.items()]
    return math.fsum(shares) >= least_share * len(shares)


def _recordings_of(heard: Iterable[CountedTrial]) -> dict[str, set[str]]:
    """Experiment -> its recordings."""
    found: dict[str, set[str]] = {}
    for each in heard:
        found.setdefault(each.experiment, set()).add(each.recording)
    return found


def witnesses_of(group: Iterable[Pair]) -> tuple[Witness, ...]:
    """One a recording: its surest failure. So the logs of a change are as many as its recordings."""
    surest: dict[str, Pair] = {}
    for heard, failure in group:
        if heard.recording not in surest or failure.confidence > surest[heard.recording][1].confidence:
            surest[heard.recording] = (heard, failure)
    return tuple(
        Witness(
            trial=heard.report.trial,
            log=heard.report.file,
            sha256=heard.report.sha256,
            policy=heard.report.policy,
            simulated=heard.report.simulated,
            said=failure.text(),
        )
        for heard, failure in sorted(surest.values(), key=lambda pair: pair[0].report.trial)
    )


DEMONSTRATION = "demo/"
"""Demonstration logs are in this folder. They count until there is another log, and take effect only with approval."""


def trusted(reports: Sequence[TrialReport], rules: FeedbackRules) -> tuple[list[TrialReport], list[str]]:
    """The reports that count, and why the others do not.

    What is simulated gives way to what is real, and what is shown to what is one's own, but only to logs that count.
    """
    trust = rules.trust
    doubts = [_doubt(report, trust) for report in reports]
    sound = [report for report, doubt in zip(reports, doubts, strict=True) if not doubt]
    real = {report.robot for report in sound if not report.simulated}
    own = {report.robot for report in sound if not _is_shown(report.file)}
    kept, silent = [], []
    for report, why in zip(reports, doubts, strict=True):
        if not why and report.simulated and trust.simulated == "until_real" and report.robot in real:
            why = f"it is simulated, and there are logs of a real {report.robot}"
        elif not why and _is_shown(report.file) and report.robot in own:
            why = f"it is of the demonstration, and there are other logs of the {report.robot}"
        if why:
            silent.append(f"{report.trial} ({report.file}) does not count: {why}")
        else:
            kept.append(report)
    return kept, silent


def _doubt(report: TrialReport, trust: TrustRules) -> str:
    """Why a log by itself does not count; empty if it does."""
    if not report.policy:
        return "it does not say which policy walked"
    if not any(fnmatchcase(report.policy, pattern) for pattern in trust.policies):
        return f"policy {report.policy[:12]} is not among those whose logs count"
    if report.integrity != VERIFIED and not trust.unverified:
        return "no checksum covers its bytes"
    return "it is simulated" if report.simulated and trust.simulated == "never" else ""


def _is_shown(log: str) -> bool:
    return log.startswith(DEMONSTRATION)


def is_demonstration(change: Change) -> bool:
    """Whether a change rests on logs of the demonstration alone."""
    return all(_is_shown(each.log) for each in change.witnesses)


def doubt_of(failure: Failure, rules: FeedbackRules) -> str:
    """Why a failure of a policy does not count; empty if it does."""
    if failure.confidence < rules.trust.least_confidence:
        return f"the confidence {failure.confidence:.2f} is below {rules.trust.least_confidence:g}"
    if failure.kind == "fall" and rules.trust.attitude_confirms and not failure.evidence.get("attitude"):
        return "the attitude does not show a fall"
    return ""
