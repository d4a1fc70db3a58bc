"""Which logs and failures count as evidence, why others do not, and which logs belong to one recording.

A torn, split or re-saved copy of a log is no additional evidence. Two trials belong to one recording

- if their bytes are equal, or
- if their times overlap, the robot is the same, and the sensor data are equal in every half second that both contain
  completely, or
- if their times overlap or one follows the other within `PIECES_APART_S` (files of a split bag), and robot, policy and
  `simulated` are the same. Exception: simulated trials with different sensor data, because all virtual robots start at
  the same clock time.

Real logs need no equal data, because two recorders of one walk stamp the messages differently. As a consequence, two
robots of one model that walk with one policy at the same time count once, and so do two simulated logs with equal
beginnings if there is a short copy that matches both. In doubt, less evidence is counted.
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
"""Largest gap between the files of a split bag [s]. Real gaps are one message; restarting a recorder takes longer."""


@dataclasses.dataclass(frozen=True, kw_only=True)
class CountedTrial:
    """A trial that counts as evidence."""

    report: TrialReport
    recording: str
    """Id of its recording: the SHA-256 of one of the recording's logs."""

    @property
    def experiment(self) -> str:
        """Id of its experiment (`experiment_of`)."""
        return experiment_of(self.report.policy, self.recording, simulated=self.report.simulated)


def without_copies(reports: Sequence[TrialReport]) -> tuple[list[CountedTrial], list[str]]:
    """The trials with their recordings, sorted by name, and a message for each copy.

    Among copies, the most complete one counts with all failures, the others only with failures outside its time span: a
    fall that only a torn copy shows is an effect of the damage.
    """
    recordings = _recording_of_each(reports)
    counting: list[TrialReport] = []
    messages: list[str] = []
    for report in sorted(reports, key=_completeness):
        same = [each for each in counting if recordings[each.sha256] == recordings[report.sha256]]
        copies = [each for each in same if each.file != report.file and _overlap(each, report)]
        kept = tuple(each for each in report.failures if not any(_covers(copy, report, each) for copy in copies))
        if copies:
            other = copies[0].file
            messages.append(
                f"{report.trial} ({report.file}) is of the same recording as {other} and counts once with it"
            )
        counting.append(dataclasses.replace(report, failures=kept))
    ordered = sorted(counting, key=lambda each: each.trial)
    return [CountedTrial(report=each, recording=recordings[each.sha256]) for each in ordered], sorted(messages)


def _recording_of_each(reports: Sequence[TrialReport]) -> dict[str, str]:
    """SHA-256 of each log -> SHA-256 that identifies its recording."""
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


def _one_recording(one: TrialReport, other: TrialReport, windows: dict[int, str], others: dict[int, str]) -> bool:
    """Whether two trials that overlap or follow each other belong to one recording.

    Args:
        one: the earlier trial
        other: the later trial
        windows: half second -> digest of its sensor data, of `one`
        others: the same of `other`
    """
    both = windows.keys() & others.keys()
    alike = all(windows[each] == others[each] for each in both)
    if one.robot != other.robot:
        return False
    if both and alike:
        return True
    metadata_alike = one.policy == other.policy and one.simulated == other.simulated
    return metadata_alike and (alike or not one.simulated)


def _completeness(report: TrialReport) -> tuple[bool, int, bool, float, str, str]:
    """Sort key of copies: the most complete one comes first."""
    known = len(windows_of(report.fingerprint, 0))
    return (not report.command_known, -known, not report.whole, -report.seconds, report.trial, report.file)


def _overlap(one: TrialReport, other: TrialReport) -> bool:
    """Whether two trials of one recording overlap in time; without known times, whether their bytes are equal."""
    first, second = one.span_ns, other.span_ns
    if first is None or second is None:
        return one.sha256 == other.sha256
    return first[0] < second[1] and second[0] < first[1]


def _covers(copy: TrialReport, report: TrialReport, failure: Failure) -> bool:
    """Whether the time span of `copy` contains the beginning of a failure in `report`."""
    span = copy.span_ns
    if span is None or report.start_ns is None:
        return True
    return span[0] <= report.start_ns + round(failure.time_s * 1e9) <= span[1]


Pair = tuple[CountedTrial, Failure]
CommandNamer = Callable[[tuple[float, float, float]], str]
"""Function from a command to the name of its cell or skill."""


def grouped(
    pairs: Iterable[Pair],
    trials: Sequence[CountedTrial],
    kinds: tuple[str, ...],
    least_share: float,
    name: CommandNamer,
) -> dict[str, list[Pair]]:
    """Group failures by cell or skill of their command; keep groups in which a sufficient share of experiments failed.

    The share of an experiment is the share of its recordings that failed; all experiments have equal weight.

    Args:
        pairs: trials with their failures
        trials: all trials that count
        kinds: kinds of failure to group
        least_share: least mean share of failed recordings, 0 to 1
        name: names the cell or skill of a command
    """
    groups: dict[str, list[Pair]] = {}
    for trial, failure in pairs:
        if failure.kind in kinds and trial.report.command_known and failure.command_known:
            groups.setdefault(name(failure.command), []).append((trial, failure))
    tried: dict[str, list[CountedTrial]] = {}
    for trial in trials:
        for *command, _ in trial.report.commands:
            tried.setdefault(name((command[0], command[1], command[2])), []).append(trial)
    return {
        key: group
        for key, group in sorted(groups.items())
        if _fails_enough([trial for trial, _ in group], tried.get(key, []), least_share)
    }


def _fails_enough(failed: Sequence[CountedTrial], tried: Sequence[CountedTrial], least_share: float) -> bool:
    """Whether the mean share of failed recordings over the experiments is at least `least_share`."""
    failures, all_of = _recordings_of(failed), _recordings_of([*failed, *tried])
    shares = [len(failures.get(experiment, set())) / len(recordings) for experiment, recordings in all_of.items()]
    return math.fsum(shares) >= least_share * len(shares)


def _recordings_of(trials: Iterable[CountedTrial]) -> dict[str, set[str]]:
    """Experiment -> its recordings."""
    found: dict[str, set[str]] = {}
    for each in trials:
        found.setdefault(each.experiment, set()).add(each.recording)
    return found


def witnesses_of(group: Iterable[Pair]) -> tuple[Witness, ...]:
    """One witness per recording: its failure with the highest confidence."""
    surest: dict[str, Pair] = {}
    for trial, failure in group:
        if trial.recording not in surest or failure.confidence > surest[trial.recording][1].confidence:
            surest[trial.recording] = (trial, failure)
    return tuple(
        Witness(
            trial=trial.report.trial,
            log=trial.report.file,
            sha256=trial.report.sha256,
            policy=trial.report.policy,
            simulated=trial.report.simulated,
            said=failure.text(),
        )
        for trial, failure in sorted(surest.values(), key=lambda pair: pair[0].report.trial)
    )


DEMONSTRATION = "demo/"
"""Folder of the demonstration logs. They count until the robot has another log, and always require approval."""


def trusted(reports: Sequence[TrialReport], rules: FeedbackRules) -> tuple[list[TrialReport], list[str]]:
    """The reports that count, and the reasons why the others do not.

    A real log that counts excludes simulated logs (rule `until_real`), and any other log that counts excludes the
    demonstration logs.
    """
    trust = rules.trust
    doubts = [_doubt(report, trust) for report in reports]
    sound = [report for report, doubt in zip(reports, doubts, strict=True) if not doubt]
    real = {report.robot for report in sound if not report.simulated}
    own = {report.robot for report in sound if not _is_demonstration_log(report.file)}
    kept, excluded = [], []
    for report, why in zip(reports, doubts, strict=True):
        if not why and report.simulated and trust.simulated == "until_real" and report.robot in real:
            why = f"it is simulated, and there are logs of a real {report.robot}"
        elif not why and _is_demonstration_log(report.file) and report.robot in own:
            why = f"it is a demonstration log, and there are other logs of the {report.robot}"
        if why:
            excluded.append(f"{report.trial} ({report.file}) does not count: {why}")
        else:
            kept.append(report)
    return kept, excluded


def _doubt(report: TrialReport, trust: TrustRules) -> str:
    """Why a log by itself does not count; empty if it does."""
    if not report.policy:
        return "it names no policy"
    if not any(fnmatchcase(report.policy, pattern) for pattern in trust.policies):
        return f"policy {report.policy[:12]} is excluded by the rules"
    if report.integrity != VERIFIED and not trust.unverified:
        return "it has no checksums"
    return "it is simulated" if report.simulated and trust.simulated == "never" else ""


def _is_demonstration_log(log: str) -> bool:
    return log.startswith(DEMONSTRATION)


def is_demonstration(change: Change) -> bool:
    """Whether only demonstration logs support a change."""
    return all(_is_demonstration_log(each.log) for each in change.witnesses)


def doubt_of(failure: Failure, rules: FeedbackRules) -> str:
    """Why a failure of a policy does not count; empty if it does."""
    if failure.confidence < rules.trust.least_confidence:
        return f"the confidence {failure.confidence:.2f} is below {rules.trust.least_confidence:g}"
    if failure.kind == "fall" and rules.trust.attitude_confirms and not failure.evidence.get("attitude"):
        return "the attitude does not confirm the fall"
    return ""
