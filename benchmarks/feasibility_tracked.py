"""Both error rates of the tracking criteria: motion tracked in MuJoCo, and planted or simulated divergence.

The robot stands and swings its arms by PD control alone, each joint with its own amplitude and frequency; half of the
rollouts have a push and recover. With the robot's own, soft ankle gains or with too weak legs it falls, which is the
simulated divergence; other faults are planted into the rollout. A fault counts if some body is displaced by 0.25 m or
more: good tracking has errors up to 0.1 m.
"""

from __future__ import annotations

import dataclasses

import numpy as np

from benchmarks.feasibility_faults import displacement
from benchmarks.feasibility_rates import rate
from benchmarks.report import Bar
from pipeline.clips.robot_clip import RobotClip
from pipeline.feasibility import FeasibilitySettings
from pipeline.feasibility.motion import motion_of
from pipeline.feasibility.tracking_criteria import CRITERIA, tracking
from pipeline.robot import Robot, load_robot
from pipeline.simulation.plant import Push
from tests.factories.robot_clips import standing
from tests.factories.tracked_motion import tracked

CODES = tuple(each.code for each in CRITERIA)
SECONDS = 6.0
MATTERS_M = 0.25
"""BeyondMimic's bound on the height error of hands and feet, here for the displacement of any body [m]."""
SIDES, ARM = ("Left", "Right"), ("Shoulder_Pitch", "Shoulder_Roll", "Elbow_Pitch", "Elbow_Yaw")
SWING, RATE_HZ = (0.1, 0.5), (0.2, 0.7)
"""Amplitude [rad] and frequency of each arm joint."""
SHOVE_N = (10.0, 40.0)


def tracking_bars(limits: FeasibilitySettings, count: int, seed: int, least: float) -> list[Bar]:
    """Tracking rollouts must pass every criterion; large enough divergence must violate one."""
    rng, robot = np.random.default_rng(seed), load_robot("t1")
    good: list[set[str]] = []
    found: dict[str, list[set[str]]] = {}
    fallen = 0
    for number in range(count):
        reference = swinging(robot, rng)
        simulated = tracked(robot, reference, events=_pushes(rng) if number % 2 else ())
        if simulated.fell:
            fallen += 1
            continue
        rollout = simulated.clip("rollout")
        good.append(_broken(rollout, reference, robot, limits))
        plants = {name: plant(rollout, robot, rng) for name, plant in PLANTS.items()}
        plants["ankles too soft, in simulation"] = tracked(robot, reference, ankles=1.0).clip("rollout")
        plants["legs too weak, in simulation"] = tracked(_weak(robot, rng), reference).clip("rollout")
        for name, planted in plants.items():
            found.setdefault(name, [])  # a fault that is always too small counts as not measured, and fails
            if displacement(rollout, planted, robot) >= MATTERS_M:
                found[name].append(_broken(planted, reference, robot, limits) - good[-1])
    bars = [Bar(name="rollouts that fell when they were pushed, left out", value=fallen)]
    bars.append(rate(f"known good: tracked rollouts ({len(good)}) that hold all", [not codes for codes in good], least))
    bars += [rate(f"known good: hold {code}", [code not in codes for codes in good]) for code in CODES]
    for name, each in found.items():
        bars.append(rate(f"found: {name} ({len(each)} planted)", [bool(codes) for codes in each], least))
        bars += [rate(f"    by {code}", [code in codes for codes in each]) for code in CODES]
    return bars


def swinging(robot: Robot, rng: np.random.Generator) -> RobotClip:
    """Reference of a standing robot whose arm joints swing to one side and back, from rest."""
    clip = standing(robot, SECONDS, name="swing")
    times_s = np.arange(clip.frame_count) / clip.fps
    joints = clip.joint_pos.copy()
    for joint in (robot.joint(f"{side}_{name}") for side in SIDES for name in ARM):
        angle = rng.uniform(*SWING) * (1.0 if rng.random() < 0.5 else -1.0)
        joints[:, joint] += 0.5 * angle * (1.0 - np.cos(2.0 * np.pi * rng.uniform(*RATE_HZ) * times_s))
    inside = np.clip(joints, robot.joint_lower + 0.05, robot.joint_upper - 0.05)
    return dataclasses.replace(clip, joint_pos=inside)


def drifting_arm(clip: RobotClip, robot: Robot, rng: np.random.Generator) -> RobotClip:
    """Let an arm drift by 0.8 to 1.2 rad until the end."""
    side, sign = (("Left", -1.0), ("Right", 1.0))[int(rng.integers(2))]
    way = sign * np.linspace(0.0, rng.uniform(0.8, 1.2), clip.frame_count)
    return _shifted(clip, robot.joint(f"{side}_Shoulder_Roll"), way)


def arm_elsewhere(clip: RobotClip, robot: Robot, rng: np.random.Generator) -> RobotClip:
    """Offset an arm by 0.8 to 1.2 rad from some time on."""
    side = SIDES[int(rng.integers(2))]
    start = int(rng.integers(clip.frame_count // 4, 3 * clip.frame_count // 4))
    way = np.where(np.arange(clip.frame_count) >= start, rng.uniform(0.8, 1.2), 0.0)
    return _shifted(clip, robot.joint(f"{side}_Shoulder_Pitch"), way)


def root_too_low(clip: RobotClip, robot: Robot, rng: np.random.Generator) -> RobotClip:
    """Lower the root by 0.28 to 0.4 m from some time on."""
    start = int(rng.integers(clip.frame_count // 4, 3 * clip.frame_count // 4))
    root = clip.root_pos_w.copy()
    root[start:, 2] -= rng.uniform(0.28, 0.4)
    return dataclasses.replace(clip, root_pos_w=root)


PLANTS = {
    "an arm that drifts off": drifting_arm,
    "an arm that is elsewhere": arm_elsewhere,
    "a root that is too low": root_too_low,
}


def _shifted(clip: RobotClip, joint: int, way: np.ndarray) -> RobotClip:
    joints = clip.joint_pos.copy()
    joints[:, joint] += way
    return dataclasses.replace(clip, joint_pos=joints)


def _pushes(rng: np.random.Generator) -> tuple[Push, ...]:
    way, size = rng.uniform(-np.pi, np.pi), rng.uniform(*SHOVE_N)
    force_w = size * np.array([np.cos(way), np.sin(way), 0.0])
    return (Push(start_s=float(rng.uniform(1.0, 4.0)), duration_s=0.2, force_w=force_w),)


def _weak(robot: Robot, rng: np.random.Generator) -> Robot:
    """The robot with legs too weak to carry it."""
    legs = [index for index, name in enumerate(robot.joint_names) if "Hip" in name or "Knee" in name]
    limit = robot.torque_limit.copy()
    limit[legs] = rng.uniform(1.0, 3.0)
    return dataclasses.replace(robot, torque_limit=limit)


def _broken(rollout: RobotClip, reference: RobotClip, robot: Robot, limits: FeasibilitySettings) -> set[str]:
    motion = motion_of(rollout, robot, limits, reference.cut(0, rollout.frame_count, "reference"))
    return {verdict.code for verdict in tracking(motion, limits.tracking) if not verdict.holds}
