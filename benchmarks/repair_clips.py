"""Sound clips for the repair benchmark: generated ones at three rates and, if available, real ones."""

from __future__ import annotations

import dataclasses
import functools
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from pipeline import time_series
from pipeline.clips.human_clip import HumanClip
from pipeline.generator import RECIPES, generate
from pipeline.readers import read_motion

SECONDS = 8.0
"""Longest used segment of a real recording [s]."""
RUN_M_S = 1.9
"""Mean speed from which a clip is smoothed as a run [m/s]."""
OTHER_RATES = {30.0: ("walk", "walk_slow", "run_easy", "turn_left"), 120.0: ("walk", "side_left", "run_fast", "stand")}
"""Recipes that are also generated at rates other than 60 Hz."""
REAL: dict[str, tuple[int, int | None]] = {
    "bandai_namco/dataset-1_call_normal_001.bvh": (0, None),
    "bandai_namco/dataset-1_run_tired_001.bvh": (0, None),
    "bandai_namco/dataset-1_walk-back_old_001.bvh": (0, None),
    "bandai_namco/dataset-1_walk-left_tired_001.bvh": (0, None),
    "bandai_namco/dataset-1_walk_normal_001.bvh": (0, None),
    "cmu_bvh/cmu_12_01_walk.bvh": (1, None),
    "misc_bvh/wspr_walk.bvh": (1, None),
    "deepmimic/humanoid3d_long_walk2.txt": (0, None),
    "pfnn/LocomotionFlat04_000.bvh": (0, 1630),
    "lafan1_30fps_orig/walk1_subject1_stop.bvh": (0, None),
    "lafan1_60fps/fight1_subject3_backward.bvh": (0, None),
    "lafan1_60fps/multipleActions1_subject1_jog3.bvh": (0, None),
    "lafan1_60fps/obstacles2_subject1_turn2.bvh": (0, None),
    "lafan1_60fps/obstacles6_subject1_sidesteps.bvh": (0, None),
    "lafan1_60fps/pushAndFall1_subject1_stumble.bvh": (0, None),
    "lafan1_60fps/pushAndStumble1_subject2_sidesteps.bvh": (0, None),
    "lafan1_60fps/pushAndStumble1_subject2_stumble.bvh": (0, None),
    "lafan1_60fps/pushAndStumble1_subject3_backward.bvh": (0, None),
    "lafan1_60fps/walk1_subject1_walk2.bvh": (0, None),
    "lafan1_60fps/walk2_subject1_walk.bvh": (0, None),
    "lafan1_60fps/walk2_subject3_walk.bvh": (0, None),
    "lafan1_60fps/walk3_subject1_walk2.bvh": (0, None),
}
"""Real recordings and the frames of each that are sound."""
CALLED_CLEAN: dict[str, tuple[int, int]] = {"pfnn/LocomotionFlat04_000.bvh": (0, 2332)}
"""Frames that their index calls clean ("Frames 0-2331 are clean") and we do not: from 1634 on the right foot jumps, in
the file itself by up to 38 degrees from one row to the next, while the left one does not (`repair_called_clean`)."""


@dataclass(frozen=True, kw_only=True)
class Sound:
    """A clip without a defect."""

    clip: HumanClip
    skeleton: str
    real: bool
    speed_m_s: float
    """Mean speed of the pelvis over the ground."""

    @property
    def skill(self) -> str:
        return "run" if self.speed_m_s > RUN_M_S else "walk"

    @property
    def walks(self) -> bool:
        return self.speed_m_s > 0.5


def generated() -> list[Sound]:
    """The shipped motions, some also at other rates."""
    clips = [generate(recipe).clip for recipe in RECIPES.values()]
    for fps, names in OTHER_RATES.items():
        for name in names:
            recipe = dataclasses.replace(RECIPES[name], name=f"{name}_{fps:.0f}", fps=fps)
            clips.append(generate(recipe).clip)
    return [_sound(clip, "booster_lab", real=False) for clip in clips]


def recorded(folder: Path, parts: dict[str, tuple[int, int | None]] = REAL) -> list[Sound]:
    """Whole parts of real recordings, by default the sound ones; none if the folder does not exist."""
    result = []
    for file, (first, last) in parts.items():
        if (folder / file).is_file():
            read = read_motion(folder / file, file)
            assert isinstance(read.clip, HumanClip)
            last = read.clip.frame_count if last is None else last
            result.append(_sound(read.clip.cut(first, last, file), read.skeleton, real=True))
    return result


@functools.cache
def sound_clips(folder: Path) -> tuple[Sound, ...]:
    """All clips for planted defects; of a long recording, its middle."""
    real = []
    for sound in recorded(folder):
        clip, most = sound.clip, round(SECONDS * sound.clip.fps)
        first = max((clip.frame_count - most) // 2, 0)
        real.append(_sound(clip.cut(first, min(first + most, clip.frame_count), clip.name), sound.skeleton, real=True))
    return (*generated(), *real)


def _sound(clip: HumanClip, skeleton: str, *, real: bool) -> Sound:
    velocity = time_series.derivative(clip.pos("pelvis")[:, :2], clip.fps)
    speed = float(np.linalg.norm(velocity, axis=1).mean())
    return Sound(clip=clip, skeleton=skeleton, real=real, speed_m_s=speed)
