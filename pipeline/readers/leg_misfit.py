"""Distinguish skeleton maps that fit the same names and bones, by how the legs move.

Two maps that fit the same names and bones differ in how they turn thigh, shank and foot about their own lengths. With
the right one the knees bend about the thighs' left axes, and in the middle of the frames thighs are not twisted
against the pelvis and feet do not roll against the shanks. Measured with the right map 4 to 6 degrees, with the wrong
one 24 to 29 (CMU recordings and PFNN, which share names and bones).
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from pipeline import rotation
from pipeline.clips.human_clip import FEET
from pipeline.readers.local_axes import with_axes_of_map
from pipeline.readers.raw_motion import RawMotion
from pipeline.readers.skeleton_map import SkeletonMap

SAMPLES = 5_000
"""Frames that are looked at, at most: those in the middle of the motion."""
BENT = np.deg2rad(25.0)
"""A knee's axis is measured where it is bent by more than this [rad]."""
FEWEST = 5
"""Frames with a bent knee that are needed."""
BEST = np.deg2rad(20.0)
"""Largest misfit of the map that is taken [rad]."""
MARGIN = np.deg2rad(8.0)
"""How much smaller it has to be than any other map's [rad]."""


def distinguished(motion: RawMotion, maps: Sequence[SkeletonMap]) -> list[SkeletonMap]:
    """The one map that the legs' poses fit, or all of `maps` where the poses fit several."""
    misfits = np.array([leg_misfit(with_axes_of_map(motion, one), one) for one in maps])
    if not np.isfinite(misfits).all():
        return list(maps)
    first, second = np.argsort(misfits, kind="stable")[:2]
    clear = misfits[first] <= BEST and misfits[second] - misfits[first] >= MARGIN
    return [maps[first]] if clear else list(maps)


def leg_misfit(motion: RawMotion, skeleton: SkeletonMap) -> float:
    """Mean angle by which knee axes, thighs and feet of both legs are off what people's are [rad].

    NaN where no knee bends enough for its axis to be measured.
    """
    angles, first = [], max(0, (motion.frame_count - SAMPLES) // 2)
    for side in FEET:
        bodies = ("pelvis", *(f"{side}_{part}" for part in ("hip", "knee", "ankle")))
        joints = [skeleton.bodies[body].joint for body in bodies]
        quat = motion.world(joints, first, min(first + SAMPLES, motion.frame_count))[1]
        quat = rotation.multiply(quat, skeleton.rest_frames(motion, bodies))
        turns = rotation.to_rotvec(rotation.multiply(rotation.conjugate(quat[:, :-1]), quat[:, 1:]))
        turns = turns[np.isfinite(turns).all(axis=(1, 2))]
        bent = turns[rotation.length(turns[:, 1]) > BENT, 1]
        if len(bent) < FEWEST:
            return float("nan")
        axis = rotation.normalize(rotation.normalize(bent).mean(axis=0))
        angles += [float(np.arccos(np.clip(axis[1], -1.0, 1.0)))]
        angles += [abs(float(np.median(turns[:, 0, 2]))), abs(float(np.median(turns[:, 2, 0])))]
    return float(np.mean(angles))
