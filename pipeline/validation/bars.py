"""What `data/validation.yaml` states: what each verdict asks, in which unit, and where the number comes from.

Its rules are written by hand; its bars are derived from a reference policy by `pipeline.validation.derive`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from pipeline.files.ranges import NOT_NEGATIVE, SHARE, OneOf, check
from pipeline.validation.figures import FIGURES
from pipeline.validation.measure import Measured


@dataclass(frozen=True, kw_only=True)
class Margin:
    """How much worse than the reference policy's worst a policy may be."""

    share: float
    """Of the reference's figure."""
    absolute: float
    """In the figure's unit; added to the share."""
    unit: str
    source: str

    def __post_init__(self) -> None:
        check(self, share=NOT_NEGATIVE, absolute=NOT_NEGATIVE)

    def bar(self, worst: float, lower_is_better: bool) -> float:
        """The bar for the reference's worst figure."""
        sign = 1.0 if lower_is_better else -1.0
        return worst + sign * (self.share * abs(worst) + self.absolute)


@dataclass(frozen=True, kw_only=True)
class Required:
    """When the reference policy counts as doing a cell, so that the cell is required of others."""

    error_share: float
    """Of the commanded speed or yaw rate: largest error."""
    least_error: float
    """Errors up to this do not count [m/s or rad/s]."""
    survival: float
    """Least share of trials of a push or a perturbed start."""
    period_difference: float
    """Of strides in two engines, as a share: beyond it they are not the same gait."""
    source: str

    def __post_init__(self) -> None:
        check(self, error_share=SHARE, least_error=NOT_NEGATIVE, survival=SHARE, period_difference=SHARE)


@dataclass(frozen=True, kw_only=True)
class Reference:
    """The policy that the bars come from."""

    policy: str
    """Its digest."""
    robot: str
    """Digest of the robot."""
    ankle_kd: tuple[float, ...]
    """It was measured with each; the worst counts [N m s/rad]."""
    command: str
    """What derives the cells again."""

    def note_on(self, robot: str) -> str:
        """What has to be known of a verdict on the robot of this digest: that the bars are another robot's, and what to
        do; empty where they are its own."""
        if robot == self.robot:
            return ""
        return (
            f"the bars of data/validation.yaml were derived on another robot ({self.robot[:12]}) than the one judged "
            f"({robot[:12]}). Where that is a robot before its adaptation, materialize `adapted_robot` and judge "
            "again; where the robot itself has changed, read the verdict as one on the changed robot, or derive the "
            "bars anew (docs/validation.md)."
        )


@dataclass(frozen=True, kw_only=True)
class Bar:
    """What one figure of a cell has to be."""

    unit: str
    source: str
    at_most: float | None = None
    at_least: float | None = None

    def __post_init__(self) -> None:
        sides = [name for name in ("at_most", "at_least") if getattr(self, name, None) is not None]
        check(self, [] if len(sides) == 1 else [("at_most", "and 'at_least': allowed is exactly one of both")])

    def holds(self, value: float) -> bool:
        """Whether a figure is good enough."""
        return (self.at_most is None or value <= self.at_most) and (self.at_least is None or value >= self.at_least)

    def __str__(self) -> str:
        side, value = ("at most", self.at_most) if self.at_most is not None else ("at least", self.at_least)
        return f"{side} {value:g} {self.unit}"


@dataclass(frozen=True, kw_only=True)
class CellBars:
    """Whether a cell counts, and its bars."""

    required: bool
    why: str
    """Why it does not count; empty where it does."""
    bars: dict[str, Bar]
    """By figure, of `FIGURES`."""

    def __post_init__(self) -> None:
        names = OneOf(tuple(FIGURES))
        check(
            self, [(f"bars.{name}", problem) for name in getattr(self, "bars", {}) if (problem := names.problem(name))]
        )


UNKNOWN = CellBars(required=False, why="data/validation.yaml has no bars for it", bars={})
"""Of a cell that the file doesn't know."""


@dataclass(frozen=True, kw_only=True)
class Tolerance:
    """How far the figures of two engines may be apart."""

    at_most: float
    unit: str
    source: str
    share: float = 0.0
    """Of the speed; the larger of both holds."""

    def __post_init__(self) -> None:
        check(self, at_most=NOT_NEGATIVE, share=NOT_NEGATIVE)

    def of(self, speed: float) -> float:
        """The tolerance of a walk at this speed [m/s]."""
        return max(self.at_most, self.share * speed)


@dataclass(frozen=True, kw_only=True)
class Agreement:
    """Of the means over a cell's seeds in MuJoCo and in DART."""

    velocity: Tolerance
    """Forward and lateral."""
    yaw_rate: Tolerance
    height: Tolerance
    """Of the root."""


@dataclass(frozen=True, kw_only=True)
class ValidationSettings:
    """The whole file."""

    margins: dict[str, Margin]
    required: Required
    agreement: Agreement
    reference: Reference
    cells: dict[str, CellBars]
    """What `mujoco_validation` asks."""
    engines: dict[str, CellBars]
    """What `cross_engine_validation` asks of each walk in MuJoCo and in DART."""
    webots: dict[str, CellBars]
    """What `webots_validation` asks of each segment of its walk."""
    limit_cycles: dict[str, CellBars]
    """What `limit_cycles` asks of DART against MuJoCo at each speed."""


def derived(runs: Sequence[Sequence[Measured]], margins: dict[str, Margin], required: Required) -> dict[str, CellBars]:
    """Bars of each cell from several measurements of it (the same cells in the same order)."""
    return {same[0].cell.name: _cell_bars(same, margins, required) for same in zip(*runs, strict=True)}


def _cell_bars(same: Sequence[Measured], margins: dict[str, Margin], required: Required) -> CellBars:
    reasons = [reason for one in same for reason in _failures(one, required)]
    bars = {}
    for name in same[0].cell.figures:
        values = [value for value in (one.figure(name) for one in same) if value is not None]
        if values and len(values) == len(same):
            trials = f"{sum(len(one.trials) for one in same)} trials"
            bars[name] = bar_of(name, max(values) if FIGURES[name].lower_is_better else min(values), trials, margins)
    return CellBars(required=not reasons, why="; ".join(dict.fromkeys(reasons)), bars=bars)


def bar_of(name: str, worst: float, trials: str, margins: dict[str, Margin]) -> Bar:
    """The bar of a figure for the reference's worst of so many trials."""
    lower = FIGURES[name].lower_is_better
    bar = round(margins[name].bar(worst, lower), 4)
    side = {"at_most": bar} if lower else {"at_least": max(bar, 0.0)}
    source = f"reference's worst {worst:.4g} of {trials}, and the margin"
    return Bar(unit=FIGURES[name].unit, source=source, **side)


def missed(errors: dict[str, float], sizes: dict[str, float], required: Required) -> list[str]:
    """Of each figure of tracking whose error is too large for a command of this size, a sentence."""
    return [
        f"the reference misses the command by {error:.2f} {FIGURES[name].unit}"
        for name, error in errors.items()
        if error > max(required.error_share * sizes[name], required.least_error)
    ]


def _failures(one: Measured, required: Required) -> list[str]:
    """Why the reference does not do a cell."""
    judged = one.cell.figures
    if "survival" in judged:
        survival = one.figure("survival")
        assert survival is not None
        return [] if survival >= required.survival else [f"the reference survives {survival:.2f} of it"]
    if one.fallen:
        return [f"the reference falls in {len(one.fallen)} of {len(one.trials)}"]
    wanted = one.cell.trials[0].command.last
    asked = {"speed_error": (wanted.forward**2 + wanted.lateral**2) ** 0.5, "yaw_rate_error": abs(wanted.yaw_rate)}
    errors = {name: error for name in asked if name in judged and (error := one.figure(name)) is not None}
    return missed(errors, asked, required)
