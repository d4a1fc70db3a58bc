"""Whether a planted defect is found and located, by the stage's reasons minus those for the sound clip."""

from __future__ import annotations

import functools
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from benchmarks.repair_clips import Sound, sound_clips
from pipeline.clips.outcome import Outcome, Reason
from pipeline.repair import RepairSettings, process
from tests.factories.planted_defects import Planted, plant

EDGE_FRAMES, EDGE_S = 2, 0.04
"""Tolerance of an edge in frames and in seconds; the larger one applies."""
CONSEQUENCES = frozenset({"too_short", "no_contact", "foot_skate", "floor_drift", "floor_offset"})
"""Reasons that do not concern corrupted frames."""


@dataclass(frozen=True, kw_only=True)
class Verdict:
    """Result for one planted defect."""

    kind: str
    clip: str
    strength: float
    detected: bool
    located: bool | None
    """Where the defect has edges: both are where they are; of a floor: its height or drift is right, None where nobody
    knows the ground."""
    text: str
    """Description of the planted defect and of the outcome."""
    group: str = ""
    """Group of clips that is counted separately; empty if a kind has one group."""


@functools.cache
def outcome_of(sound_index: int, folder: Path, settings: RepairSettings) -> Outcome:
    """KP2's outcome for a sound clip."""
    sound = sound_clips(folder)[sound_index]
    return process(sound.clip, {"skill": sound.skill}, settings=settings)


def judge_plant(kind: str, number: int, seed: int, folder: Path, settings: RepairSettings) -> Verdict:
    """Plant the `number`-th defect of a kind into a random clip and evaluate KP2."""
    rng = np.random.default_rng([seed, number, *kind.encode()])
    clips = sound_clips(folder)
    index = int(rng.integers(len(clips)))
    while needs_walking(kind) and not clips[index].walks:
        index = int(rng.integers(len(clips)))
    sound, clean = clips[index], outcome_of(index, folder, settings)
    return judge(kind, sound, plant(kind, sound.clip, rng), clean, settings)


def needs_walking(kind: str) -> bool:
    return kind in ("foot_skate",)


def judge(kind: str, sound: Sound, planted: Planted, clean: Outcome, settings: RepairSettings) -> Verdict:
    """Compare KP2's outcome for the changed clip with the planted defect."""
    outcome = process(planted.clip, {"skill": sound.skill}, settings=settings)
    known = {(one.code, one.start_s, one.stop_s) for one in clean.reasons}
    new = [one for one in outcome.reasons if (one.code, one.start_s, one.stop_s) not in known]
    fps = sound.clip.fps
    if kind == "foot_skate":
        detected, located = _skate(planted, new, fps, _standing(sound, clean))
    else:
        detected, located = _frames(planted, new, fps)
    said = "; ".join(f"{one.code} {one.start_s} {one.stop_s} {one.text[:90]}" for one in new[:6])
    text = (
        f"{sound.clip.name} {fps:g} Hz, frames [{planted.start}, {planted.stop}) matters [{planted.first}, "
        f"{planted.last}] x {planted.strength:.2f}: {said or 'nothing said'}"
    )
    return Verdict(
        kind=kind, clip=sound.clip.name, strength=planted.strength, detected=detected, located=located, text=text
    )


def edge_frames(fps: float) -> float:
    """Tolerance of an edge in frames."""
    return max(EDGE_FRAMES, EDGE_S * fps)


def _frames(planted: Planted, new: list[Reason], fps: float) -> tuple[bool, bool]:
    off = edge_frames(fps)
    spans = [
        (one.start_s * fps, (one.start_s if one.stop_s is None else one.stop_s) * fps)
        for one in new
        if one.start_s is not None and one.code not in CONSEQUENCES
    ]
    low, high = planted.start - off, max(planted.stop, planted.start + 1) + off
    if not any(start <= high and stop >= low for start, stop in spans):
        return False, False
    first, last = min(start for start, _ in spans), max(max(stop, start + 1) for start, stop in spans)
    starts = low - 1e-6 <= first <= planted.first + off + 1e-6
    return True, starts and planted.last + 1 - off - 1e-6 <= last <= high + 1e-6


def _skate(planted: Planted, new: list[Reason], fps: float, standing: np.ndarray) -> tuple[bool, bool]:
    """Whether a skate is found and located; an edge in flight may be located at the adjacent stance."""
    spans = [
        (one.start_s * fps, one.stop_s * fps)
        for one in new
        if one.code == "foot_skate" and one.start_s is not None and one.stop_s is not None
    ]
    hit = [(start, stop) for start, stop in spans if start < planted.stop and stop > planted.start]
    if not hit:
        return False, False
    edges = (planted.start, min(start for start, _ in hit)), (planted.stop, max(stop for _, stop in hit))
    stands = np.flatnonzero(standing)
    for true, found in edges:
        before, after = stands[stands < true], stands[stands >= true]
        low = int(before[-1]) + 1 if len(before) else 0
        high = int(after[0]) if len(after) else len(standing)
        if not min(low, true) - edge_frames(fps) <= found <= max(high, true) + edge_frames(fps):
            return True, False
    return True, True


def _standing(sound: Sound, clean: Outcome) -> np.ndarray:
    """Frames (t,) of a sound clip in which a foot stands: ground truth if generated, else the labels."""
    if sound.clip.contacts is not None:
        return np.asarray(sound.clip.contacts.any(axis=1))
    standing = np.ones(sound.clip.frame_count, dtype=bool)
    for piece in clean.pieces:
        if piece.clip.contacts is not None:
            first = int(piece.numbers["start_frame"] or 0)
            standing[first : first + piece.clip.frame_count] = piece.clip.contacts.any(axis=1)
    return standing
