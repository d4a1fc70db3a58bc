"""The 19 rows of the task reward that the paper has, with its weights by the factors that options put on them."""

from __future__ import annotations

from collections.abc import Callable

import torch

from pipeline.training import reward_terms as terms
from pipeline.training.options import Options
from pipeline.training.readings import CONTACT_FORCE
from pipeline.training.reward_row import FALL, Term


def tracking_rows(options: Options) -> tuple[Term, ...]:
    """How near each axis of the velocity is to the command."""

    def kernel(axis: int) -> Callable:
        return lambda env: env.readings.tracking[:, axis]

    names = ("tracking_x", "tracking_y", "tracking_yaw")
    symbols = ("v_x", "v_y", "w_z")
    return tuple(
        Term(
            name=name,
            equation=f"exp(-({symbol}_cmd - {symbol})^2 / sigma^2)",
            weight=3.0 * (1.0 - options.tracking_product),
            value=kernel(axis),
        )
        for axis, (name, symbol) in enumerate(zip(names, symbols, strict=True))
    )


def body_rows(options: Options) -> tuple[Term, ...]:
    """What the trunk and the joints do, and falls."""
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


def feet_rows(options: Options) -> tuple[Term, ...]:
    """What the feet do, and whatever else touches."""
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


def _lateral_gap(env) -> torch.Tensor:
    gap_w, heading = env.readings.feet_pos_w[:, 0] - env.readings.feet_pos_w[:, 1], env.readings.heading_w
    return gap_w[:, 1] * heading[:, 0] - gap_w[:, 0] * heading[:, 1]
