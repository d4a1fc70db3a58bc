"""Narrow and slow down side steps that need more adduction than the robot's hips have.

Around such moments all lateral motion is scaled down: the displacement of the pelvis and the offsets of knees and feet
from it. Standing feet do not slide, because pelvis and feet are scaled by the same factor. Forward and vertical motion
is unchanged.
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
    """Fraction of the lateral motion that is kept in each frame, from the adduction shortfall of the feet [m].

    Smooth in time; 1 in a clip with a shortfall of at most `settings.free`.
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
