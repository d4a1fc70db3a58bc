"""Planted defects of whole files: a wrong rate, frames stored several times, a wrong unit.

Also two changes of the numbers, but not of the motion, which must not change the result: negated quaternions, and
angles offset by whole turns.
"""

from __future__ import annotations

import dataclasses
import functools
import tempfile
from collections.abc import Callable
from pathlib import Path

import numpy as np

from benchmarks.repair_clips import Sound, generated, recorded, sound_clips
from benchmarks.repair_judge import Verdict
from pipeline.catalog import CatalogSettings, correct
from pipeline.clips.human_clip import HumanClip
from pipeline.errors import PipelineError
from pipeline.generator import RECIPES, bvh
from pipeline.generator.generate import make_motion
from pipeline.quality.planar_motion import planar_motion
from pipeline.readers import ReadMotion
from pipeline.readers.bvh import read_bvh
from pipeline.readers.human_motion import METRES, to_human
from pipeline.readers.raw_motion import RowPoses
from pipeline.readers.source import Statement
from pipeline.repair import RepairSettings, process

WRONG_RATIO = 1.5
"""Least factor of a rate error that counts."""
RATE_SHARE = 0.02
"""Relative tolerance of a rate."""
WALK_M_S, WALK_S = 0.5, 4.0
"""Least forward speed [m/s] and duration [s] of walking."""


def wrong_rate(number: int, seed: int, folder: Path, settings: CatalogSettings) -> Verdict:
    """Plant a wrong declared rate, another standard one, into a walk or run."""
    rng = np.random.default_rng([seed, number, *b"wrong_rate"])
    walks = walking_clips(folder)
    sound = walks[int(rng.integers(len(walks)))]
    true_fps = sound.clip.fps
    rates = [rate for rate in settings.time_base.standard_rates_hz if _apart(rate, true_fps) >= WRONG_RATIO]
    declared = float(rng.choice(rates))
    spoilt = dataclasses.replace(sound.clip, fps=declared)
    corrected = correct(_read(spoilt, sound.skeleton), settings=settings)
    found = [reason for reason in corrected.reasons if reason.code == "time_base"]
    return Verdict(
        kind="wrong_rate",
        clip=sound.clip.name,
        strength=_apart(declared, true_fps) / WRONG_RATIO,
        detected=bool(found),
        located=abs(corrected.clip.fps / true_fps - 1.0) <= RATE_SHARE,
        text=f"{sound.clip.name} {sound.speed_m_s:.2f} m/s, {true_fps:g} Hz declared as {declared:g} Hz: "
        f"{corrected.clip.fps:g} Hz {found[0].effect + ' ' + found[0].text if found else 'nothing said'}",
    )


@functools.cache
def walking_clips(folder: Path) -> tuple[Sound, ...]:
    """Whole clips in which the person walks or runs forward for four seconds and most of the time."""
    result = []
    for sound in (*generated(), *recorded(folder)):
        motion = planar_motion(sound.clip, 0.2, 0.5, 0.5)
        ahead = motion.forward > WALK_M_S
        if ahead.mean() >= 0.5 and ahead.sum() / sound.clip.fps >= WALK_S:
            result.append(sound)
    return tuple(result)


def stored_twice(number: int, seed: int, folder: Path, settings: CatalogSettings) -> Verdict:
    """Plant repeated frames: every frame is stored two or three times."""
    rng = np.random.default_rng([seed, number, *b"stored_twice"])
    clips = sound_clips(folder)
    sound = clips[int(rng.integers(len(clips)))]
    times, first = int(rng.integers(2, 4)), int(rng.integers(0, 3))
    pos, quat = (np.repeat(values, times, axis=0)[first:] for values in (sound.clip.body_pos_w, sound.clip.body_quat_w))
    spoilt = HumanClip(name=sound.clip.name, fps=sound.clip.fps * times, body_pos_w=pos, body_quat_w=quat)
    corrected = correct(_read(spoilt, sound.skeleton), settings=settings)
    right = corrected.times_stored == times and abs(corrected.clip.fps / sound.clip.fps - 1.0) <= RATE_SHARE
    return Verdict(
        kind="stored_twice",
        clip=sound.clip.name,
        strength=float(times),
        detected=corrected.times_stored > 1,
        located=right,
        text=f"{sound.clip.name} {times} times: {corrected.times_stored} times, {corrected.clip.fps:g} Hz",
    )


def wrong_unit(number: int, seed: int, folder: Path, settings: CatalogSettings) -> Verdict:
    """Plant a wrong unit: a person in inches, with no stated unit or with centimetres stated."""
    rng = np.random.default_rng([seed, number, *b"wrong_unit"])
    stature, stated = float(rng.uniform(1.3, 2.05)), bool(rng.integers(2))
    raw = _raw_motion(folder, tuple(RECIPES)[int(rng.integers(len(RECIPES)))])
    scale = stature / 1.75 * METRES["cm"] / METRES["inch"]
    columns = tuple(range(len(raw.joint_names)))
    poses = RowPoses(rows=(raw.joint_pos_w * scale, raw.joint_quat_w), columns=columns)
    motion = dataclasses.replace(raw, rest_offset=raw.rest_offset * scale, poses=poses)
    try:
        understood = to_human(motion, "person", Statement(unit="cm") if stated else Statement())
        said, right = f"{understood.unit}", not stated and understood.unit == "inch"
    except PipelineError as error:
        said, right = str(error)[:120], stated
    return Verdict(
        kind="wrong_unit",
        clip="person",
        strength=METRES["inch"] / METRES["cm"],
        detected=right,
        located=right,
        text=f"{stature:.2f} m in inches, {'stated cm' if stated else 'nothing stated'}: {said}",
    )


def other_signs(number: int, seed: int, folder: Path, settings: RepairSettings) -> Verdict:
    """Negate random quaternions, which are the same rotations: no finding, and the same result."""
    rng = np.random.default_rng([seed, number, *b"other_signs"])
    clips = sound_clips(folder)
    index = int(rng.integers(len(clips)))
    clip = clips[index].clip
    share = rng.uniform(0.01, 0.5)
    signs = np.where(rng.random((clip.frame_count, 19, 1)) < share, -1.0, 1.0)
    spoilt = dataclasses.replace(clip, body_quat_w=clip.body_quat_w * signs)
    same = _same(process(spoilt, {}, settings=settings), process(clip, {}, settings=settings))
    return Verdict(kind="other_signs", clip=clip.name, strength=1.0, detected=same, located=same, text=clip.name)


def whole_turns(number: int, seed: int, folder: Path, settings: RepairSettings) -> Verdict:
    """Offset angles of a file by whole turns, which are the same rotations."""
    rng = np.random.default_rng([seed, number, *b"whole_turns"])
    name = tuple(RECIPES)[int(rng.integers(len(RECIPES)))]
    motion, block = _block(name)
    turned = block.copy()
    turned[:, 3:] += 360.0 * rng.integers(-1, 2, turned[:, 3:].shape) * (rng.random(turned[:, 3:].shape) < 0.05)
    first, last = (_clip_of(values, motion.fps) for values in (block[:120], turned[:120]))
    same = bool(np.abs(first.body_pos_w - last.body_pos_w).max() < 1e-6)
    quat_apart = np.abs(np.sum(first.body_quat_w * last.body_quat_w, axis=-1))
    same &= bool(np.abs(quat_apart - 1.0).max() < 1e-9)
    return Verdict(kind="whole_turns", clip=name, strength=1.0, detected=same, located=same, text=name)


FILE_KINDS: dict[str, Callable[..., Verdict]] = {
    "wrong_rate": wrong_rate,
    "stored_twice": stored_twice,
    "wrong_unit": wrong_unit,
}
HARMLESS: dict[str, Callable[..., Verdict]] = {"other_signs": other_signs, "whole_turns": whole_turns}


def _apart(a: float, b: float) -> float:
    return max(a / b, b / a)


def _same(a, b) -> bool:
    if a.reasons != b.reasons or len(a.pieces) != len(b.pieces):
        return False
    return all(
        np.abs(one.clip.body_pos_w - two.clip.body_pos_w).max() < 1e-9
        and np.abs(np.abs(np.sum(one.clip.body_quat_w * two.clip.body_quat_w, axis=-1)) - 1.0).max() < 1e-9
        for one, two in zip(a.pieces, b.pieces, strict=True)
    )


def _read(clip: HumanClip, skeleton: str) -> ReadMotion:
    return ReadMotion(
        clip=clip,
        format="bvh",
        skeleton=skeleton,
        declared_fps=clip.fps,
        unit="cm",
        metres_per_unit=0.01,
        up_axis="y",
        files=(Path(f"{clip.name}.bvh"),),
        notes=(),
    )


@functools.cache
def _block(name: str):
    motion, _ = make_motion(RECIPES[name])
    return motion, bvh.channels(motion)


@functools.cache
def _raw_motion(folder: Path, name: str):
    motion, block = _block(name)
    return _raw(block[:60], motion.fps)


def _clip_of(block: np.ndarray, fps: float) -> HumanClip:
    return to_human(_raw(block, fps), "clip", Statement()).clip


def _raw(block: np.ndarray, fps: float):
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "clip.bvh"
        path.write_text(bvh.to_text(block, fps))
        return read_bvh(path)
