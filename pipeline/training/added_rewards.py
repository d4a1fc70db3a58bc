"""Rows of the task reward that the paper does not have, but for those of steps and of effort: what leads to a walk."""

from __future__ import annotations

from pipeline.training import reward_terms as terms
from pipeline.training.options import Options
from pipeline.training.reward_row import FALL, LATE, Term


def product_row(options: Options) -> Term:
    """All axes of the velocity at once, in the place of a share of the three."""
    return Term(
        name="tracking_product",
        equation="exp(-|v_cmd - v|^2 / product_sigma2), all axes at once",
        weight=9.0 * options.tracking_product,
        value=lambda env: terms.joint_tracking(env.command, env.tracked_velocity, options.product_sigma2),
        added="a robot that stands is paid two of three sums, but little of the product",
    )


def following_rows(options: Options) -> tuple[Term, ...]:
    """How the command is followed over a step."""
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
    )


def posture_rows(options: Options) -> tuple[Term, ...]:
    """How it is followed: as a clip does, upright, on both feet or on one."""
    return (
        Term(
            name="track_clip",
            equation="1 / (1 + |dq|^2 / .5 + |dp|^2 / .05) from the clip that is tracked",
            weight=options.track_clip if options.tracked else 0.0,
            value=lambda env: env.tracked_clip.near,
            added="whatever is paid for long steps, the gait that is found first has quick ones, and stays",
        ),
        Term(
            name="track_joints",
            equation="mean over joints of the mean of 1 / (1 + dq^2 / w^2), w .1 and .4, from the clip that is tracked",
            weight=options.track_joints if options.tracked else 0.0,
            value=lambda env: env.tracked_clip.each_near,
            added="forearms .6 rad off hid knees that bent by half of the clips' in the sum that track_clip pays",
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
    )
