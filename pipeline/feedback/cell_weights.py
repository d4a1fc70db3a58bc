"""Approved factors on cells of the command space, applied to KP5's weights; approved limits, applied to motors.

A factor f makes the seconds of a cell f times as likely to be sampled, relative to the rest. Training samples a clip by
its weight w and then a time within it, so the sampling share of a cell is P = sum_clips w s / sum_clips w, where s is
the fraction of the clip's seconds in the cell. With factors f_k on cells k, the target shares are

    P'_k = f_k P_k / Z,    Z = sum_k f_k P_k + (1 - sum_k P_k)

For clips that are entirely in one cell, this is w' = f w. The weight of a clip in several cells is multiplied by the
mean gain of its seconds; iterative proportional fitting (raking) adjusts the gain of each cell until the shares reach
the targets. If the clips, or the limit on the weight of a second, do not allow the targets, no named cell is lowered
relative to the rest, and the reached shares are reported.
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
"""Relative tolerance of the shares at which raking stops."""
MAX_GAIN = 4.0
"""Raking keeps the gain of a cell within [factor / MAX_GAIN, factor * MAX_GAIN]."""


@dataclass(frozen=True, kw_only=True)
class CellShare:
    """Effect of a factor on a cell."""

    cell: str
    factor: float
    before: float
    """Sampling share without feedback, 0 to 1."""
    target: float
    """Sampling share by the factors."""
    reached: float
    """Sampling share with the new weights."""
    clips: int
    """Number of clips with seconds in the cell; without any, it can't be raised."""


@dataclass(frozen=True, kw_only=True)
class Reweighted:
    """New weights of the clips (mean 1) and the effect on each cell."""

    weight: dict[str, float]
    cells: tuple[CellShare, ...]


def reweigh(
    rows: pd.DataFrame, factors: Mapping[str, float], settings: BalanceSettings, commands: CommandSettings
) -> Reweighted:
    """Apply factors on command cells to the weights of clips.

    Args:
        rows: one row per clip: `weight` by KP5, `seconds`, and velocities or `command_seconds`
        factors: cell -> factor on its sampling share
        settings: settings of KP5's balancing, with the limit on the weight of a second
        commands: cells of the command space
    """
    names = sorted(factors)
    inside = cell_parts(rows, names, commands)
    weight = rows["weight"].to_numpy(dtype=float)
    seconds = rows["seconds"].to_numpy(dtype=float)
    before = weight @ inside / weight.sum()
    factor = np.array([factors[name] for name in names])
    target = factor * before / (factor @ before + 1.0 - before.sum())
    raised = _raked(weight, inside, factor, target)
    raised = _bounded(raised, seconds, weight, settings.max_ratio)
    reached = raised @ inside / raised.sum()
    cells = tuple(
        CellShare(
            cell=name,
            factor=float(factor[k]),
            before=float(before[k]),
            target=float(target[k]),
            reached=float(reached[k]),
            clips=int((inside[:, k] > 0.0).sum()),
        )
        for k, name in enumerate(names)
    )
    raised = raised / raised.mean()
    return Reweighted(weight=dict(zip(rows["clip"], raised.tolist(), strict=True)), cells=cells)


def cell_parts(rows: pd.DataFrame, cells: list[str], commands: CommandSettings) -> np.ndarray:
    """Fraction of each clip's seconds in each cell. Shape (n, k) for n clips and k cells."""
    spent = by_command(rows.reset_index(drop=True))
    named = cell_of(spent, commands).to_numpy()
    parts = np.zeros((len(rows), len(cells)))
    for k, cell in enumerate(cells):
        within = named == cell
        np.add.at(parts[:, k], spent["row"].to_numpy()[within], spent["seconds"].to_numpy(dtype=float)[within])
    return parts / rows["seconds"].to_numpy(dtype=float)[:, None]


def _raked(weight: np.ndarray, inside: np.ndarray, factor: np.ndarray, target: np.ndarray) -> np.ndarray:
    """Weights (n,) that give the cells the shares `target` (k,), as far as the clips allow it.

    If raking does not converge, the gains of all named cells are raised to at least 1: an unreachable target must not
    lower other cells that share its clips.
    """
    gain, occupied = factor.copy(), target > 0.0
    rest = 1.0 - inside.sum(axis=1)
    for _ in range(ROUNDS):
        raised = weight * (rest + inside @ gain)
        share = raised @ inside / raised.sum()
        if np.all(np.abs(share - target)[occupied] <= CLOSE * target[occupied]):
            break
        gain[occupied] *= target[occupied] / share[occupied]
        gain = np.clip(gain, factor / MAX_GAIN, factor * MAX_GAIN)
    else:
        gain = np.maximum(gain, 1.0)
    return weight * (rest + inside @ gain)


def _bounded(weight: np.ndarray, seconds: np.ndarray, before: np.ndarray, max_ratio: float) -> np.ndarray:
    """Limit the weight per second to `max_ratio` times the mean, or to the largest ratio before feedback."""
    second, old = weight / seconds, before / seconds
    highest = max(max_ratio, float(old.max() * seconds.sum() / before.sum()))
    for _ in range(50):
        mean = float(second @ seconds / seconds.sum())
        if second.max() <= highest * mean * (1.0 + 1e-9):
            break
        second = np.minimum(second, highest * mean)
    return second * seconds


ROUNDED_N_M = 1e-3
"""Resolution of proposed torque limits [N m]."""


def check_limits(actuators: Sequence[JointActuator], changes: Sequence[Change], lowest: float) -> None:
    """Raise ChangeError for limits of unknown joints, or below the allowed fraction of the calibrated limit.

    The calibrated limit is taken from `actuators`, not from `Change.before`, which a person can edit in the file.

    Args:
        actuators: calibrated actuators of the robot
        changes: approved changes of the section `motors`
        lowest: lowest allowed fraction of the calibrated limit, by the rules
    """
    calibrated = {each.joint: each.box_effort_limit for each in actuators}
    faults = []
    for each in changes:
        limit = calibrated.get(each.what)
        if limit is None:
            faults.append(f"'{each.what}' is no joint of {each.robot}; there are: {', '.join(calibrated)}")
        elif each.value < lowest * limit - ROUNDED_N_M:
            least = f"{lowest:g} of the calibrated {limit:g} N m"
            faults.append(f"'{each.what}' is {each.value:g} N m; the lowest allowed is {least}")
    if faults:
        raise ChangeError(
            f"data/feedback/approved.yaml, 'motors': {'; '.join(faults)}. Approve 'motors' of the current proposal "
            "again (job approve_feedback), or revoke it (job take_back_feedback, or delete the entry)."
        )


def with_lowered_limits(actuators: Sequence[JointActuator], changes: Sequence[Change]) -> tuple[JointActuator, ...]:
    """Apply approved torque limits that are below the calibrated ones. Feedback never raises a limit."""
    limits = {change.what: change for change in changes}
    return tuple(_lowered(each, limits[each.joint]) if each.joint in limits else each for each in actuators)


def _lowered(actuator: JointActuator, change: Change) -> JointActuator:
    if change.value >= actuator.box_effort_limit:
        return dataclasses.replace(actuator, verdict=f"{actuator.verdict}; the approved limit is not lower")
    box = BoxLimits(box_effort_limit=change.value, box_velocity_limit=actuator.box_velocity_limit)
    line = dc_motor_line(box, actuator.dc_motor_no_load_speed)
    logs = ", ".join(sorted({each.log for each in change.witnesses}))
    verdict = f"{actuator.verdict}; torque limit lowered by {logs}"
    return dataclasses.replace(actuator, box_effort_limit=change.value, verdict=verdict, **line)
