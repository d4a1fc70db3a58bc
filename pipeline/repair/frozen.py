"""Stretches in which the recording stood still: real motion is never equal to the last bit."""

from __future__ import annotations

import numpy as np
from jaxtyping import Bool, Float

from pipeline import rotation, time_series
from pipeline.clips.human_clip import BODIES, body
from pipeline.repair.defect import Defect
from pipeline.repair.missing import spans
from pipeline.repair.settings import DetectionSettings
from pipeline.repair.tree import FEET_BODIES, Orientations, Positions, to_local

MOVING_M_S = 0.1
"""A person whose pelvis is faster than this moves every large joint."""
OFTEN_STILL = 0.02
"""A joint that is still in more than this share of the frames is so by design or by its source's noise floor."""
WATCHED = tuple(body(f"{side}_{name}") for side in ("left", "right") for name in ("hip", "knee", "shoulder", "elbow"))
"""Joints whose rotation changes in every frame of a moving person."""


def find_frozen(pos_w: Positions, quat_w: Orientations, fps: float, settings: DetectionSettings) -> list[Defect]:
    """Frames equal to the one before: the whole body (`frozen`, alone `repeated_frame`) or one joint (`frozen_joint`)."""
    step = np.abs(np.diff(pos_w, axis=0)).max(axis=2)
    whole = np.concatenate([[False], (step < settings.still_step).all(axis=1)])
    whole[1:] &= (rotation.angle_between(quat_w[:-1], quat_w[1:]) < settings.still_step).all(axis=1)
    everybody = tuple(range(len(BODIES)))
    defects = [
        Defect(
            code="repeated_frame" if stop - start == 1 else "frozen",
            text=f"all joints equal to the frame before for {(stop - start) / fps:.3f} s",
            start=start,
            stop=stop,
            bodies=everybody,
        )
        for start, stop in time_series.runs(whole)
    ]
    return defects + _frozen_joints(pos_w, quat_w, whole, fps, settings)


def _frozen_joints(
    pos_w: Positions, quat_w: Orientations, whole: Bool[np.ndarray, " t"], fps: float, settings: DetectionSettings
) -> list[Defect]:
    """Joints of a moving person that keep their rotation, or their place in the world, to the last bit."""
    pelvis_m_s = np.linalg.norm(time_series.derivative(pos_w[:, 0], fps), axis=1)
    moving = time_series.moving_mean(pelvis_m_s, 2 * round(0.25 * fps) + 1) > MOVING_M_S
    turn = to_local(pos_w, quat_w)[1]
    angle = _step(rotation.angle_between(turn[:-1], turn[1:]))
    way = _step(np.abs(np.diff(pos_w, axis=0)).max(axis=2))
    still_turn, still_pos = angle < settings.still_step, way < settings.still_step
    unwatched = [index for index in range(len(BODIES)) if index not in WATCHED]
    still_turn[:, unwatched] = False
    still_pos[:, list(FEET_BODIES)] = False
    marks = [_long_runs(still, whole, moving, settings.still_frames) for still in (still_turn, still_pos)]
    return spans(
        "frozen_joint", "{names} keep their rotation to the last bit", marks[0], pos=None, rot=marks[0]
    ) + spans("frozen_joint", "{names} keep their place to the last bit", marks[1], pos=marks[1], rot=marks[1])


def _step(size: Float[np.ndarray, "s 19"]) -> Float[np.ndarray, "t 19"]:
    """Steps from the frame before; the first frame has none and counts as moving."""
    return np.concatenate([np.full((1, size.shape[1]), np.inf), size])


def _long_runs(
    still: Bool[np.ndarray, "t 19"], whole: Bool[np.ndarray, " t"], moving: Bool[np.ndarray, " t"], shortest: int
) -> Bool[np.ndarray, "t 19"]:
    """Runs of at least `shortest` still frames of a joint that otherwise moves, while the person does."""
    marked = np.zeros_like(still)
    candidates = still & (moving & ~whole)[:, None]
    for index in range(still.shape[1]):
        found = time_series.runs(candidates[:, index])
        if sum(stop - start < shortest for start, stop in found) > OFTEN_STILL * len(still):
            continue
        for start, stop in found:
            marked[start:stop, index] |= stop - start >= shortest
    return marked
