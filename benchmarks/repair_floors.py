"""Floors that are off or drift, planted and judged against the truth.

Of the generator's clips the ground is known, z = 0, whatever KP2 thinks of it: what it tells of a spoilt clip is held
against that. For its estimate not to be that of a clean clip, the whole body wanders as tracking does, and in some
clips a part of the frames is noisy or lost, too.

Nobody knows the ground of a recording: a clean one is put on z = 0 by what KP2 tells of it, so that what is planted is
all that is wrong. That says whether a defect is told, and told right, not whether KP2 finds the ground; how far another
way of finding it agrees is told beside (`ground_bars`). Without a bound are recordings that wander, too, and recordings
as they are, whose own ground may hide a plant.
"""

from __future__ import annotations

import dataclasses
from pathlib import Path

import numpy as np

from benchmarks.repair_clips import Sound, sound_clips
from benchmarks.repair_judge import Verdict
from benchmarks.report import Bar
from pipeline.clips.human_clip import FEET, HumanClip
from pipeline.clips.outcome import Outcome
from pipeline.repair import RepairSettings, prepare, process
from tests.factories.planted_defects import Planted, plant

FLOOR_M = 0.005
"""A floor's height and its drift are right within this [m]."""
FLOOR_NUMBER = {"floor_offset": "floor_m", "floor_drift": "floor_drift_m"}
"""Kind of defect of the floor -> the number of KP2 that tells it."""
GENERATED, REAL = "generated", "real"
WANDERING, AS_IT_IS = "real, wandering", "real, as they are"
COUNTED = (GENERATED, REAL)
"""Groups of clips that are held to bounds."""
WANDER_M, WANDER_S = 0.005, 0.1
"""The body wanders by this RMS in each direction [m]; width of the Gauss curve that smooths the wander [s]."""
NOISE_M = 0.005
"""RMS of noise on each joint, in each direction [m]."""
SPOILT_SHARE = (0.1, 0.6)
"""Least and largest share of a clip that is noisy or lost, in one stretch."""
PART_S = 0.5
"""In so long a foot stands, or runs by [s]."""


def judge_floor(kind: str, number: int, seed: int, folder: Path, settings: RepairSettings) -> list[Verdict]:
    """Plant the `number`-th floor of a kind into a clip drawn for it, run KP2, and look; a recording in three ways."""
    rng = np.random.default_rng([seed, number, *kind.encode()])
    clips = sound_clips(folder)
    sound = clips[int(rng.integers(len(clips)))]
    if not sound.real:
        planted = plant(kind, sound.clip, rng)
        return [
            _judged(
                kind, sound, GENERATED, dataclasses.replace(planted, clip=tracked_badly(planted.clip, rng)), settings
            )
        ]
    drawn = rng.bit_generator.state
    as_it_is = plant(kind, sound.clip, rng)
    rng.bit_generator.state = drawn
    planted = plant(kind, put_on_ground(sound.clip, settings), rng)
    wandering = dataclasses.replace(planted, clip=tracked_badly(planted.clip, rng))
    each = ((REAL, planted), (WANDERING, wandering), (AS_IT_IS, as_it_is))
    return [_judged(kind, sound, group, one, settings) for group, one in each]


def _judged(kind: str, sound: Sound, group: str, planted: Planted, settings: RepairSettings) -> Verdict:
    return floor_verdict(kind, sound, group, planted, process(planted.clip, {"skill": sound.skill}, settings=settings))


def put_on_ground(clip: HumanClip, settings: RepairSettings) -> HumanClip:
    """The clip with what KP2 tells of its ground taken out, however little it is."""
    whole = prepare(clip, settings=settings)
    assert whole is not None
    pos = clip.body_pos_w.copy()
    share = np.linspace(-0.5, 0.5, clip.frame_count)
    pos[..., 2] -= (whole.floor.height + whole.floor.drift * share)[:, None]
    return dataclasses.replace(clip, body_pos_w=pos)


def floor_verdict(kind: str, sound: Sound, group: str, planted: Planted, outcome: Outcome) -> Verdict:
    """Hold what KP2 says of a ground against what was planted; right or not where the clip was on z = 0."""
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
        located=None if group == AS_IT_IS else right,
        text=f"{sound.clip.name} {sound.clip.fps:g} Hz x {planted.strength:.2f}: planted {1000 * size_m:+.1f} mm, "
        f"got {1000 * found_m:+.1f} mm, said {codes}",
    )


def tracked_badly(clip: HumanClip, rng: np.random.Generator) -> HumanClip:
    """The clip as its whole body wanders, and for a while every joint shakes, or all are lost, or neither."""
    pos, quat = clip.body_pos_w.copy(), clip.body_quat_w.copy()
    raw = smooth_way(clip.frame_count, clip.fps, rng)
    length = round(rng.uniform(*SPOILT_SHARE) * clip.frame_count)
    start = int(rng.integers(clip.frame_count - length + 1))
    span, how = slice(start, start + length), int(rng.integers(3))
    pos += wander(raw, span)[:, None]
    if how == 0:
        pos[span] += rng.normal(scale=NOISE_M, size=pos[span].shape)
    elif how == 1:
        pos[span], quat[span] = np.nan, np.nan
    return dataclasses.replace(clip, body_pos_w=pos, body_quat_w=quat)


def smooth_way(frames: int, fps: float, rng: np.random.Generator) -> np.ndarray:
    """A smooth random way (frames, 3)."""
    reach = round(4.0 * WANDER_S * fps)
    kernel = np.exp(-0.5 * (np.arange(-reach, reach + 1) / (WANDER_S * fps)) ** 2)
    raw = rng.normal(size=(frames + 2 * reach, 3))
    return np.stack([np.convolve(raw[:, axis], kernel, mode="valid") for axis in range(3)], axis=1)


def wander(way: np.ndarray, span: slice) -> np.ndarray:
    """The way with `WANDER_M` RMS [m] and without a cubic: truth stays true where the frames of `span` are lost, too.

    Neither all of it nor what is outside `span` has a mean or a slope.
    """
    share = np.linspace(-1.0, 1.0, len(way))
    kept = np.ones(len(way))
    kept[span] = 0.0
    lines = np.stack([np.ones(len(way)), share, kept, kept * share], axis=1)
    cubic = np.polynomial.legendre.legvander(share, 3)
    way = way - cubic @ np.linalg.solve(lines.T @ cubic, lines.T @ way)
    return WANDER_M * way / np.sqrt((way**2).mean(axis=0))


def ground_bars(folder: Path, settings: RepairSettings) -> list[Bar]:
    """How far KP2's ground of recordings is from a line through the lowest toes of each half second.

    And how far these are from a ground that has one height: that no more is known of it.
    """
    apart, tilted, spread = [], [], []
    for sound in sound_clips(folder):
        whole = prepare(sound.clip, settings=settings) if sound.real else None
        if whole is None:
            continue
        toes = np.minimum(*(sound.clip.pos(f"{side}_toe")[:, 2] for side in FEET))
        parts = np.array_split(np.arange(len(toes)), max(4, round(sound.clip.duration_s / PART_S)))
        when = np.array([part[toes[part].argmin()] for part in parts]) / (len(toes) - 1.0) - 0.5
        lowest = np.array([toes[part].min() for part in parts])
        level = [whole.floor.height + settings.floor.ball_height + whole.floor.drift * share for share in when]
        off = lowest - level
        drift, height = np.polyfit(when, off, 1)
        apart.append(abs(height))
        tilted.append(abs(drift))
        spread.append(np.ptp(np.percentile(off, (25, 75))))
    return [
        Bar(name=f"{name}, {which} of {len(values)} recordings", value=1000.0 * float(value), unit="mm")
        for name, values in (
            ("ground, from the lowest toes", apart),
            ("drift, from that of the lowest toes", tilted),
            ("middle half of the lowest toes over the ground", spread),
        )
        if values
        for which, value in (("median", np.median(values)), ("worst", max(values)))
    ]
