"""Stretches in which the recording stood still: real motion is never equal to the last bit."""

from __future__ import annotations

import numpy as np
from jaxtyping import Bool, Float

from pipeline import rotation, time_series
from pipeline.clips.human_clip import BODIES
from pipeline.repair.defect import Defect
from pipeline.repair.missing import spans
from pipeline.repair.settings import DetectionSettings
from pipeline.repair.tree import FEET_BODIES
from pipeline.repair.unsteadiness import Seen, slow_rate


def find_frozen(seen: Seen, fps: float, settings: DetectionSettings) -> list[Defect]:
    """Frames equal to the one before: the whole body (`frozen`; alone `repeated_frame`) or one joint."""
    if len(seen.pos_w) < 6:
        return []
    still_pos = _still_places(seen, settings)
    whole = np.asarray(still_pos.all(axis=1))
    whole[1:] &= (rotation.length(seen.world_turns) < settings.still_step).all(axis=1)
    jumped = seen.unsteadiness.place[:, 0] > settings.root_jump * slow_rate(fps)
    defects = []
    for start, stop in time_series.runs(whole):
        first = start - 1 if jumped[start - 1] else start  # what was frozen came from elsewhere
        defects.append(
            Defect(
                code="repeated_frame" if stop - start == 1 else "frozen",
                text=f"all joints equal to the frame before for {(stop - start) / fps:.3f} s",
                start=first,
                stop=stop,
                bodies=tuple(range(len(BODIES))),
            )
        )
    return defects + _frozen_joints(seen, still_pos, whole, fps, settings)


def _frozen_joints(
    seen: Seen,
    still_pos: Bool[np.ndarray, "t 19"],
    whole: Bool[np.ndarray, " t"],
    fps: float,
    settings: DetectionSettings,
) -> list[Defect]:
    """Joints that stand still to the last bit and jump out of it (`frozen_joint`) and into it (`dropout`).

    Standing still alone is nothing: knees are locked, arms held and feet planted without a jump.
    """
    still_turn = _step(rotation.length(seen.local_turns)) < settings.still_step
    still_pos = still_pos.copy()
    still_pos[:, list(FEET_BODIES)] = False
    measured, rate = seen.unsteadiness, slow_rate(fps)
    defects = []
    for still, jump, limit, pos in (
        (still_turn, measured.turn, settings.angle_jump * rate, False),
        (still_pos, measured.world, settings.position_jump * rate, True),
    ):
        marked = {code: np.zeros_like(still) for code in ("dropout", "frozen_joint")}
        for index in np.flatnonzero((still & ~whole[:, None]).any(axis=0)):
            for start, stop in time_series.runs(still[:, index]):
                if stop - start < settings.still_frames or whole[start:stop].all():
                    continue
                if still[max(start - 4, 0) : start - 1, index].any() or still[stop + 1 : stop + 4, index].any():
                    continue  # at rest before or after, too
                entered = jump[start - 1, index] > limit
                if (stop < len(still) and jump[stop, index] > limit) or (stop == len(still) and entered):
                    code = "dropout" if entered else "frozen_joint"
                    marked[code][start - entered : stop, index] = True
        text = "{names} " + ("keep their place" if pos else "keep their rotation") + " to the last bit"
        for code, mask in marked.items():
            defects += spans(code, text, mask, pos=mask if pos else None, rot=mask)
    return defects


def _still_places(seen: Seen, settings: DetectionSettings) -> Bool[np.ndarray, "t 19"]:
    """Joints that are where they were in the frame before."""
    x, y, z = np.moveaxis(np.abs(np.diff(seen.pos_w, axis=0)), -1, 0)
    return _step(np.maximum(np.maximum(x, y), z)) < settings.still_step


def _step(size: Float[np.ndarray, "s 19"]) -> Float[np.ndarray, "t 19"]:
    """Steps from the frame before; the first frame has none and counts as moving."""
    return np.concatenate([np.full((1, size.shape[1]), np.inf), size])
