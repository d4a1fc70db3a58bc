"""Planted floor offsets and drifts, compared with the truth.

The ground of generated clips is known (z = 0), and KP2's estimate for a changed clip is compared with it. So that the
estimate is not that of a perfect clip, the whole body wanders as in mocap, and in some clips a part of the frames is
also noisy or lost.

The ground of a recording is unknown: a clean one is moved to z = 0 by KP2's own estimate, so that the planted defect is
the only one. This tests whether a defect is found and estimated correctly, not whether KP2 finds the ground;
`ground_bars` compares KP2 with another method. Recordings that also wander, and recordings with their original ground,
which may hide a planted defect, have no bound.
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
"""Tolerance of a floor's height and drift [m]."""
FLOOR_NUMBER = {"floor_offset": "floor_m", "floor_drift": "floor_drift_m"}
"""Kind of floor defect -> KP2 number that estimates it."""
GENERATED, REAL = "generated", "real"
WANDERING, AS_IT_IS = "real, wandering", "real, as they are"
COUNTED = (GENERATED, REAL)
"""Groups of clips with bounds."""
WANDER_M, WANDER_S = 0.005, 0.1
"""RMS of the body's wander in each direction [m]; width of the Gaussian that smooths it [s]."""
NOISE_M = 0.005
"""RMS of noise on each joint, in each direction [m]."""
SPOILT_SHARE = (0.1, 0.6)
"""Smallest and largest share of a clip that is noisy or lost, contiguously."""
PART_S = 0.5
"""Duration in which a foot stands, or passes [s]."""


def judge_floor(kind: str, number: int, seed: int, folder: Path, settings: RepairSettings) -> list[Verdict]:
    """Plant the `number`-th floor of a kind into a random clip and evaluate KP2; a recording in three ways."""
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
    """Remove KP2's ground estimate from the clip, however small."""
    whole = prepare(clip, settings=settings)
    assert whole is not None
    pos = clip.body_pos_w.copy()
    share = np.linspace(-0.5, 0.5, clip.frame_count)
    pos[..., 2] -= (whole.floor.height + whole.floor.drift * share)[:, None]
    return dataclasses.replace(clip, body_pos_w=pos)


def floor_verdict(kind: str, sound: Sound, group: str, planted: Planted, outcome: Outcome) -> Verdict:
    """Compare KP2's ground with the planted one; correctness only if the clip was on z = 0."""
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
    """Let the whole body wander and, for a while, shake all joints, lose all joints, or neither."""
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
    """A smooth random path (frames, 3) [m]."""
    reach = round(4.0 * WANDER_S * fps)
    kernel = np.exp(-0.5 * (np.arange(-reach, reach + 1) / (WANDER_S * fps)) ** 2)
    raw = rng.normal(size=(frames + 2 * reach, 3))
    return np.stack([np.convolve(raw[:, axis], kernel, mode="valid") for axis in range(3)], axis=1)


def wander(way: np.ndarray, span: slice) -> np.ndarray:
    """Scale a path to `WANDER_M` RMS and remove its cubic trend, so that the true ground remains valid.

    Neither the whole path nor its part outside `span` (lost frames) has a mean or a slope.
    """
    share = np.linspace(-1.0, 1.0, len(way))
    kept = np.ones(len(way))
    kept[span] = 0.0
    lines = np.stack([np.ones(len(way)), share, kept, kept * share], axis=1)
    cubic = np.polynomial.legendre.legvander(share, 3)
    way = way - cubic @ np.linalg.solve(lines.T @ cubic, lines.T @ way)
    return WANDER_M * way / np.sqrt((way**2).mean(axis=0))


def ground_bars(folder: Path, settings: RepairSettings) -> list[Bar]:
    """Difference between KP2's ground of recordings and a line through the lowest toes of each half second.

    Also the deviation of these toe heights from a constant ground, which bounds what can be known.
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
