"""What a reference asks of the motors, taken at its word.

A retargeted motion was made without forces: to follow it a controller shifts the centre of pressure, and with it
what the ankles and the hips' roll joints give. So it may ask more of these than they have, the more the faster it is,
and of the other motors hardly more. What it asks is told with the root first, torque limits or not: where limits come
first, a weak motor's share goes to the root, and hides among what the reference lacks anyway.

A peak of a moment is one thing, a need that lasts another: what a quarter of a second lacks takes the robot elsewhere.
So it is also told what each motor is asked for on average where all others keep to their limits. Then one that has to
stand in for another shows too: a hip for an ankle that is at its limit.
"""

from __future__ import annotations

import numpy as np
from jaxtyping import Bool, Float

from pipeline import time_series
from pipeline.feasibility.motion import Motion
from pipeline.feasibility.over_limit import over_limit
from pipeline.feasibility.torque_settings import Allowance, LastingNeed, ReferenceNeed
from pipeline.feasibility.verdict import Verdict
from pipeline.feasibility.windowed_mean import odd_width, windowed_mean
from pipeline.robot import Robot

FORWARD = np.cos(np.pi / 4.0)
"""A joint whose axis lies within 45 degrees of the robot's forward axis rolls."""

LEAST_ALLOWED = 1e-6
"""Of the torque limit: where settings allow nothing, any need is too much."""


def need_over_allowed(motion: Motion, ratio: Float[np.ndarray, "t j"], settings: ReferenceNeed) -> Verdict:
    """The longest time in a row that a motor needs more than is allowed; `ratio` is the need over its torque limit."""
    allowed = allowed_need(motion.robot, motion.ground_speed, settings)
    found = over_limit(ratio > allowed, motion)
    start = round(found.start_s * motion.clip.fps)
    stretch = ratio[start : max(start + round(found.longest_s * motion.clip.fps), start + 1), found.joint]
    return Verdict(
        code="reference_need_run_s",
        value=found.longest_s,
        limit=settings.run_s,
        unit="s",
        text=f"from {found.start_s:.2f} s on the motion, which no contact forces explain, asks "
        f"{motion.robot.joint_names[found.joint]} for {stretch.max():.2f} times its torque limit, more than the "
        f"{allowed[found.joint]:.2f} times that a controller makes up for, for {found.longest_s:.2f} s in a row",
        bad=found.frames_of_runs_over(settings.run_s),
    )


def lasting_need_over_allowed(motion: Motion, ratio: Float[np.ndarray, "t j"], settings: LastingNeed) -> Verdict:
    """The most that a motor needs over what is allowed; `ratio` is the need over its torque limit as a mean over
    `settings.mean_s`, where all others keep to their limits.

    What is allowed follows the speed at that time: the step that stops a walk asks for as much as the walk.
    """
    fps = motion.clip.fps
    velocity = time_series.derivative(motion.clip.root_pos_w[:, :2], fps)
    speed = np.linalg.norm(windowed_mean(velocity, odd_width(settings.speed_s, fps)), axis=1)
    allowed = allowed_need(motion.robot, speed, settings)
    share = ratio / np.maximum(allowed, LEAST_ALLOWED)
    frame, joint = np.unravel_index(np.argmax(share), share.shape)
    return Verdict(
        code="reference_lasting_need",
        value=float(share[frame, joint]),
        limit=settings.most,
        unit="of what is allowed",
        text=f"around {frame / fps:.2f} s the motion, which no contact forces explain, asks "
        f"{motion.robot.joint_names[joint]} for {ratio[frame, joint]:.2f} times its torque limit as a mean over "
        f"{settings.mean_s:g} s where the other motors keep to theirs, {share[frame, joint]:.2f} of the "
        f"{allowed[frame, joint]:.2f} times that a controller makes up for",
        bad=np.any(share > settings.most, axis=1),
    )


def allowed_need(
    robot: Robot, speed: float | Float[np.ndarray, " t"], settings: Allowance
) -> Float[np.ndarray, "*t j"]:
    """What each joint may need over its torque limit at a speed over ground [m/s], or at each of several."""
    roll, ankle = _balancing(robot)
    by_speed = np.asarray(speed)[..., None]
    motor, rolling, below = (a + b * by_speed for a, b in (settings.motor, settings.roll, settings.ankle))
    return np.where(roll, rolling, np.where(ankle, below, motor))


def _balancing(robot: Robot) -> tuple[Bool[np.ndarray, " j"], Bool[np.ndarray, " j"]]:
    """Joints of the legs that roll, and those below the shank that do not."""
    tree = robot.tree
    leg, below = np.zeros((2, len(robot.joint_names)), dtype=bool)
    for side, foot in zip(("left", "right"), robot.feet, strict=True):
        link, shank = int(tree.site_link[robot.site(foot)]), robot.link(robot.human[f"{side}_shank"])
        under = True
        while link > 0:
            under &= link != shank
            leg[tree.joint[link]], below[tree.joint[link]] = True, under
            link = int(tree.parent[link])
    rolls = leg & (np.abs(tree.joint_axes_root()[:, 0]) > FORWARD)
    return rolls, below & ~rolls
