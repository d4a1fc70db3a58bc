"""Left and right limbs that changed places for a while."""

from __future__ import annotations

import numpy as np
from jaxtyping import Bool

from pipeline.clips.human_clip import BODIES, HumanClip
from pipeline.repair.defect import Defect
from pipeline.repair.tree import Orientations, Positions

PAIRS: dict[str, tuple[str, ...]] = {
    "legs": ("hip", "knee", "ankle", "toe"),
    "arms": ("shoulder", "elbow", "wrist"),
}
JUMP_SHARE = 0.3
"""The exchanged sides continue the motion if they jump by less than this share of what the named ones do."""
SMALLEST_JUMP = 0.05
"""Mean distance of a limb's joints from where they should be that an exchange has to explain [m]."""
LONGEST_S = 2.0
"""An exchange that lasts longer can't be distinguished from the person's own sides."""


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


def swap_back(clip: HumanClip, defects: list[Defect]) -> tuple[Positions, Orientations]:
    """Positions and orientations with the exchanged sides put right."""
    pos_w, quat_w = clip.body_pos_w.copy(), clip.body_quat_w.copy()
    for defect in defects:
        if defect.code == "swapped_sides":
            half = len(defect.bodies) // 2
            there = list(defect.bodies)
            back = there[half:] + there[:half]
            span = slice(defect.start, defect.stop)
            pos_w[span, there] = pos_w[span, back]
            quat_w[span, there] = quat_w[span, back]
    return pos_w, quat_w


def _exchanged(left_w: np.ndarray, right_w: np.ndarray, fps: float) -> list[tuple[int, int]]:
    """Frame ranges between two frames at which both sides jump to where the other one was."""
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


def _toggles(left_w: np.ndarray, right_w: np.ndarray) -> Bool[np.ndarray, " t"]:
    """Frames into which both sides come from each other's place, judged by their last two frames before it."""
    result = np.zeros(len(left_w), dtype=bool)
    if len(left_w) < 3:
        return result
    ahead = [2.0 * side[1:-1] - side[:-2] for side in (left_w, right_w)]

    def off(side: np.ndarray, expected: np.ndarray) -> np.ndarray:
        return np.linalg.norm(side[2:] - expected, axis=-1).mean(axis=-1)

    kept = off(left_w, ahead[0]) + off(right_w, ahead[1])
    crossed = off(left_w, ahead[1]) + off(right_w, ahead[0])
    result[2:] = (kept > 2.0 * SMALLEST_JUMP) & (crossed < JUMP_SHARE * kept)
    return result
