"""Effect of repair on sound motion, quality of filled gaps, and quality of contact labels."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import numpy as np

from benchmarks.repair_called_clean import called_clean_bars
from benchmarks.repair_clips import CALLED_CLEAN, Sound, generated, recorded, sound_clips
from benchmarks.report import Bar
from pipeline import rotation
from pipeline.clips.human_clip import FEET, HumanClip, body
from pipeline.clips.outcome import Outcome
from pipeline.repair import RepairSettings, prepare, process
from pipeline.repair.floor import Placement
from pipeline.repair.robot_motion import label_robot_contacts
from pipeline.robot import load_robot
from tests.factories.policy_walks import policy_walk

FEET_JOINTS = [body(f"{side}_{name}") for side in FEET for name in ("ankle", "toe")]
GAPS_S = {0.2: (0.8, 1.5), 0.35: (3.0, None), 0.5: (3.0, None)}
"""Length of a gap -> bounds on the RMS over all joints and over ankles and balls of the feet [cm]."""
TOO_LONG_S = 0.6
BOUNCE_HZ, BOUNCE_M = 2.8, 0.05
COMMANDS = (
    (0.6, 0.0, 0.0),
    (1.0, 0.0, 0.0),
    (2.0, 0.0, 0.0),
    (-0.5, 0.0, 0.0),
    (0.0, 0.5, 0.0),
    (0.0, 0.0, 1.0),
    (1.2, 0.0, 0.8),
    (0.4, -0.4, 0.5),
)
"""Commands of the rollouts [m/s, m/s, rad/s]."""


def sound_bars(folder: Path, settings: RepairSettings) -> list[Bar]:
    """Flagged frames of sound clips, difference between output and input, and a runner's bounce."""
    bars = []
    everything = [0, 0]
    for name, sounds in (("generated", generated()), ("real", recorded(folder))):
        if not sounds:
            continue
        flagged = total = 0
        moved, turned = [], []
        for sound in sounds:
            outcome, marked = _marked(sound, settings)
            flagged += marked
            total += sound.clip.frame_count
            far, turn = apart(outcome, sound.clip)
            moved.append(far)
            turned.append(turn)
        bars += [
            _most(f"sound clips, {name} ({len(sounds)}): frames flagged", 100.0 * flagged / total, "%", 0.5),
            _most(f"sound clips, {name}: moved, RMS of the worst clip", 1000.0 * max(moved), "mm", 5.0),
            _most(f"sound clips, {name}: turned, RMS of the worst clip", np.rad2deg(max(turned)), "deg", 1.0),
        ]
        everything = [everything[0] + flagged, everything[1] + total]
    bars.append(_most("sound clips, all: frames flagged", 100.0 * everything[0] / everything[1], "%", 0.5))
    for sound in recorded(folder, dict(CALLED_CLEAN)):
        bars += called_clean_bars(sound, _marked(sound, settings)[1], (everything[0], everything[1]))
    return [*bars, *_bounce_bars(settings)]


def _marked(sound: Sound, settings: RepairSettings) -> tuple[Outcome, int]:
    """KP2's outcome for a clip, and the number of flagged frames."""
    whole = prepare(sound.clip, settings=settings)
    outcome = process(sound.clip, {"skill": sound.skill}, settings=settings, prepared=whole)
    assert whole is not None
    kept = np.zeros(sound.clip.frame_count, dtype=bool)
    for piece in outcome.pieces:
        kept[int(piece.numbers["start_frame"] or 0) : int(piece.numbers["stop_frame"] or 0)] = True
    return outcome, int((whole.findings.lost.any(axis=1) | whole.division.dropped | ~kept).sum())


def apart(outcome: Outcome, clip: HumanClip) -> tuple[float, float]:
    """RMS differences of position [m] and angle [rad] between output and input, over frames and joints."""
    moved, turned = [np.zeros(0)], [np.zeros(0)]
    for piece in outcome.pieces:
        span = slice(int(piece.numbers["start_frame"] or 0), int(piece.numbers["stop_frame"] or 0))
        back = undone(outcome, piece.clip, piece.numbers)
        moved.append(np.linalg.norm(back.body_pos_w - clip.body_pos_w[span], axis=-1).ravel())
        turned.append(rotation.angle_between(back.body_quat_w, clip.body_quat_w[span]).ravel())
    return _rms(np.concatenate(moved)), _rms(np.concatenate(turned))


def undone(outcome: Outcome, clip, numbers) -> HumanClip:
    """Transform a piece back to the world of its source."""
    names = [field.name for field in dataclasses.fields(Placement)]
    return Placement(**{name: numbers[name] for name in names}).undone(clip)


def _bounce_bars(settings: RepairSettings) -> list[Bar]:
    """Remaining amplitude and delay of a runner's pelvis that bounces by 0.05 m at 2.8 Hz."""
    sound = next(one for one in generated() if one.clip.name.endswith("run_easy"))
    time_s = np.arange(sound.clip.frame_count) / sound.clip.fps
    pos_w = sound.clip.body_pos_w + BOUNCE_M * np.sin(2 * np.pi * BOUNCE_HZ * time_s)[:, None, None] * [0.0, 0.0, 1.0]
    contact = dataclasses.replace(settings.contact, slip_limit_m_s=9.0, skate_limit_m_s=9.0, longest_flight_s=9.0)
    free = dataclasses.replace(settings, contact=contact)
    outcomes = [
        process(one, {"skill": "run"}, settings=free)
        for one in (sound.clip, dataclasses.replace(sound.clip, body_pos_w=pos_w))
    ]
    plain, bouncing = (
        undone(outcome, outcome.pieces[0].clip, outcome.pieces[0].numbers).pos("pelvis")[:, 2] for outcome in outcomes
    )
    inner = slice(round(sound.clip.fps), -round(sound.clip.fps))
    angle = 2 * np.pi * BOUNCE_HZ * time_s
    basis = np.stack([np.sin(angle), np.cos(angle), np.ones_like(angle)], axis=1)[inner]
    (in_phase, quarter, _), *_ = np.linalg.lstsq(basis, (bouncing - plain)[inner], rcond=None)
    lag_s = abs(np.arctan2(quarter, in_phase)) / (2 * np.pi * BOUNCE_HZ)
    kept = 100.0 * np.hypot(in_phase, quarter) / BOUNCE_M
    return [
        Bar(name="a bounce at 2.8 Hz keeps", value=float(kept), unit="%", sense=">=", bound=95.0),
        _most("and is late by", 1000.0 * float(lag_s), "ms", 1.0),
    ]


def gap_bars(folder: Path, settings: RepairSettings, count: int) -> list[Bar]:
    """RMS error of filled gaps in all joints of walking people; longer gaps must be cut."""
    walks = [sound for sound in sound_clips(folder) if sound.walks and sound.speed_m_s < 1.9]
    bars = []
    for seconds, (all_joints, feet) in GAPS_S.items():
        errors, at_feet, told = [], [], []
        for number in range(count // 2):
            filled = _filled(walks, number, seconds, settings)
            if filled is not None:
                error, flagged = filled
                errors.append((error**2).mean())
                at_feet.append((error[:, FEET_JOINTS] ** 2).mean())
                told.append(flagged)
        name = f"gaps of {seconds:g} s, walking, {len(errors)} filled"
        bars.append(_most(f"{name}: RMS over all joints", 100.0 * float(np.sqrt(np.mean(errors))), "cm", all_joints))
        value = 100.0 * float(np.sqrt(np.mean(at_feet)))
        bars.append(_most(f"{name}: at the feet", value, "cm", feet))
        bars.append(Bar(name=f"{name}: told", value=100.0 * float(np.mean(told)), unit="%", sense=">=", bound=100.0))
    cut = [_filled(walks, number, TOO_LONG_S, settings) is None for number in range(count // 4)]
    name = f"gaps of {TOO_LONG_S:g} s are cut"
    return [*bars, Bar(name=name, value=100.0 * float(np.mean(cut)), unit="%", sense=">=", bound=100.0)]


def _filled(
    walks: list[Sound], number: int, seconds: float, settings: RepairSettings
) -> tuple[np.ndarray, bool] | None:
    """Error (gap, 19) in a gap, and whether it is reported as filled; None if it was cut."""
    rng = np.random.default_rng([7, number, round(1000 * seconds)])
    sound = walks[int(rng.integers(len(walks)))]
    clip, length = sound.clip, round(seconds * sound.clip.fps)
    start = int(rng.integers(round(0.6 * clip.fps), clip.frame_count - length - round(0.6 * clip.fps)))
    pos, quat = clip.body_pos_w.copy(), clip.body_quat_w.copy()
    pos[start : start + length], quat[start : start + length] = np.nan, np.nan
    spoilt = dataclasses.replace(clip, body_pos_w=pos, body_quat_w=quat)
    outcome = process(spoilt, {"skill": sound.skill}, settings=settings)
    for piece in outcome.pieces:
        first, last = int(piece.numbers["start_frame"] or 0), int(piece.numbers["stop_frame"] or 0)
        if first < start and start + length < last:
            back = undone(outcome, piece.clip, piece.numbers)
            made = back.body_pos_w[start - first : start - first + length]
            told = any(one.code == "missing" and one.effect == "repaired" for one in outcome.reasons)
            return np.linalg.norm(made - clip.body_pos_w[start : start + length], axis=-1), told
    return None


def contact_bars(policies: Path, settings: RepairSettings) -> list[Bar]:
    """Framewise F1 of contact labels, against ground truth of generated clips and forces in simulation."""
    found, true, each = [], [], []
    for sound in generated():
        for piece in process(sound.clip, {"skill": sound.skill}, settings=settings).pieces:
            assert isinstance(piece.clip, HumanClip)
            assert piece.clip.contacts is not None
            assert sound.clip.contacts is not None
            start, stop = int(piece.numbers["start_frame"] or 0), int(piece.numbers["stop_frame"] or 0)
            found.append(piece.clip.contacts)
            true.append(sound.clip.contacts[start:stop])
            each.append(f1(found[-1], true[-1]))
    bars = [
        _least("contacts, generated motions: F1", f1(np.concatenate(found), np.concatenate(true)), 0.98),
        Bar(name="contacts, worst generated motion: F1", value=min(each)),
    ]
    if not (policies / "t1_walk.npz").is_file():
        return bars
    robot = load_robot("t1")
    found, true, each = [], [], []
    for command in COMMANDS:
        clip = policy_walk(policies, robot, command, 8.0).clip("walk", start_s=1.0)
        assert clip.contacts is not None
        found.append(label_robot_contacts(dataclasses.replace(clip, contacts=None), robot))
        true.append(clip.contacts)
        each.append(f1(found[-1], true[-1]))
    return [
        *bars,
        _least("contacts, forces in simulation: F1", f1(np.concatenate(found), np.concatenate(true)), 0.96),
        Bar(name="contacts, worst rollout: F1", value=min(each)),
    ]


def f1(found: np.ndarray, true: np.ndarray) -> float:
    """Framewise F1 score, without tolerance."""
    hit = np.sum(found & true)
    return float(2 * hit / (2 * hit + np.sum(found != true)))


def _rms(values: np.ndarray) -> float:
    return float(np.sqrt(np.mean(values**2))) if len(values) else 0.0


def _most(name: str, value: float, unit: str, bound: float | None) -> Bar:
    return Bar(name=name, value=float(value), unit=unit, sense="<=" if bound is not None else "", bound=bound)


def _least(name: str, value: float, bound: float) -> Bar:
    return Bar(name=name, value=value, sense=">=", bound=bound)
