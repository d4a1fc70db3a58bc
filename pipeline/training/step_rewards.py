"""Rows of the task reward that are paid as a step ends: for its length, for both feet down and for legs that swing."""

from __future__ import annotations

import torch

from pipeline.learning.training_error import TrainingError
from pipeline.training import reward_terms as terms
from pipeline.training.options import Options
from pipeline.training.reward_row import Term


def step_rows(options: Options) -> tuple[Term, ...]:
    """The rows under these options. Raises TrainingError for shares of the clips' time that are none."""
    if not 0.0 <= options.long_step_share < options.long_step_full <= terms.LONGEST_SHARE:
        raise TrainingError(
            f"options 'long_step_share' and 'long_step_full' are {options.long_step_share:g} and "
            f"{options.long_step_full:g}; they must be at least 0, the first below the second, and at most "
            f"{terms.LONGEST_SHARE:g}, beyond which no step is paid."
        )
    return (
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
    )


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
