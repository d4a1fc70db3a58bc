"""KP5's weights with approved factors on cells of the command space.

A factor f makes the seconds of a cell be drawn f times as often against the rest. A trainer draws a clip by its weight
and then a time within it, so a cell's share of draws is P = sum_clips w s / sum_clips w, with s the part of the clip's
seconds that lie in the cell. With factors f_k on cells k the shares become

    P'_k = f_k P_k / Z,    Z = sum_k f_k P_k + (1 - sum_k P_k)

For clips that lie in one cell as a whole that is w' = f w. A clip in several cells can't raise one alone: its weight is
multiplied by what its seconds are worth on average, and these worths are raked until the shares are reached (iterative
proportional fitting). Where the clips do not allow that, or no second may weigh so much, no named cell is lowered
compared with the rest and the shares that were reached are reported.
"""

import dataclasses
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import pandas as pd

from pipeline.actuators.adapted_robot import BoxLimits, JointActuator, dc_motor_line
from pipeline.feasibility.balance import BalanceSettings
from pipeline.feasibility.command_space import CommandSettings, by_command, cell_of
from pipeline.feedback.change import Change, ChangeError

ROUNDS = 500
CLOSE = 1e-9
"""Largest relative distance of a share from its target at which raking ends."""
MOST_WORTH = 4.0
"""How much further than its factor the worth of a cell's seconds may be raked."""


@dataclass(frozen=True, kw_only=True)
class CellShare:
    """What a factor did to a cell."""

    cell: str
    factor: float
    before: float
    """Its share of draws without feedback."""
    wanted: float
    reached: float
    clips: int
    """Clips that have seconds in it; without any nothing can be raised."""


@dataclass(frozen=True, kw_only=True)
class Reweighted:
    """Weights of clips, mean 1, and what became of each cell."""

    weight: dict[str, float]
    cells: tuple[CellShare, ...]


def reweigh(
    rows: pd.DataFrame, factors: Mapping[str, float], settings: BalanceSettings, commands: CommandSettings
) -> Reweighted:
    """Weights of clips with factors on cells.

    Args:
        rows: clips with `weight` as KP5 balanced them, `seconds` and velocities or `command_seconds`
        factors: cell -> how much more often it is drawn
    """
    names = sorted(factors)
    inside = cell_parts(rows, names, commands)
    weight = rows["weight"].to_numpy(dtype=float)
    seconds = rows["seconds"].to_numpy(dtype=float)
    before = weight @ inside / weight.sum()
    factor = np.array([factors[name] for name in names])
    wanted = factor * before / (factor @ before + 1.0 - before.sum())
    raised = _raked(weight, inside, factor, wanted)
    raised = _bounded(raised, seconds, weight, settings.max_ratio)
    reached = raised @ inside / raised.sum()
    cells = tuple(
        CellShare(
            cell=name,
            factor=float(factor[k]),
            before=float(before[k]),
            wanted=float(wanted[k]),
            reached=float(reached[k]),
            clips=int((inside[:, k] > 0.0).sum()),
        )
        for k, name in enumerate(names)
    )
    raised = raised / raised.mean()
    return Reweighted(weight=dict(zip(rows["clip"], raised.tolist(), strict=True)), cells=cells)


def cell_parts(rows: pd.DataFrame, cells: list[str], commands: CommandSettings) -> np.ndarray:
    """Part of each clip's seconds in each cell (n, k)."""
    spent = by_command(rows.reset_index(drop=True))
    named = cell_of(spent, commands).to_numpy()
    parts = np.zeros((len(rows), len(cells)))
    for k, cell in enumerate(cells):
        within = named == cell
        np.add.at(parts[:, k], spent["row"].to_numpy()[within], spent["seconds"].to_numpy(dtype=float)[within])
    return parts / rows["seconds"].to_numpy(dtype=float)[:, None]


def _raked(weight: np.ndarray, inside: np.ndarray, factor: np.ndarray, wanted: np.ndarray) -> np.ndarray:
    """Weights (n,) whose cells have the shares `wanted` (k,), as far as the clips allow it.

    Where they do not, no second of a named cell is made worth less than one of the rest: a raise that can't be had must
    not be paid for by the cells that share its clips.
    """
    worth, there = factor.copy(), wanted > 0.0
    rest = 1.0 - inside.sum(axis=1)
    for _ in range(ROUNDS):
        raised = weight * (rest + inside @ worth)
        share = raised @ inside / raised.sum()
        if np.all(np.abs(share - wanted)[there] <= CLOSE * wanted[there]):
            break
        worth[there] *= wanted[there] / share[there]
        worth = np.clip(worth, factor / MOST_WORTH, factor * MOST_WORTH)
    else:
        worth = np.maximum(worth, 1.0)
    return weight * (rest + inside @ worth)


def _bounded(weight: np.ndarray, seconds: np.ndarray, before: np.ndarray, max_ratio: float) -> np.ndarray:
    """Weights none of whose seconds weighs more than `max_ratio` times the mean, where it did not before."""
    second, old = weight / seconds, before / seconds
    highest = max(max_ratio, float(old.max() * seconds.sum() / before.sum()))
    for _ in range(50):
        mean = float(second @ seconds / seconds.sum())
        if second.max() <= highest * mean * (1.0 + 1e-9):
            break
        second = np.minimum(second, highest * mean)
    return second * seconds


ROUNDED_N_M = 1e-3
"""Proposed limits are rounded to this."""


def check_limits(actuators: Sequence[JointActuator], changes: Sequence[Change], lowest: float) -> None:
    """Raises ChangeError for limits of joints that the robot lacks, or further down than its calibration allows.

    What a file says that a limit was before is nothing to go by: any hand can write it.

    Args:
        lowest: of the calibrated limit, the rule's
    """
    calibrated = {each.joint: each.box_effort_limit for each in actuators}
    faults = []
    for each in changes:
        limit = calibrated.get(each.what)
        if limit is None:
            faults.append(f"'{each.what}' is no joint of {each.robot}; there are: {', '.join(calibrated)}")
        elif each.value < lowest * limit - ROUNDED_N_M:
            least = f"{lowest:g} of the {limit:g} N m that it is calibrated to"
            faults.append(f"'{each.what}' is {each.value:g} N m; allowed is no less than {least}")
    if faults:
        raise ChangeError(
            f"data/feedback/approved.yaml, 'motors': {'; '.join(faults)}. Approve 'motors' of the current proposal "
            "again (job approve_feedback), or take it back (job take_back_feedback, or delete the entry)."
        )


def lowered(actuators: Sequence[JointActuator], changes: Sequence[Change]) -> tuple[JointActuator, ...]:
    """The actuators with approved limits where these are lower; a limit is never raised by a log."""
    limits = {change.what: change for change in changes}
    return tuple(_lowered(each, limits[each.joint]) if each.joint in limits else each for each in actuators)


def _lowered(actuator: JointActuator, change: Change) -> JointActuator:
    if change.value >= actuator.box_effort_limit:
        return dataclasses.replace(actuator, verdict=f"{actuator.verdict}; logs show no less")
    box = BoxLimits(box_effort_limit=change.value, box_velocity_limit=actuator.box_velocity_limit)
    line = dc_motor_line(box, actuator.dc_motor_no_load_speed)
    logs = ", ".join(sorted({each.log for each in change.witnesses}))
    verdict = f"{actuator.verdict}; torque lowered to what {logs} showed"
    return dataclasses.replace(actuator, box_effort_limit=change.value, verdict=verdict, **line)
