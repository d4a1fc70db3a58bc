"""Detect bones of wrong length, and left and right limbs that are exchanged for a while."""

import numpy as np
from jaxtyping import Bool

from pipeline.clips.human_clip import BODIES, PARENT
from pipeline.repair.defect import Defect, spans
from pipeline.repair.settings import DetectionSettings
from pipeline.repair.tree import CHILDREN, LIMB_ENDS, BodyMask, FrameMask, Positions, bone_lengths

SMALLEST_CHANGE = 0.01
"""Length change that is always allowed [m]; 5 % of a foot would be less than marker noise."""


def find_broken_bones(pos_w: Positions, lost: BodyMask, settings: DetectionSettings) -> list[Defect]:
    """Frames in which a bone's length deviates from the clip's median (`bone_length`), with the joint that causes it.

    The median is over frames without `lost` samples.
    """
    lengths = bone_lengths(pos_w)
    valid = ~lost.any(axis=1)
    median = np.median(lengths[valid] if valid.any() else lengths, axis=0)
    share = np.full(len(PARENT), settings.loose_bone_change)
    share[list(LIMB_ENDS)] = settings.bone_change
    broken = np.abs(lengths - median) > np.maximum(share * median, SMALLEST_CHANGE)
    broken[:, 0] = False
    blamed = np.zeros_like(broken)
    frames = np.flatnonzero(broken.any(axis=1))
    patterns, which = np.unique(broken[frames], axis=0, return_inverse=True) if len(frames) else (broken[:0], frames)
    for number, pattern in enumerate(patterns):
        blamed[frames[which.reshape(-1) == number, None], _to_blame(pattern)] = True
    limit = f"{{names}} off: a bone's length differs by more than {settings.bone_change:.0%} from the clip's median"
    return spans("bone_length", limit, blamed, pos=blamed, rot=blamed)


def _to_blame(pattern: Bool[np.ndarray, " 19"]) -> list[int]:
    """The fewest joints that touch all broken bones; in a tie the one with all bones broken, then the lower one."""
    broken = {index for index in range(len(pattern)) if pattern[index]}
    chosen = []
    while broken:
        touched = {index: broken & {index, *CHILDREN[index]} for index in range(len(PARENT))}
        degree = {index: len(CHILDREN[index]) + (PARENT[index] >= 0) for index in range(len(PARENT))}
        best = max(touched, key=lambda index: (len(touched[index]), len(touched[index]) / degree[index], index))
        chosen.append(best)
        broken -= touched[best]
    return chosen


PAIRS: dict[str, tuple[str, ...]] = {
    "legs": ("hip", "knee", "ankle", "toe"),
    "arms": ("shoulder", "elbow", "wrist"),
}
JUMP_SHARE = 0.3
"""Jump of the exchanged sides, as a share of the jump with the given names, below which sides are exchanged."""
SMALLEST_JUMP = 0.05
"""Least mean jump of a limb's joints that an exchange must explain [m]."""
LONGEST_S = 2.0
"""Longest exchange [s]; a longer one cannot be distinguished from the person's own sides."""


def find_swapped(pos_w: Positions, fps: float) -> list[Defect]:
    """Frames in which a limb's joints continue the other side's motion (`swapped_sides`)."""
    defects = []
    for limb, parts in PAIRS.items():
        left, right = ([BODIES.index(f"{side}_{part}") for part in parts] for side in ("left", "right"))
        for start, stop in _exchanged(pos_w[:, left], pos_w[:, right], fps):
            defects.append(
                Defect(
                    code="swapped_sides",
                    text=f"left and right {limb} are exchanged",
                    start=start,
                    stop=stop,
                    bodies=tuple(left + right),
                    pos=False,
                    rot=False,
                )
            )
    return defects


def swap_back(values: np.ndarray, defects: list[Defect]) -> np.ndarray:
    """Swap the sides back in values (t, 19, ...) of the bodies, such as positions or a mask of lost samples."""
    result = values.copy()
    for defect in defects:
        if defect.code == "swapped_sides":
            half = len(defect.bodies) // 2
            there = list(defect.bodies)
            back = there[half:] + there[:half]
            result[defect.start : defect.stop, there] = values[defect.start : defect.stop, back]
    return result


def _exchanged(left_w: np.ndarray, right_w: np.ndarray, fps: float) -> list[tuple[int, int]]:
    """Frame ranges between two frames at which both sides jump to each other's position."""
    toggles = np.flatnonzero(_toggles(left_w, right_w))
    ranges = []
    index = 0
    while index + 1 < len(toggles):
        start, stop = int(toggles[index]), int(toggles[index + 1])
        if stop - start <= LONGEST_S * fps:
            ranges.append((start, stop))
            index += 2
        else:
            index += 1
    return ranges


def _toggles(left_w: np.ndarray, right_w: np.ndarray) -> FrameMask:
    """Frames at which each side continues the other's motion, by extrapolation of the two previous frames."""
    result = np.zeros(len(left_w), dtype=bool)
    if len(left_w) < 3:
        return result
    predicted = [2.0 * side[1:-1] - side[:-2] for side in (left_w, right_w)]

    def off(side: np.ndarray, expected: np.ndarray) -> np.ndarray:
        return np.linalg.norm(side[2:] - expected, axis=-1).mean(axis=-1)

    kept = off(left_w, predicted[0]) + off(right_w, predicted[1])
    crossed = off(left_w, predicted[1]) + off(right_w, predicted[0])
    result[2:] = (kept > 2.0 * SMALLEST_JUMP) & (crossed < JUMP_SHARE * kept)
    return result
