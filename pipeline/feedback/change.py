"""A bounded change and the logs it rests on."""

from collections.abc import Sequence
from dataclasses import dataclass

from pipeline.clips.outcome import SKILLS
from pipeline.errors import PipelineError
from pipeline.feedback.rules import BOTH, LESS, MORE, PERTURBATIONS, TIME_SCALE, FeedbackRules
from pipeline.files import digest, settings

SECTIONS: dict[str, str] = {
    "selection": "most seconds of a skill (more windows only where that bound cut some off), times",
    "augmentation": "perturbation of a skill's clips",
    "weights": "weight of a command cell, times",
    "motors": "torque limit of a joint [N m]",
    "randomization": "end of a range that training draws from",
}
"""What can change; each feeds other assets."""

DIGITS = 16
"""Hex digits of a proposal's digest: enough to distinguish what was reviewed from what is approved."""


def experiment_of(policy: str, log: str, *, simulated: bool) -> str:
    """What a log counts with: a robot's log by itself, a simulated one with all that were simulated of its policy.

    A simulator writes as many logs as one likes, so their number is no evidence: a policy in simulation is one
    experiment.

    Args:
        policy: its digest
        log: digest of the log, or of one of its recording's
    """
    return f"{policy} in simulation" if simulated else log


class ChangeError(PipelineError):
    """A change that the rules do not allow."""


@dataclass(frozen=True, kw_only=True)
class Witness:
    """A failure in a log that a change rests on."""

    trial: str
    log: str
    """File of the log."""
    sha256: str
    """Of the log's bytes."""
    policy: str
    """Digest of the policy that walked."""
    simulated: bool
    said: str
    """The failure as one line."""

    @property
    def experiment(self) -> str:
        """What it counts with; equal for all that count once."""
        return experiment_of(self.policy, self.sha256, simulated=self.simulated)


@dataclass(frozen=True, kw_only=True)
class Change:
    """One number that is to be another one."""

    section: str
    """One of `SECTIONS`."""
    robot: str
    what: str
    """Command cell, skill, joint or range; of perturbations the kind and the skill, as `foot_lift of walk`."""
    value: float
    """What it becomes; factors are 1 where nothing changes. Of playing speeds it is the width about 1."""
    before: float
    """What it is without."""
    bound: float
    """How far the rules let it go."""
    witnesses: tuple[Witness, ...]

    @property
    def logs(self) -> tuple[str, ...]:
        """Digests of the logs it rests on, each once."""
        return tuple(dict.fromkeys(each.sha256 for each in self.witnesses))

    @property
    def experiments(self) -> int:
        """How often its logs count."""
        return len({each.experiment for each in self.witnesses})

    def text(self) -> str:
        """One line for a report."""
        simulated = " (simulated)" if all(each.simulated for each in self.witnesses) else ""
        return (
            f"{self.robot}, {SECTIONS[self.section]}: {self.what} from {self.before:g} to {self.value:g} "
            f"(bound {self.bound:g}) by {self.counted()}{simulated}"
        )

    def counted(self) -> str:
        """Its logs and how often they count, as `28 logs that count as 1`."""
        logs, counts = len(self.logs), self.experiments
        alone = self.section == "motors" or counts == logs
        return f"{logs} log{'s' if logs > 1 else ''}{'' if alone else f' that count as {counts}'}"


def proposal_digest(changes: Sequence[Change]) -> str:
    """Identifies a proposal; empty where there is nothing to propose."""
    return digest.of_json(settings.plain(changes))[:DIGITS] if changes else ""


def check_bounds(changes: Sequence[Change], rules: FeedbackRules) -> None:
    """Raises ChangeError for changes beyond what the rules allow, all of them at once.

    That holds for every change that takes effect, by whatever hand its file was written. The number of experiments
    counts too: one can't move what takes two.
    """
    faults = [fault for each in changes for fault in _faults(each, rules)]
    seen: set[tuple[str, str, str]] = set()
    for each in changes:
        place = place_of(each)
        if place in seen:
            faults.append(f"{each.section} {each.what} of {each.robot} is there twice")
        seen.add(place)
    if faults:
        raise ChangeError("; ".join(faults))


def _faults(change: Change, rules: FeedbackRules) -> list[str]:
    name = f"{change.section} '{change.what}'"
    if not change.witnesses:
        return [f"{name} names no log that it rests on"]
    skill = _skill(change)
    if skill is not None and skill not in SKILLS:
        return [f"{name} names no skill; there are: {', '.join(SKILLS)}"]
    allowed = allowed_range(change, rules)
    if allowed is None:
        return [f"{name} is nothing that data/feedback_rules.yaml has a rule for"]
    start = _start(change, rules)
    if start is not None and change.before != start:
        return [f"{name} is {change.before:g} before, but {start:g} by the rules"]
    low, high = allowed
    if not low - 1e-9 <= change.value <= high + 1e-9:
        return [f"{name} is {change.value:g}; by {change.counted()} allowed is {low:g} to {high:g}"]
    return []


def perturbation_of(what: str) -> tuple[str, str]:
    """Kind and skill of a perturbation. A skill alone, as files have it that were approved when there was nothing else,
    means its playing speeds."""
    kind, _, skill = what.rpartition(" of ")
    return kind or TIME_SCALE, skill


def place_of(change: Change) -> tuple[str, str, str]:
    """What a change is of: section, robot, number. Two changes of one place contradict each other."""
    what = " of ".join(perturbation_of(change.what)) if change.section == "augmentation" else change.what
    return change.section, change.robot, what


def _skill(change: Change) -> str | None:
    """The skill that a change is of, known or not; None where it is of none."""
    if change.section == "augmentation":
        return perturbation_of(change.what)[1]
    return change.what if change.section == "selection" else None


def neutral(kind: str) -> float:
    """The value of a change that would leave a perturbation of that kind away."""
    return 0.0 if kind == TIME_SCALE else PERTURBATIONS[kind].neutral


def _start(change: Change, rules: FeedbackRules) -> float | None:
    """What the rules say that a change is without; None where they do not say."""
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
    """Lowest and highest value that a change may have by the logs it rests on; None where there is no rule.

    Experiments are counted. Of a motor's limit it is logs: they measure it, and more of them move it no further.
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
