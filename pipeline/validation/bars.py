"""The thresholds (bars) of each verdict, with unit and source.

The rules in `data/validation.yaml` are written by hand, and scaled to each robot's size. The bars of a robot are in
`robots/<robot>/validation.yaml`, derived from a reference policy by `pipeline.validation.derive`, or stated by hand
where no policy walks on the robot yet.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated, TypeVar

from pipeline.errors import SettingsError
from pipeline.files import settings
from pipeline.files.ranges import NOT_NEGATIVE, SHARE, Keys, OneOf, check
from pipeline.files.sourced import Scaled
from pipeline.robot import Robot
from pipeline.robot.size import RobotSize, ratios_to
from pipeline.validation.figures import FIGURES, Measured


@dataclass(frozen=True, kw_only=True)
class Margin:
    """Margin beyond the reference policy's worst trial."""

    share: Annotated[float, NOT_NEGATIVE]
    """Share of the reference's figure."""
    absolute: Annotated[float, NOT_NEGATIVE]
    """Added to the share, in the figure's unit."""
    unit: str
    source: str

    def bar(self, worst: float, lower_is_better: bool) -> float:
        """The bar for the reference's worst figure."""
        sign = 1.0 if lower_is_better else -1.0
        return worst + sign * (self.share * abs(worst) + self.absolute)


@dataclass(frozen=True, kw_only=True)
class Required:
    """When the reference policy counts as passing a cell, which makes the cell required."""

    error_share: Annotated[float, SHARE]
    """Largest error as a share of the commanded speed or yaw rate."""
    least_error: Annotated[float, NOT_NEGATIVE]
    """Errors up to this are accepted [m/s or rad/s]."""
    survival: Annotated[float, SHARE]
    """Least share of trials of a push or a perturbed start."""
    period_difference: Annotated[float, SHARE]
    """Largest relative difference of stride periods in two engines that is still the same gait."""
    source: str


@dataclass(frozen=True, kw_only=True)
class Reference:
    """Origin of the bars: a reference policy, or, with empty digests, a statement."""

    policy: str
    """Digest of the policy; empty if the bars were stated by hand."""
    robot: str
    """Digest of the robot; empty if the bars were stated by hand."""
    ankle_kd: tuple[float, ...]
    """Ankle damping values it was measured with; the worst counts [N m s/rad]. Empty: the policy's own."""
    command: str
    """The command that derives the bars again, or the source of stated ones."""

    def note_on(self, robot: str) -> str:
        """Note on a verdict for the robot with this digest if the bars belong to another robot; otherwise empty."""
        if self.robot in ("", robot):
            return ""
        return (
            f"the bars of the robot's validation.yaml were derived on another robot ({self.robot[:12]}) than the "
            f"evaluated one ({robot[:12]}). If that robot is not adapted yet, materialize `adapted_robot` and validate "
            "again; if the robot itself has changed, read the verdict as one on the changed robot, or derive the bars "
            "again (docs/validation.md)."
        )


@dataclass(frozen=True, kw_only=True)
class Bar:
    """Threshold of one figure."""

    unit: str
    source: str
    at_most: float | None = None
    at_least: float | None = None

    def __post_init__(self) -> None:
        one = (self.at_most is None) != (self.at_least is None)
        check([] if one else [("at_most", "and 'at_least': allowed is exactly one of both")])

    def holds(self, value: float) -> bool:
        """Whether a value meets the bar."""
        return (self.at_most is None or value <= self.at_most) and (self.at_least is None or value >= self.at_least)

    def __str__(self) -> str:
        side, value = ("at most", self.at_most) if self.at_most is not None else ("at least", self.at_least)
        return f"{side} {value:g} {self.unit}"


@dataclass(frozen=True, kw_only=True)
class CellBars:
    """Whether a cell is required, and its bars."""

    required: bool
    why: str
    """Why it is not required; empty if it is."""
    bars: Annotated[dict[str, Bar], Keys(keys=OneOf(tuple(FIGURES)))]
    """Bars by name of the figure, of `FIGURES`."""


UNKNOWN = CellBars(required=False, why="the robot's validation.yaml has no bars for it", bars={})
"""For a cell that the file does not contain."""


@dataclass(frozen=True, kw_only=True)
class Tolerance:
    """Largest difference of a figure between two engines."""

    at_most: Annotated[float, NOT_NEGATIVE]
    unit: str
    source: str
    share: Annotated[float, NOT_NEGATIVE] = 0.0
    """Share of the speed; the larger of both limits applies."""

    def of(self, speed: float) -> float:
        """The tolerance at a speed [m/s]."""
        return max(self.at_most, self.share * speed)


@dataclass(frozen=True, kw_only=True)
class Agreement:
    """Tolerances between the means over a cell's seeds in MuJoCo and in DART."""

    velocity: Tolerance
    """Forward and lateral velocity."""
    yaw_rate: Tolerance
    height: Tolerance
    """Height of the root."""


@dataclass(frozen=True, kw_only=True)
class ValidationRules:
    """`data/validation.yaml`."""

    calibrated_on: RobotSize
    """Robot of the margins and tolerances."""
    margins: dict[str, Margin]
    required: Required
    agreement: Agreement


@dataclass(frozen=True, kw_only=True)
class RobotBars:
    """`robots/<robot>/validation.yaml`."""

    reference: Reference
    cells: dict[str, CellBars]
    """Bars of `mujoco_validation`."""
    engines: dict[str, CellBars]
    """Bars of `cross_engine_validation` for each walk in MuJoCo and in DART."""
    webots: dict[str, CellBars]
    """Bars of `webots_validation` for each segment."""
    limit_cycles: dict[str, CellBars]
    """Bars of `limit_cycles` for DART against MuJoCo at each speed."""


@dataclass(frozen=True, kw_only=True)
class ValidationSettings(ValidationRules, RobotBars):
    """Rules and bars of a robot."""


SCALES = {
    "m": Scaled(length=1.0),
    "m/s": Scaled(length=0.5),
    "rad/s": Scaled(length=-0.5),
    "W": Scaled(length=0.5, mass=1.0),
}
"""How margins and tolerances in a unit depend on the robot's size; in other units they do not."""

R = TypeVar("R", bound=ValidationRules)


def scaled_to(rules: R, robot: Robot) -> R:
    """The rules with margins and tolerances for the size of `robot`; bars are left as they are."""
    size, ratios = ratios_to(rules.calibrated_on, robot)

    def factor(unit: str) -> float:
        return SCALES[unit].factor(*ratios) if unit in SCALES else 1.0

    margins = {name: replace(each, absolute=factor(each.unit) * each.absolute) for name, each in rules.margins.items()}
    kinds: dict[str, Tolerance] = vars(rules.agreement)
    tolerances = {name: replace(each, at_most=factor(each.unit) * each.at_most) for name, each in kinds.items()}
    return replace(rules, calibrated_on=size, margins=margins, agreement=Agreement(**tolerances))


def read_validation(rules: Path, bars: Path) -> ValidationSettings:
    """The rules (`data/validation.yaml`) and a robot's bars (`robots/<robot>/validation.yaml`). Raises SettingsError,
    which explains how to derive missing bars."""
    if not bars.is_file():
        do = "Derive them from a policy that walks: python -m pipeline.validation.derive POLICY.npz --robot FOLDER."
        raise SettingsError(bars, f"'{bars.parent.name}' has no thresholds for a policy. {do}")
    shared, own = settings.read(rules, ValidationRules), settings.read(bars, RobotBars)
    return ValidationSettings(**vars(shared), **vars(own))


def derived(runs: Sequence[Sequence[Measured]], margins: dict[str, Margin], required: Required) -> dict[str, CellBars]:
    """Bars of each cell from several measurements of the same cells in the same order."""
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
    """The bar of a figure, from the reference's worst value over `trials`."""
    lower = FIGURES[name].lower_is_better
    bar = round(margins[name].bar(worst, lower), 4)
    side = {"at_most": bar} if lower else {"at_least": max(bar, 0.0)}
    source = f"reference's worst {worst:.4g} of {trials}, and the margin"
    return Bar(unit=FIGURES[name].unit, source=source, **side)


Velocity = tuple[float, float, float]
"""Forward and lateral [m/s], yaw rate [rad/s]."""


def command_errors(command: Velocity, reached: Velocity) -> dict[str, float]:
    """Errors of a walk relative to its command: `speed_error` [m/s] and `yaw_rate_error` [rad/s]."""
    speed_error = math.hypot(reached[0] - command[0], reached[1] - command[1])
    return {"speed_error": speed_error, "yaw_rate_error": abs(reached[2] - command[2])}


def missed(errors: dict[str, float], command: Velocity, required: Required) -> list[str]:
    """A reason for each tracking figure whose error is too large for the command."""
    sizes = command_errors(command, (0.0, 0.0, 0.0))
    return [
        f"the reference misses the command by {error:.2f} {FIGURES[name].unit}"
        for name, error in errors.items()
        if error > max(required.error_share * sizes[name], required.least_error)
    ]


def _failures(one: Measured, required: Required) -> list[str]:
    """Reasons why the reference policy does not pass a cell."""
    names = one.cell.figures
    if "survival" in names:
        survival = one.figure("survival")
        assert survival is not None
        return [] if survival >= required.survival else [f"the reference survives {survival:.2f} of it"]
    if one.fallen:
        return [f"the reference falls in {len(one.fallen)} of {len(one.trials)}"]
    tracking = [name for name in ("speed_error", "yaw_rate_error") if name in names]
    errors = {name: error for name in tracking if (error := one.figure(name)) is not None}
    return missed(errors, one.cell.trials[0].command.last.goal, required)
