"""Both error rates of KP3's likeness metrics, which compare a retargeted clip with the person.

Known-good motion is the shipped motions as KP3 retargets them. Each fault is planted once into every clip, and counts
if some body moved by 0.05 m. Needs a checkout with a materialized `expert_db`.
"""

from __future__ import annotations

import dataclasses
from pathlib import Path

import numpy as np

from benchmarks.feasibility_faults import MATTERS_M, displacement
from benchmarks.feasibility_rates import rate
from benchmarks.report import Bar
from pipeline import rotation
from pipeline.batch import Store
from pipeline.clips.human_clip import HumanClip
from pipeline.clips.robot_clip import RobotClip
from pipeline.feasibility import FeasibilitySettings
from pipeline.feasibility.clip_criteria import likeness
from pipeline.feasibility.criterion import groups
from pipeline.retarget.process import numbers_of
from pipeline.robot import Robot, load_robot

SIDES = ("Left", "Right")


def likeness_bars(project: Path, limits: FeasibilitySettings, seed: int, least: float) -> list[Bar]:
    """Unchanged clips must pass every metric, changed clips must fail one. Raises FileError without clips."""
    store = Store(root=project / "data" / "store")
    people = {entry.clip: entry for entry in store.load("repaired_motions").entries}
    rng, robot = np.random.default_rng(seed), load_robot("t1")
    good: list[set[str]] = []
    found: dict[str, list[set[str]]] = {name: [] for name in PLANTS}
    for entry in store.load("retargeted_motions").entries:
        clip, person = store.get_clip(entry.blob, entry.clip), people.get(entry.clip)
        if person is None or not isinstance(clip, RobotClip):
            continue
        human = store.get_clip(person.blob, person.clip)
        if not isinstance(human, HumanClip):  # a robot's own recording
            continue
        human = human.resampled(clip.fps)
        good.append(_broken(clip, human, robot, limits))
        for name, (plant, _) in PLANTS.items():
            planted = plant(clip, robot, rng)
            if displacement(clip, planted, robot) >= MATTERS_M:
                found[name].append(_broken(planted, human, robot, limits) - good[-1])
    bars = [rate(f"known good: retargeted clips ({len(good)}) that hold all", [not codes for codes in good], least)]
    figures = groups()["likeness to the person"]
    bars += [rate(f"known good: hold {code}", [code not in codes for codes in good]) for code in figures]
    for name, each in found.items():
        bars.append(rate(f"found: {name} ({len(each)} planted)", [bool(codes) for codes in each], least))
        code = PLANTS[name][1]
        bars.append(rate(f"    by {code}", [code in codes for codes in each]))
    return bars


def sliding(clip: RobotClip, robot: Robot, rng: np.random.Generator) -> RobotClip:
    """Add 0.1 to 0.3 m/s to the whole body, including the feet."""
    return _carried(clip, rng.uniform(0.1, 0.3) * np.arange(clip.frame_count) / clip.fps, rng)


def swaying(clip: RobotClip, robot: Robot, rng: np.random.Generator) -> RobotClip:
    """Sway the whole body by 0.05 to 0.1 m at 0.5 to 1 Hz, including the feet."""
    phase = 2.0 * np.pi * rng.uniform(0.5, 1.0) * np.arange(clip.frame_count) / clip.fps
    return _carried(clip, rng.uniform(0.05, 0.1) * np.sin(phase), rng)


def sinking(clip: RobotClip, robot: Robot, rng: np.random.Generator) -> RobotClip:
    """Lower the robot by 0.05 to 0.08 m for a second."""
    away = np.abs(np.arange(clip.frame_count) - int(rng.integers(clip.frame_count))) / clip.fps
    share = 0.5 + 0.5 * np.cos(np.pi * np.clip(away / 0.5, 0.0, 1.0))
    return _lifted(clip, -rng.uniform(0.05, 0.08) * share)


def floating(clip: RobotClip, robot: Robot, rng: np.random.Generator) -> RobotClip:
    """Raise the robot by 0.05 to 0.08 m throughout."""
    return _lifted(clip, np.full(clip.frame_count, rng.uniform(0.05, 0.08)))


def arms_off(clip: RobotClip, robot: Robot, rng: np.random.Generator) -> RobotClip:
    """Rotate both upper arms by 0.7 to 1 rad."""
    return _turned(clip, robot, "Shoulder_Pitch", rng.uniform(0.7, 1.0))


def thighs_off(clip: RobotClip, robot: Robot, rng: np.random.Generator) -> RobotClip:
    """Rotate both thighs, with their child links, by 0.25 to 0.4 rad."""
    return _turned(clip, robot, "Hip_Pitch", -rng.uniform(0.25, 0.4))


def shanks_off(clip: RobotClip, robot: Robot, rng: np.random.Generator) -> RobotClip:
    """Rotate both shanks by 0.25 to 0.4 rad."""
    return _turned(clip, robot, "Knee_Pitch", rng.uniform(0.25, 0.4))


def trunk_off(clip: RobotClip, robot: Robot, rng: np.random.Generator) -> RobotClip:
    """Tilt the trunk forward by 0.25 to 0.4 rad, with unchanged legs."""
    angle = rng.uniform(0.25, 0.4)
    tilt = rotation.from_axis_angle(np.array([0.0, 1.0, 0.0]), np.full(clip.frame_count, angle))
    tilted = dataclasses.replace(clip, root_quat_w=rotation.multiply(clip.root_quat_w, tilt))
    return _turned(tilted, robot, "Hip_Pitch", -angle)


def heading_off(clip: RobotClip, robot: Robot, rng: np.random.Generator) -> RobotClip:
    """Rotate the heading of the whole robot by 0.25 to 0.4 rad."""
    turn = rotation.about_z(np.full(clip.frame_count, rng.uniform(0.25, 0.4)))
    return dataclasses.replace(clip, root_quat_w=rotation.multiply(turn, clip.root_quat_w))


PLANTS = {
    "feet that slide": (sliding, "slip_m_s"),
    "feet that sway": (swaying, "drift_m"),
    "soles that sink for a second": (sinking, "penetration_m"),
    "a clip that floats": (floating, "height_shift_m"),
    "arms elsewhere": (arms_off, "limb_error_deg"),
    "thighs elsewhere": (thighs_off, "thigh_error_deg"),
    "shanks elsewhere": (shanks_off, "shank_error_deg"),
    "a trunk that is tilted": (trunk_off, "trunk_error_deg"),
    "another heading": (heading_off, "heading_error_deg"),
}
"""Fault -> function that plants it, and the metric designed to find it."""


def _carried(clip: RobotClip, way: np.ndarray, rng: np.random.Generator) -> RobotClip:
    to = rng.uniform(-np.pi, np.pi)
    moved = way[:, None] * np.array([np.cos(to), np.sin(to), 0.0])
    return dataclasses.replace(clip, root_pos_w=clip.root_pos_w + moved)


def _lifted(clip: RobotClip, up: np.ndarray) -> RobotClip:
    return dataclasses.replace(clip, root_pos_w=clip.root_pos_w + up[:, None] * np.array([0.0, 0.0, 1.0]))


def _turned(clip: RobotClip, robot: Robot, joint: str, by: float) -> RobotClip:
    joints = clip.joint_pos.copy()
    joints[:, [robot.joint(f"{side}_{joint}") for side in SIDES]] += by
    return dataclasses.replace(clip, joint_pos=joints)


def _broken(clip: RobotClip, human: HumanClip, robot: Robot, limits: FeasibilitySettings) -> set[str]:
    numbers = numbers_of(clip, human, 1.0, robot)
    return {verdict.code for verdict in likeness(numbers, limits.likeness) if not verdict.holds}
