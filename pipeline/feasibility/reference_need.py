"""What a reference asks of the motors, taken at its word.

A retargeted motion was made without forces: to follow it a controller shifts the centre of pressure, and with it
what the ankles and the hips' roll joints give. So it may ask more of these than they have, the more the faster it is,
and of the other motors hardly more. What it asks is told with the root first, torque limits or not: where limits come
first, a weak motor's share goes to the root, and hides among what the reference lacks anyway.
"""

from __future__ import annotations

import numpy as np
from jaxtyping import Bool, Float

from pipeline.feasibility.motion import Motion
from pipeline.feasibility.over_limit import over_limit
from pipeline.feasibility.torque_settings import ReferenceNeed
from pipeline.feasibility.verdict import Verdict
from pipeline.robot import Robot

FORWARD = np.cos(np.pi / 4.0)
"""A joint whose axis lies within 45 degrees of the robot's forward axis rolls."""


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


def allowed_need(robot: Robot, speed: float, settings: ReferenceNeed) -> Float[np.ndarray, " j"]:
    """What each joint may need over its torque limit at a speed over ground [m/s]."""
    roll, ankle = _balancing(robot)
    motor, rolling, below = (a + b * speed for a, b in (settings.motor, settings.roll, settings.ankle))
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
