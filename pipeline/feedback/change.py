"""A bounded change of one number, and the logs that support it."""

from collections.abc import Sequence
from dataclasses import dataclass

from pipeline.clips.outcome import SKILLS
from pipeline.errors import PipelineError
from pipeline.feedback.rules import BOTH, LESS, MORE, PERTURBATIONS, TIME_SCALE, FeedbackRules
from pipeline.files import digest, settings

SECTIONS: dict[str, str] = {
    "selection": "factor on the limit of a skill's seconds (adds windows only if the limit excluded some)",
    "augmentation": "perturbation of a skill's clips",
    "weights": "factor on the weight of a command cell",
    "motors": "torque limit of a joint [N m]",
    "randomization": "end of a randomization range of training",
}
"""Section -> meaning of the numbers that it changes."""

DIGITS = 16
"""Hex digits of a proposal's digest."""


def experiment_of(policy: str, log: str, *, simulated: bool) -> str:
    """Id of the experiment that a log belongs to. Each experiment counts once as evidence.

    A real log is one experiment. All simulated logs of a policy together are one experiment, because a simulator can
    produce any number of logs.

    Args:
        policy: digest of the policy
        log: digest of the log, or of the first log of its recording
        simulated: whether the log is simulated
    """
    return f"{policy} in simulation" if simulated else log


class ChangeError(PipelineError):
    """A change is outside the rules."""


@dataclass(frozen=True, kw_only=True)
class Witness:
    """A failure in a log, as evidence for a change."""

    trial: str
    log: str
    """Path of the log in data/hardware_logs."""
    sha256: str
    """SHA-256 of the log's bytes."""
    policy: str
    """Digest of the policy in the log."""
    simulated: bool
    said: str
    """The failure as one line."""

    @property
    def experiment(self) -> str:
        """Id of its experiment (`experiment_of`)."""
        return experiment_of(self.policy, self.sha256, simulated=self.simulated)


@dataclass(frozen=True, kw_only=True)
class Change:
    """A change of one number."""

    section: str
    """One of `SECTIONS`."""
    robot: str
    what: str
    """Command cell, skill, joint or range; for a perturbation its kind and skill, for example `foot_lift of walk`."""
    value: float
    """New value. A factor of 1 changes nothing. For time scales, it is the distance from 1."""
    before: float
    """Value without the change."""
    bound: float
    """Limit of the value by the rules."""
    witnesses: tuple[Witness, ...]

    @property
    def logs(self) -> tuple[str, ...]:
        """Digests of the supporting logs, without duplicates."""
        return tuple(dict.fromkeys(each.sha256 for each in self.witnesses))

    @property
    def experiments(self) -> int:
        """Number of experiments that the supporting logs count as."""
        return len({each.experiment for each in self.witnesses})

    def text(self) -> str:
        """One line for a report."""
        simulated = " (simulated)" if all(each.simulated for each in self.witnesses) else ""
        return (
            f"{self.robot}, {SECTIONS[self.section]}: {self.what} from {self.before:g} to {self.value:g} "
            f"(bound {self.bound:g}) by {self.counted()}{simulated}"
        )

    def counted(self) -> str:
        """Number of logs and of experiments, for example `28 logs that count as 1`."""
        logs, counts = len(self.logs), self.experiments
        alone = self.section == "motors" or counts == logs
        return f"{logs} log{'s' if logs > 1 else ''}{'' if alone else f' that count as {counts}'}"


def proposal_digest(changes: Sequence[Change]) -> str:
    """Digest that identifies a proposal; empty without changes."""
    return digest.of_json(settings.plain(changes))[:DIGITS] if changes else ""


def check_bounds(changes: Sequence[Change], rules: FeedbackRules) -> None:
    """Check changes against the rules. Raises one ChangeError with all faults.

    Every change that takes effect is checked, including changes edited by hand. The allowed range depends on the number
    of experiments that support the change.
    """
    faults = [fault for each in changes for fault in _faults(each, rules)]
    seen: set[tuple[str, str, str]] = set()
    for each in changes:
        key = change_key(each)
        if key in seen:
            faults.append(f"{each.section} {each.what} of {each.robot} occurs twice")
        seen.add(key)
    if faults:
        raise ChangeError("; ".join(faults))


def _faults(change: Change, rules: FeedbackRules) -> list[str]:
    name = f"{change.section} '{change.what}'"
    if not change.witnesses:
        return [f"{name} names no log that supports it"]
    skill = _skill(change)
    if skill is not None and skill not in SKILLS:
        return [f"{name} names no skill; skills are: {', '.join(SKILLS)}"]
    allowed = allowed_range(change, rules)
    if allowed is None:
        return [f"{name} has no rule in data/feedback_rules.yaml"]
    start = _start(change, rules)
    if start is not None and change.before != start:
        return [f"{name} has the value {change.before:g} before the change, but {start:g} by the rules"]
    low, high = allowed
    if not low - 1e-9 <= change.value <= high + 1e-9:
        return [f"{name} is {change.value:g}; with {change.counted()}, {low:g} to {high:g} is allowed"]
    return []


def perturbation_of(what: str) -> tuple[str, str]:
    """Kind and skill of a perturbation. Older files name only the skill, which means its time scales."""
    kind, _, skill = what.rpartition(" of ")
    return kind or TIME_SCALE, skill


def change_key(change: Change) -> tuple[str, str, str]:
    """Section, robot and item that a change sets. Two changes with the same key contradict each other."""
    what = " of ".join(perturbation_of(change.what)) if change.section == "augmentation" else change.what
    return change.section, change.robot, what


def _skill(change: Change) -> str | None:
    """The skill that a change names, known or not; None in sections without skills."""
    if change.section == "augmentation":
        return perturbation_of(change.what)[1]
    return change.what if change.section == "selection" else None


def neutral(kind: str) -> float:
    """The value at which a perturbation of this kind has no effect."""
    return 0.0 if kind == TIME_SCALE else PERTURBATIONS[kind].neutral


def _start(change: Change, rules: FeedbackRules) -> float | None:
    """Value without the change by the rules; None if the rules do not define it."""
    if change.section == "randomization":
        return rules.randomization[change.what].start
    return neutral(perturbation_of(change.what)[0]) if change.section == "augmentation" else None


def _strengths_allowed(change: Change, rules: FeedbackRules) -> tuple[float, float] | None:
    kind, _ = perturbation_of(change.what)
    rule = rules.augmentation.get(kind)
    if rule is None:
        return None
    ways = {answer.way for answer in rule.answers}
    without, amount = neutral(kind), rule.amount(change.experiments)
    return without - amount * (LESS in ways), without + amount * bool({MORE, BOTH} & ways)


def allowed_range(change: Change, rules: FeedbackRules) -> tuple[float, float] | None:
    """Lowest and highest value that the supporting logs allow; None without a rule.

    The range grows with the number of experiments. A motor's limit is measured instead: it needs a minimum number of
    logs, and more logs do not widen the range.
    """
    if change.section in ("weights", "selection"):
        rule = rules.weights if change.section == "weights" else rules.selection
        return 1.0, min(rule.per_experiment**change.experiments, rule.most)
    if change.section == "augmentation":
        return _strengths_allowed(change, rules)
    if change.section == "motors":
        enough = len(change.logs) >= rules.motors.least_logs
        return rules.motors.lowest * change.before if enough else change.before, change.before
    ranges = rules.randomization.get(change.what)
    if change.section != "randomization" or ranges is None:
        return None
    moved = ranges.start + ranges.per_experiment * change.experiments
    moved = min(moved, ranges.bound) if ranges.per_experiment > 0.0 else max(moved, ranges.bound)
    return min(ranges.start, moved), max(ranges.start, moved)
