"""Frames that the index of recordings lists as clean but repair flags: motion that is impossible for a foot.

Of repair, only the flagged frames are used. Evidence is the positions as read, their second difference, and the other
foot of the same person in the same frames.
"""

from __future__ import annotations

import numpy as np

from benchmarks.repair_clips import REAL, Sound
from benchmarks.report import Bar
from pipeline.clips.human_clip import FEET, HumanClip
from pipeline.physics import GRAVITY

BEYOND = 5.0
"""Acceleration, relative to the rest of the recording, above which the marker is not on the foot."""


def called_clean_bars(sound: Sound, flagged: int, everything: tuple[int, int]) -> list[Bar]:
    """Number of flagged frames in a recording listed as clean, and the acceleration of its feet.

    `everything`: number of flagged frames and of all frames of the sound clips, which include its first frames.
    """
    clip, first = sound.clip, REAL[sound.clip.name][1]
    assert first is not None
    there = f"{clip.name} {first} to {clip.frame_count - 1}, clean by its index"
    more = clip.frame_count - first
    share = 100.0 * (everything[0] + flagged) / (everything[1] + more)
    peaks = {side: (peak_g(clip, side, 0, first), peak_g(clip, side, first, clip.frame_count)) for side in FEET}
    elsewhere = max(peaks["left"][0], peaks["right"][0], min(peaks[side][1] for side in FEET))
    side = max(FEET, key=lambda one: peaks[one][1])
    return [
        Bar(name=f"with {there}: frames flagged", value=share, unit="%"),
        Bar(name=f"there the ball of the {side} foot accelerates by up to", value=peaks[side][1], unit="g"),
        Bar(name="the other one, and both in the frames before, by up to", value=elsewhere, unit="g"),
        Bar(name="that is times as much", value=peaks[side][1] / elsewhere, sense=">=", bound=BEYOND),
    ]


def peak_g(clip: HumanClip, side: str, first: int, last: int) -> float:
    """Largest acceleration [g] of the ball of a foot between frames of [first, last)."""
    toe_pos_w = clip.pos(f"{side}_toe")[first:last]
    acceleration = np.diff(toe_pos_w, 2, axis=0) * clip.fps**2
    return float(np.linalg.norm(acceleration, axis=1).max()) / GRAVITY
