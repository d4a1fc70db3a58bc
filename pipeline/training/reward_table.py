"""The task reward: the 19 terms of the paper's table with their weights, and what options add to it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import torch
from mjlab.managers.reward_manager import RewardTermCfg

from pipeline.training import reward_terms as terms
from pipeline.training.options import Options
from pipeline.training.pushes import recovery_left
from pipeline.training.readings import CONTACT_FORCE
from pipeline.training.training_error import TrainingError

FALL = -200.0
"""The paper's weight of a fall."""
ENDS = ("termination", "stalled")
"""Rows that an episode ends with: at their full weight from the start."""
PENALTY, COST, LATE = "penalty", "cost", "late"
"""Ramps: penalties grow in over the first iterations, what effort costs further on; rewards for the last few per cent
come when it walks."""


@dataclass(frozen=True, kw_only=True)
class Term:
    """One row of the table."""

    name: str
    equation: str
    weight: float
    value: Callable
    """Of the environment, (n,)."""
    added: str = ""
    """Why it is there, where the paper does not have it; its off-switch is the option of that name set to 0."""
    ramp: str = ""
    spared: bool = False
    """Whether it costs nothing while a push is caught (`recovery_s`)."""


def table(options: Options) -> tuple[Term, ...]:
    """The rows under these options; those of weight 0 are left out. Raises TrainingError for a share that is none."""
    if not 0.0 <= options.long_step_share < options.long_step_full <= terms.LONGEST_SHARE:
        raise TrainingError(
            f"options 'long_step_share' and 'long_step_full' are {options.long_step_share:g} and "
            f"{options.long_step_full:g}; they must be at least 0, the first below the second, and at most "
            f"{terms.LONGEST_SHARE:g}, beyond which no step is paid."
        )
    rows = (*_tracking(options), *_motion(options), *_feet(options), *_added(options))
    return tuple(row for row in rows if row.weight != 0.0)


def reward_cfg() -> dict[str, RewardTermCfg]:
    """The table as one term of mjlab's reward manager, which would launch ten kernels more for each row."""
    return {"task": RewardTermCfg(func=TaskReward, weight=1.0)}


class TaskReward:
    """The weighted sum of the table's rows."""

    def __init__(self, cfg: RewardTermCfg, env):
        self.rows = table(env.context.options)
        self._weights = {
            ramp: torch.tensor([row.weight if _ramp(row) == ramp else 0.0 for row in self.rows], device=env.device)
            for ramp in ("", PENALTY, COST, LATE)
        }
        self._recovery_s = env.context.options.recovery_s
        self._spared = torch.tensor([row.spared for row in self.rows], device=env.device)

    def values(self, env) -> torch.Tensor:
        """Every row's value, not weighted (n, rows)."""
        return torch.stack([row.value(env) for row in self.rows], dim=1)

    def weights(self, env) -> torch.Tensor:
        """Every row's weight at this iteration (rows,)."""
        penalties = self._weights[PENALTY] + env.ramps.cost * self._weights[COST]
        grown = self._weights[""] + env.ramps.penalty * penalties
        return grown + env.ramps.late * self._weights[LATE]

    def __call__(self, env) -> torch.Tensor:
        self.paid = torch.nan_to_num(self.values(env)) * self.weights(env)
        """What every row paid at the last step (n, rows)."""
        if self._recovery_s:
            recovers = recovery_left(env, self._recovery_s)[:, None] > 0.0
            self.paid = torch.where(recovers & self._spared, 0.0, self.paid)
        return self.paid.sum(dim=1)


def _ramp(row: Term) -> str:
    return row.ramp or (PENALTY if row.weight < 0.0 and row.name not in ENDS else "")


def _tracking(options: Options) -> tuple[Term, ...]:
    def kernel(axis: int) -> Callable:
        return lambda env: env.readings.tracking[:, axis]

    names = ("tracking_x", "tracking_y", "tracking_yaw")
    symbols = ("v_x", "v_y", "w_z")
    each = tuple(
        Term(
            name=name,
            equation=f"exp(-({symbol}_cmd - {symbol})^2 / sigma^2)",
            weight=3.0 * (1.0 - options.tracking_product),
            value=kernel(axis),
        )
        for axis, (name, symbol) in enumerate(zip(names, symbols, strict=True))
    )
    product = Term(
        name="tracking_product",
        equation="exp(-|v_cmd - v|^2 / product_sigma2), all axes at once",
        weight=9.0 * options.tracking_product,
        value=lambda env: terms.joint_tracking(env.command, env.tracked_velocity, options.product_sigma2),
        added="a robot that stands is paid two of three sums, but little of the product",
    )
    return (*each, product)


def _motion(options: Options) -> tuple[Term, ...]:
    limit = terms.limit_indicator if options.joint_limit == "indicator" else terms.limit_excess
    return (
        Term(
            name="lin_vel_z",
            equation="v_z^2",
            weight=-1.0,
            value=lambda env: terms.square(env.readings.lin_vel_b[:, 2]),
        ),
        Term(
            name="ang_vel_xy",
            equation="|w_xy|^2",
            weight=-0.05 * options.ang_vel_factor,
            value=lambda env: terms.square(env.readings.ang_vel_b[:, :2]),
        ),
        Term(
            name="energy",
            equation="|tau * dq|",
            weight=-1e-3 * options.energy_factor,
            value=lambda env: terms.energy(env.readings.torque, env.readings.joint_vel),
        ),
        Term(name="torque", equation="|tau|^2", weight=-1e-4, value=lambda env: terms.square(env.readings.torque)),
        Term(name="joint_vel", equation="|dq|^2", weight=-1e-3, value=lambda env: terms.square(env.readings.joint_vel)),
        Term(
            name="joint_acc", equation="|ddq|^2", weight=-2.5e-7, value=lambda env: terms.square(env.readings.joint_acc)
        ),
        Term(
            name="action_rate",
            equation="|a_t - a_(t-1)|^2",
            weight=-0.1 * options.action_rate_factor,
            value=lambda env: terms.square(env.action_manager.action - env.action_manager.prev_action),
        ),
        Term(
            name="orientation",
            equation="|g_xy|^2",
            weight=-2.0,
            value=lambda env: terms.square(env.readings.gravity_b[:, :2]),
        ),
        Term(
            name="joint_limit",
            equation="1[q > q_max] + 1[q < q_min]",
            weight=-20.0,
            value=lambda env: limit(env.readings.joint_pos, *env.joint_limits),
        ),
        Term(
            name="termination",
            equation="1[terminated]",
            weight=FALL * options.fall_factor,
            value=lambda env: env.fell.float(),
        ),
    )


def _feet(options: Options) -> tuple[Term, ...]:
    return (
        Term(
            name="undesired_contacts",
            equation="sum 1[|f_i| > 1]",
            weight=-1.0,
            value=lambda env: terms.undesired_contacts(env.readings.other_force_w, CONTACT_FORCE),
        ),
        Term(
            name="feet_slide",
            equation="sum 1[c_i] |v_i,xy|",
            weight=-0.25 * options.slide_factor,
            value=_slide(options),
            spared=options.recovery_of == "steps",
        ),
        Term(
            name="feet_force",
            equation="clip(|f_z| - 500, 0, 400)",
            weight=-3e-3,
            value=lambda env: terms.feet_force(env.readings.feet_force_w),
        ),
        Term(
            name="feet_too_near",
            equation="max(0, .2 - |p_lf - p_rf|)",
            weight=-2.0,
            value=lambda env: terms.feet_too_near(env.readings.feet_pos_w),
        ),
        Term(
            name="feet_stumble",
            equation="1[|f_xy| > 5 |f_z|]",
            weight=-2.0,
            value=lambda env: terms.feet_stumble(env.readings.feet_force_w),
        ),
        Term(
            name="feet_lateral_distance",
            equation="1[|v_y_cmd| < .1] ||p_lf,y - p_rf,y| - .2|",
            weight=-2.0 * options.feet_apart_factor,
            value=lambda env: terms.feet_lateral_distance(env.command, _lateral_gap(env)),
        ),
    )


def _slide(options: Options) -> Callable:
    if options.slide_of == "centre":
        return lambda env: terms.feet_slide(env.readings.contacts, env.readings.feet_vel_w)
    return lambda env: terms.feet_slide(env.readings.contacts, env.readings.lowest_corner_vel_w)


def _added(options: Options) -> tuple[Term, ...]:
    return (
        Term(
            name="progress",
            equation="mean over what is asked for of clip(mean v . v_cmd / |v_cmd|^2, -1, 1)",
            weight=options.progress,
            value=lambda env: terms.progress(env.command, env.readings.mean_velocity),
            added="bells are flat far from the command: from rest nothing led to 2 m/s, and nothing to .3",
        ),
        Term(
            name="stalled",
            equation="1[stalled]",
            weight=FALL * options.fall_factor * options.stall_penalty,
            value=lambda env: env.stalled.float(),
            added="standing till the stall ends it was paid more than trying to walk and falling",
        ),
        Term(
            name="mean_tracking",
            equation="exp(-|v_cmd - mean v|^2 / mean_sigma2)",
            weight=options.mean_tracking,
            value=lambda env: terms.joint_tracking(env.command, env.readings.mean_velocity, options.mean_sigma2),
            added="the wide kernel pays .99 for an error of .05; this one, on the average over a step, does not",
            ramp=LATE,
        ),
        Term(
            name="track_clip",
            equation="1 / (1 + |dq|^2 / .5 + |dp|^2 / .05) from the clip that is tracked",
            weight=options.track_clip if options.tracked else 0.0,
            value=lambda env: env.tracked_clip.near,
            added="whatever is paid for long steps, the gait that is found first has quick ones, and stays",
        ),
        Term(
            name="lean",
            equation="|g_xy - clips' g_xy|^2, theirs the mean at that command",
            weight=-options.lean,
            value=lambda env: terms.square(env.readings.gravity_b[:, :2] - env.trunk_lean(env.command)),
            added="orientation takes .06 a second for 10 degrees, and nothing else sees the body lean as a whole",
        ),
        Term(
            name="standing_still",
            equation="1[c = 0] (feet in the air, the right one counted 1 + right_more times, + .05 |dq|)",
            weight=-options.standing_still,
            value=lambda env: terms.standing_still(
                env.command, env.readings.contacts, env.readings.joint_vel, options.right_more
            ),
            added="tracking alone pays stepping on the spot as well as standing",
            spared=options.recovery_of == "steps",
        ),
        Term(
            name="single_stance",
            equation="1[c != 0, one foot] min(time on it, .4)",
            weight=options.single_stance,
            value=lambda env: terms.single_stance(
                env.command, env.readings.contacts, env.readings.stance_time, options.single_stance_end_s
            ),
            added="half the stride at twice the cadence was the fault of earlier runs",
        ),
        Term(
            name="long_step",
            equation="1[c != 0] at the end of a step: T clip((T / T_clips - s) / (f - s), 0, 1) / dt, T at most "
            "1.5 T_clips, times exp(-|v_cmd - mean v|^2 / long_step_sigma2) unless that is 0",
            weight=options.long_step,
            value=lambda env: _long_step(env, options),
            added="steps of a third of the clips' time are paid as well as theirs",
        ),
        Term(
            name="double_stance",
            equation="what long_step pays by its weight, times the share of the step on both feet by .6 of the clips', "
            "at most 1",
            weight=options.double_stance,
            value=lambda env: _double_stance(env, options),
            added="long steps on one foot throughout are not caught when pushed to a side",
        ),
        Term(
            name="full_swing",
            equation="1[c != 0] at the end of a step: T / dt, at most 1.5 T_clips / dt, times long_step's kernel "
            "and the mean over hip and knee of clip((r / r_clips - .4) / .5, 0, 1), r how far each moved in the stride",
            weight=options.full_swing,
            value=lambda env: _full_swing(env, options),
            added="steps of the clips' time were taken with knees that bend by three fifths of theirs",
        ),
        Term(
            name="power",
            equation="sum |tau dq|",
            weight=-options.power,
            value=lambda env: terms.power(env.readings.torque, env.readings.joint_vel),
            added="power is a bar of the evaluation, in sum; the norm over joints hardly sees small ones",
            ramp=COST,
            spared=True,
        ),
        Term(
            name="power_share",
            equation=_power_share_equation(options),
            weight=-options.power_share,
            value=_power_share(options),
            added="by the watt a run of 2 m/s is hardly worth being alive, and steps to the side cost little",
            ramp=COST,
            spared=True,
        ),
        Term(
            name="saturation",
            equation="sum max(0, |tau| / limit - .85)",
            weight=-options.saturation,
            value=lambda env: terms.saturation(env.readings.torque, env.motor_limit(options.saturation_of)),
            added="leaves the motors a reserve",
            ramp=COST,
            spared=True,
        ),
    )


def _power_share_equation(options: Options) -> str:
    beyond = f" - {options.power_free:g} of what is usual" if options.power_free else ""
    share = f"(sum |tau dq|{beyond}) / (what is usual at the command + {terms.NOISE_W:g} W)"
    return f"max(0, mean {share})" if options.power_free else share


def _power_share(options: Options) -> Callable:
    if options.power_free:
        return lambda env: env.power_excess.share
    return lambda env: terms.power_share(env.readings.torque, env.readings.joint_vel, env.command)


def _long_step(env, options: Options) -> torch.Tensor:
    step_s, wanted_s = env.readings.step_s, env.step_times(env.command)
    share = options.long_step_share, options.long_step_full
    return _as_followed(env, terms.long_step(env.command, step_s, wanted_s, *share), options)


def _double_stance(env, options: Options) -> torch.Tensor:
    read = env.readings
    share = terms.double_stance(read.double_s, read.step_s, env.clip_double_stance(env.command))
    return _long_step(env, options) * share


def _full_swing(env, options: Options) -> torch.Tensor:
    took_s = terms.step_time(env.command, env.readings.step_s, env.step_times(env.command))
    share = terms.full_swing(env.leg_swings.moved, env.clip_swings(env.command))
    return _as_followed(env, took_s * share, options)


def _as_followed(env, time_s: torch.Tensor, options: Options) -> torch.Tensor:
    """What is paid for the time [s] of a step, as far as the averaged velocity is the command's where that counts."""
    paid = time_s / env.step_dt
    if options.long_step_sigma2:
        paid = paid * terms.joint_tracking(env.command, env.readings.mean_velocity, options.long_step_sigma2)
    return paid


def _lateral_gap(env) -> torch.Tensor:
    gap_w, heading = env.readings.feet_pos_w[:, 0] - env.readings.feet_pos_w[:, 1], env.readings.heading_w
    return gap_w[:, 1] * heading[:, 0] - gap_w[:, 0] * heading[:, 1]
