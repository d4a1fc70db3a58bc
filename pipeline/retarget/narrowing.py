"""Side steps narrowed and slowed where the robot's hips can't bring the feet as far inward as the person does.

Around such moments everything lateral is scaled down: the way of the pelvis, and where knees and feet are beside it.
Feet that stand keep standing, since pelvis and feet are scaled alike. Motion forward and up stays as it is.
"""

import dataclasses

import numpy as np
from jaxtyping import Float
from scipy.ndimage import gaussian_filter1d, maximum_filter1d

from pipeline import time_series
from pipeline.clips.human_clip import FEET, HumanClip
from pipeline.clips.human_clip import body as body_index
from pipeline.retarget.settings import NarrowingSettings

LEGS = tuple(body_index(f"{side}_{joint}") for side in FEET for joint in ("knee", "ankle", "toe"))


def lateral_share(lacking: Float[np.ndarray, " t"], settings: NarrowingSettings, fps: float) -> Float[np.ndarray, " t"]:
    """Share of the lateral motion that is kept in each frame, from the way [m] that the feet lack inward.

    Smooth in time; 1 in a clip whose feet lack no more than `free`.
    """
    beyond = np.maximum(lacking - settings.free, 0.0)
    if not beyond.any():
        return np.ones(len(lacking))
    spread = settings.spread_s * fps
    nearby = gaussian_filter1d(maximum_filter1d(beyond, 2 * round(spread) + 1), spread, mode="nearest")
    return np.maximum(1.0 - nearby / settings.full, settings.least_share)


def narrowed(clip: HumanClip, lateral_w: Float[np.ndarray, "t 3"], share: Float[np.ndarray, " t"]) -> HumanClip:
    """The clip with its lateral motion scaled by `share`; `lateral_w` is the unit vector along the hips, horizontal."""
    if (share == 1.0).all():
        return clip
    pos_w = clip.body_pos_w.copy()
    centre_w = np.mean([clip.pos(f"{side}_hip") for side in FEET], axis=0)
    lost = (1.0 - share) * np.sum(time_series.derivative(centre_w, clip.fps) * lateral_w, axis=1)
    way_w = lost[:, None] * lateral_w / clip.fps
    moved_w = np.concatenate([np.zeros((1, 3)), np.cumsum((way_w[1:] + way_w[:-1]) / 2.0, axis=0)])
    legs = list(LEGS)
    beside = np.sum((pos_w[:, legs] - centre_w[:, None]) * lateral_w[:, None], axis=2)
    pos_w[:, legs] -= ((1.0 - share)[:, None] * beside)[..., None] * lateral_w[:, None]
    return dataclasses.replace(clip, body_pos_w=pos_w - moved_w[:, None])
