"""Rules that bound the changes proposed from failures. `data/feedback_rules.yaml` has the values and their sources."""

from dataclasses import dataclass
from typing import Annotated

from pipeline.augment.process import KINDS as STRENGTHS
from pipeline.augment.process import Strength
from pipeline.failures.failure import KINDS
from pipeline.files.ranges import COUNT, NOT_NEGATIVE, PART, POSITIVE, SHARE, Keys, OneOf, Pattern, Range, check

SIMULATED = ("always", "never", "until_real")
DIRECTIONS = ("forward", "backward", "left", "right")
LESS, MORE, BOTH = "less", "more", "both"
TIME_SCALE = "time_scale"
PERTURBATIONS = {TIME_SCALE: Strength(0.5, 1.5, neutral=1.0), **STRENGTHS}
"""Kind of perturbation of KP4 -> its allowed strengths."""


@dataclass(frozen=True, kw_only=True)
class ApprovalRules:
    """How a proposal takes effect."""

    required: bool
    """Whether a person has to approve; if not, proposed changes are approved automatically."""


@dataclass(frozen=True, kw_only=True)
class TrustRules:
    """Which logs and failures count as evidence."""

    least_confidence: Annotated[float, SHARE]
    policies: Annotated[tuple[str, ...], Pattern()]
    """Patterns of policy digests whose logs count."""
    simulated: Annotated[str, OneOf(SIMULATED)]
    """Whether simulated logs count: `always`, `never`, or `until_real`: until there is a real log of the robot."""
    unverified: bool
    """Whether logs without checksums count."""
    attitude_confirms: bool
    """Whether a fall counts only if the attitude confirms it."""
    least_share: Annotated[float, SHARE]
    """Least share of failed experiments among those with the same command cell or skill."""


@dataclass(frozen=True, kw_only=True)
class FactorRule:
    """A factor: `per_experiment` to the power of the number of experiments, at most `most`."""

    kinds: Annotated[tuple[str, ...], OneOf(KINDS)]
    per_experiment: Annotated[float, Range(1.0, 2.0)]
    most: Annotated[float, Range(1.0, 10.0)]


@dataclass(frozen=True, kw_only=True)
class Answer:
    """Failures that lead to a perturbation, and its direction relative to the original."""

    kinds: Annotated[tuple[str, ...], OneOf(KINDS)]
    directions: Annotated[tuple[str, ...], OneOf(DIRECTIONS)]
    """Directions of the failure; empty: any."""
    causes: tuple[str, ...]
    """Causes named by the failure's evidence; empty: any."""
    way: Annotated[str, OneOf((LESS, MORE, BOTH))]
    """`less` or `more` of the perturbed quantity; `both` for time scales."""


@dataclass(frozen=True, kw_only=True)
class PerturbationRule:
    """Strength of a perturbation: `first` for one experiment plus `per_experiment` for each further, up to `most`."""

    answers: tuple[Answer, ...]
    first: Annotated[float, POSITIVE]
    per_experiment: Annotated[float, NOT_NEGATIVE]
    most: Annotated[float, POSITIVE]

    def amount(self, experiments: int) -> float:
        """Allowed distance from the original for a number of experiments."""
        return min(self.first + self.per_experiment * (experiments - 1), self.most)


@dataclass(frozen=True, kw_only=True)
class MotorRule:
    """When the torque limit of a joint is lowered to the observed one."""

    kinds: Annotated[tuple[str, ...], OneOf(KINDS)]
    least_logs: Annotated[int, COUNT]
    agreement: Annotated[float, PART]
    """Largest spread of the limits observed in the logs, relative to their median."""
    least_reduction: Annotated[float, SHARE]
    """Least reduction, as a fraction of the calibrated limit."""
    lowest: Annotated[float, PART]
    """Lowest limit, as a fraction of the calibrated limit."""


@dataclass(frozen=True, kw_only=True)
class RangeRule:
    """One end of a randomization range: `start` plus `per_experiment` for each experiment, limited by `bound`."""

    kinds: Annotated[tuple[str, ...], OneOf(KINDS)]
    causes: tuple[str, ...]
    """Causes named by the failure's evidence; empty: any failure of the kinds."""
    start: float
    per_experiment: float
    bound: float


@dataclass(frozen=True)
class _AnyRange(Range):
    """Checks that a rule moves towards its bound."""

    def problem(self, value: RangeRule) -> str | None:  # pyright: ignore[reportIncompatibleMethodOverride]
        moved = (value.bound - value.start) * value.per_experiment
        step = f"moves by {value.per_experiment:g} an experiment"
        return None if moved > 0.0 else f"{step}, which is not from {value.start:g} to its bound"


@dataclass(frozen=True, kw_only=True)
class FeedbackRules:
    """`data/feedback_rules.yaml`."""

    approval: ApprovalRules
    trust: TrustRules
    weights: FactorRule
    selection: FactorRule
    augmentation: dict[str, PerturbationRule]
    """Kind of perturbation -> rule for its proposal and strength."""
    motors: MotorRule
    randomization: Annotated[dict[str, RangeRule], Keys(keys=Pattern(), values=_AnyRange())]

    def __post_init__(self) -> None:
        check(_unusable(self))


def _unusable(rules: FeedbackRules) -> list[tuple[str, str]]:
    """Faults of rules for perturbations that KP4 does not have, or not with this strength or direction."""
    faults = []
    for kind, rule in rules.augmentation.items():
        key, allowed = f"augmentation.{kind}", PERTURBATIONS.get(kind)
        if allowed is None:
            faults.append((key, f"is no kind of perturbation; kinds are: {', '.join(PERTURBATIONS)}"))
            continue
        for place, answer in enumerate(rule.answers):
            ways = (BOTH,) if kind == TIME_SCALE else (LESS, MORE)
            if answer.way not in ways:
                faults.append((f"{key}.answers[{place}].way", f"is '{answer.way}', allowed is {' or '.join(ways)}"))
                continue
            for strength in _strengths(allowed.neutral, answer.way, rule.most):
                problem = allowed.problem(strength)
                if problem is not None:
                    faults.append((f"{key}.most", f"makes a strength that {problem}"))
    return faults


def _strengths(neutral: float, way: str, amount: float) -> tuple[float, ...]:
    less, more = round(neutral - amount, 6), round(neutral + amount, 6)
    return {LESS: (less,), MORE: (more,), BOTH: (less, more)}[way]
