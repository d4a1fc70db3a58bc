"""How far failures may move what is curated. `data/feedback_rules.yaml` has the values and their sources."""

from __future__ import annotations

from dataclasses import dataclass

from pipeline.failures.failure import KINDS
from pipeline.files.ranges import COUNT, PART, SHARE, Keys, OneOf, Pattern, Range, check

SIMULATED = ("always", "never", "until_real")


@dataclass(frozen=True, kw_only=True)
class ApprovalRules:
    """Who lets a proposal take effect."""

    required: bool
    """Whether a person has to approve; if not, what is proposed is approved at once."""


@dataclass(frozen=True, kw_only=True)
class TrustRules:
    """Which failures count."""

    least_confidence: float
    policies: tuple[str, ...]
    """Patterns of policy digests."""
    simulated: str
    """`always`, `never`, or `until_real`: as long as there is no real log of the robot."""
    unverified: bool
    """Whether logs count whose bytes no checksum covers."""
    attitude_confirms: bool
    """Whether a fall counts only where the attitude shows it."""
    least_share: float
    """Of the logs with such a command, that failed."""

    def __post_init__(self) -> None:
        check(self, least_confidence=SHARE, policies=Pattern(), simulated=OneOf(SIMULATED), least_share=SHARE)


@dataclass(frozen=True, kw_only=True)
class FactorRule:
    """A factor on something that is there: `per_log` to the power of the logs, at most `most`."""

    kinds: tuple[str, ...]
    per_log: float
    most: float

    def __post_init__(self) -> None:
        check(self, kinds=OneOf(KINDS), per_log=Range(1.0, 2.0), most=Range(1.0, 10.0))


@dataclass(frozen=True, kw_only=True)
class WidthRule:
    """A width that begins at `first` and grows by `per_log`, at most to `most`."""

    kinds: tuple[str, ...]
    first: float
    per_log: float
    most: float

    def __post_init__(self) -> None:
        check(self, kinds=OneOf(KINDS), first=Range(0.01, 0.5), per_log=Range(0.0, 0.5), most=Range(0.01, 0.5))


@dataclass(frozen=True, kw_only=True)
class MotorRule:
    """When a joint's torque limit is what its robot showed."""

    kinds: tuple[str, ...]
    least_logs: int
    agreement: float
    """Largest spread of the logs' limits over their median."""
    least_reduction: float
    """Least reduction, of the calibrated limit."""
    lowest: float
    """Lowest limit, of the calibrated one."""

    def __post_init__(self) -> None:
        check(self, kinds=OneOf(KINDS), least_logs=COUNT, agreement=PART, least_reduction=SHARE, lowest=PART)


@dataclass(frozen=True, kw_only=True)
class RangeRule:
    """One end of a range that training draws from: `start` + `per_log` a log, as far as `bound`."""

    kinds: tuple[str, ...]
    causes: tuple[str, ...]
    """Causes that the failure's evidence has to name; none: any failure of the kinds."""
    start: float
    per_log: float
    bound: float

    def __post_init__(self) -> None:
        check(self, kinds=OneOf(KINDS))


@dataclass(frozen=True, kw_only=True)
class FeedbackRules:
    """`data/feedback_rules.yaml`."""

    approval: ApprovalRules
    trust: TrustRules
    weights: FactorRule
    selection: FactorRule
    augmentation: WidthRule
    motors: MotorRule
    randomization: dict[str, RangeRule]

    def __post_init__(self) -> None:
        check(self, randomization=Keys(keys=Pattern(), values=_AnyRange()))


@dataclass(frozen=True)
class _AnyRange(Range):
    """A rule that moves towards its bound."""

    def problem(self, value: RangeRule) -> str | None:  # pyright: ignore[reportIncompatibleMethodOverride]
        moved = (value.bound - value.start) * value.per_log
        return (
            None if moved > 0.0 else f"moves by {value.per_log:g} a log, which is not from {value.start:g} to its bound"
        )
