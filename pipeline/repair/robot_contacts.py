"""Which foot of a robot is on the ground, from the motion alone: rigid soles that touch the ground or don't.

A sole touches within a few millimetres of where soles stand in the clip; how few follows from how much the
height of standing soles varies there. So neither the height of the floor nor noise has to be known.
"""

from __future__ import annotations

import numpy as np
from jaxtyping import Bool

from pipeline import time_series
from pipeline.clips.robot_clip import RobotClip
from pipeline.quality.sole import sole_motion
from pipeline.repair.floor import densest
from pipeline.robot import Robot

BAND = 0.01
"""Width of the band of heights in which soles stand [m]."""
SPREADS, LEAST, MOST = 2.0, 0.0015, 0.01
"""A sole touches below this many times the spread of standing soles' heights over their median, within these [m]."""
FASTEST = 1.5
"""A corner faster than this over the ground does not stand [m/s]."""
SHORTEST_S = 0.04
"""Contacts and gaps shorter than this are not believed."""


def label_robot_contacts(clip: RobotClip, robot: Robot) -> Bool[np.ndarray, "t 2"]:
    """Foot on the ground (left, right)."""
    sole = sole_motion(clip, robot)
    low = sole.height
    standing = low[np.abs(low - densest(low.ravel(), BAND)) <= BAND / 2.0]
    ground = float(np.median(standing))
    spread = 1.4826 * float(np.median(np.abs(standing - ground)))
    limit = ground + float(np.clip(SPREADS * spread, LEAST, MOST))
    touching = (low < limit) & (sole.lowest_corner_speed < FASTEST)
    shortest = round(SHORTEST_S * clip.fps)
    for side in range(2):
        for wanted in (False, True):
            for start, stop in time_series.runs(touching[:, side] == wanted):
                if stop - start < shortest and start > 0 and stop < len(touching):
                    touching[start:stop, side] = not wanted
    return touching
