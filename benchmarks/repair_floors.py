"""Floors that are off or drift, planted and judged against the truth.

Of the generator's clips the ground is known, z = 0, whatever KP2 thinks of it: what it tells of a spoilt clip is held
against that. For its estimate not to be that of a clean clip, the whole body wanders as tracking does, and in some
clips a part of the frames is noisy or lost, too. Nobody knows the ground of a recording: a floor is planted into it as
it is, the plant alone says how much it matters, and only whether the floor is told is counted.
"""

from __future__ import annotations

import dataclasses
from pathlib import Path

import numpy as np

from benchmarks.repair_clips import Sound, sound_clips
from benchmarks.repair_judge import Verdict, outcome_of
from pipeline.clips.human_clip import HumanClip
from pipeline.clips.outcome import Outcome
from pipeline.repair import RepairSettings, process
from tests.factories.planted_defects import Planted, plant

FLOOR_M = 0.005
"""A floor's height and its drift are right within this [m]."""
FLOOR_NUMBER = {"floor_offset": "floor_m", "floor_drift": "floor_drift_m"}
"""Kind of defect of the floor -> the number of KP2 that tells it."""
GENERATED, REAL = "generated", "real"
TOLD_BEFORE = "real, told of without a plant"
"""Recordings of whose floor KP2 says so as they are: nothing can be found there, but a plant can hide it."""
WANDER_M, WANDER_S = 0.005, 0.1
"""The body wanders by this RMS in each direction [m]; width of the Gauss curve that smooths the wander [s]."""
NOISE_M = 0.005
"""RMS of noise on each joint, in each direction [m]."""
SPOILT_SHARE = (0.1, 0.6)
"""Least and largest share of a clip that is noisy or lost, in one stretch."""


def judge_floor(kind: str, number: int, seed: int, folder: Path, settings: RepairSettings) -> Verdict:
    """Plant the `number`-th floor of a kind into a clip drawn for it, run KP2, and look."""
    rng = np.random.default_rng([seed, number, *kind.encode()])
    clips = sound_clips(folder)
    index = int(rng.integers(len(clips)))
    sound = clips[index]
    planted = plant(kind, sound.clip, rng)
    if sound.real:
        before = any(one.code == kind for one in outcome_of(index, folder, settings).reasons)
        group = TOLD_BEFORE if before else REAL
    else:
        group = GENERATED
        planted = dataclasses.replace(planted, clip=tracked_badly(planted.clip, rng))
    return floor_verdict(kind, sound, group, planted, process(planted.clip, {"skill": sound.skill}, settings=settings))


def floor_verdict(kind: str, sound: Sound, group: str, planted: Planted, outcome: Outcome) -> Verdict:
    """Hold what KP2 says of a ground against what was planted; right or not where the clip's own ground is z = 0."""
    found_m = float(outcome.numbers[FLOOR_NUMBER[kind]] or 0.0)
    size_m = float(planted.size or 0.0)
    right = abs(found_m - size_m) <= FLOOR_M
    codes = ", ".join(sorted({one.code for one in outcome.reasons})) or "nothing"
    return Verdict(
        kind=kind,
        clip=sound.clip.name,
        group=group,
        strength=planted.strength,
        detected=any(one.code == kind for one in outcome.reasons),
        located=right if group == GENERATED else None,
        text=f"{sound.clip.name} {sound.clip.fps:g} Hz x {planted.strength:.2f}: planted {1000 * size_m:+.1f} mm, "
        f"got {1000 * found_m:+.1f} mm, said {codes}",
    )


def tracked_badly(clip: HumanClip, rng: np.random.Generator) -> HumanClip:
    """The clip as its whole body wanders, and for a while every joint shakes, or all are lost, or neither."""
    pos, quat = clip.body_pos_w.copy(), clip.body_quat_w.copy()
    pos += wander(clip.frame_count, clip.fps, rng)[:, None]
    length = round(rng.uniform(*SPOILT_SHARE) * clip.frame_count)
    start = int(rng.integers(clip.frame_count - length + 1))
    span, how = slice(start, start + length), int(rng.integers(3))
    if how == 0:
        pos[span] += rng.normal(scale=NOISE_M, size=pos[span].shape)
    elif how == 1:
        pos[span], quat[span] = np.nan, np.nan
    return dataclasses.replace(clip, body_pos_w=pos, body_quat_w=quat)


def wander(frames: int, fps: float, rng: np.random.Generator) -> np.ndarray:
    """A smooth random way (frames, 3) of `WANDER_M` RMS [m] that has no mean and no slope, so that truth stays true."""
    reach = round(4.0 * WANDER_S * fps)
    kernel = np.exp(-0.5 * (np.arange(-reach, reach + 1) / (WANDER_S * fps)) ** 2)
    raw = rng.normal(size=(frames + 2 * reach, 3))
    way = np.stack([np.convolve(raw[:, axis], kernel, mode="valid") for axis in range(3)], axis=1)
    basis = np.stack([np.ones(frames), np.linspace(-1.0, 1.0, frames)], axis=1)
    way -= basis @ np.linalg.lstsq(basis, way, rcond=None)[0]
    return WANDER_M * way / np.sqrt((way**2).mean(axis=0))
