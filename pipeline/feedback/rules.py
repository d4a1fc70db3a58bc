"""How far failures may move what is curated. `data/feedback_rules.yaml` has the values and their sources."""

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
"""Kind of perturbation of KP4 -> strengths that it may have."""


@dataclass(frozen=True, kw_only=True)
class ApprovalRules:
    """Who lets a proposal take effect."""

    required: bool
    """Whether a person has to approve; if not, what is proposed is approved at once."""


@dataclass(frozen=True, kw_only=True)
class TrustRules:
    """Which failures count."""

    least_confidence: Annotated[float, SHARE]
    policies: Annotated[tuple[str, ...], Pattern()]
    """Patterns of policy digests."""
    simulated: Annotated[str, OneOf(SIMULATED)]
    """`always`, `never`, or `until_real`: as long as there is no real log of the robot."""
    unverified: bool
    """Whether logs count whose bytes no checksum covers."""
    attitude_confirms: bool
    """Whether a fall counts only where the attitude shows it."""
    least_share: Annotated[float, SHARE]
    """Of the experiments with such a command, that failed."""


@dataclass(frozen=True, kw_only=True)
class FactorRule:
    """A factor on something that is there: `per_experiment` to the power of the experiments, at most `most`."""

    kinds: Annotated[tuple[str, ...], OneOf(KINDS)]
    per_experiment: Annotated[float, Range(1.0, 2.0)]
    most: Annotated[float, Range(1.0, 10.0)]


@dataclass(frozen=True, kw_only=True)
class Answer:
    """Failures that a kind of perturbation answers, and to which side of the original."""

    kinds: Annotated[tuple[str, ...], OneOf(KINDS)]
    directions: Annotated[tuple[str, ...], OneOf(DIRECTIONS)]
    """Directions that the failure has to have; none: any."""
    causes: tuple[str, ...]
    """Causes that the failure's evidence has to name; none: any."""
    way: Annotated[str, OneOf((LESS, MORE, BOTH))]
    """`less` or `more` of what is perturbed; `both` for playing speeds."""


@dataclass(frozen=True, kw_only=True)
class PerturbationRule:
    """A kind of perturbation: beside the original it begins at `first`, grows by `per_experiment`, ends at `most`."""

    answers: tuple[Answer, ...]
    first: Annotated[float, POSITIVE]
    per_experiment: Annotated[float, NOT_NEGATIVE]
    most: Annotated[float, POSITIVE]

    def amount(self, experiments: int) -> float:
        """How far from the original this many experiments let it go."""
        return min(self.first + self.per_experiment * (experiments - 1), self.most)


@dataclass(frozen=True, kw_only=True)
class MotorRule:
    """When a joint's torque limit is what its robot showed."""

    kinds: Annotated[tuple[str, ...], OneOf(KINDS)]
    least_logs: Annotated[int, COUNT]
    agreement: Annotated[float, PART]
    """Largest spread of the logs' limits over their median."""
    least_reduction: Annotated[float, SHARE]
    """Least reduction, of the calibrated limit."""
    lowest: Annotated[float, PART]
    """Lowest limit, of the calibrated one."""


@dataclass(frozen=True, kw_only=True)
class RangeRule:
    """One end of a range that training draws from: `start` + `per_experiment` an experiment, as far as `bound`."""

    kinds: Annotated[tuple[str, ...], OneOf(KINDS)]
    causes: tuple[str, ...]
    """Causes that the failure's evidence has to name; none: any failure of the kinds."""
    start: float
    per_experiment: float
    bound: float


@dataclass(frozen=True)
class _AnyRange(Range):
    """A rule that moves towards its bound."""

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
    """Kind of perturbation -> when it is proposed, and how strongly."""
    motors: MotorRule
    randomization: Annotated[dict[str, RangeRule], Keys(keys=Pattern(), values=_AnyRange())]

    def __post_init__(self) -> None:
        check(_unusable(self))


def _unusable(rules: FeedbackRules) -> list[tuple[str, str]]:
    """Faults of rules for perturbations that KP4 does not have, or not so strong or to that side."""
    faults = []
    for kind, rule in rules.augmentation.items():
        key, allowed = f"augmentation.{kind}", PERTURBATIONS.get(kind)
        if allowed is None:
            faults.append((key, f"is no kind of perturbation, there are: {', '.join(PERTURBATIONS)}"))
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
