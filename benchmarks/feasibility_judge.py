"""Known-good walks, their evaluation by KP5, and whether it finds the faults planted into them."""

from __future__ import annotations

import dataclasses
from collections.abc import Collection
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from benchmarks.feasibility_faults import FAULTS, LABELS, matters
from pipeline.clips.robot_clip import RobotClip
from pipeline.deployment import load_policy
from pipeline.feasibility import CommandSettings, FeasibilitySettings, assess, process
from pipeline.feasibility.motion import motion_of
from pipeline.files import settings
from pipeline.quality.planar_motion import command_velocity
from pipeline.repair.robot_motion import label_robot_contacts
from pipeline.robot import Robot, load_robot
from pipeline.simulation.mujoco_plant import MujocoOptions, MujocoPlant
from pipeline.simulation.run import run
from pipeline.simulation.torque_envelope import TorqueEnvelope
from pipeline.validation.deployed import deployed
from tests.factories.policy_walks import Rollout, policy_walk, steady_command

Command = tuple[float, float, float]

ROOT = Path(__file__).resolve().parent.parent
ROBOT = ROOT / "robots" / "t1"
COMMANDS = settings.read(ROOT / "data" / "commands.yaml", CommandSettings)
PUBLISHED = "t1_walk.npz"
"""Name of the published policy's file; it is deployed with its own gains."""
NAMES = (PUBLISHED, "policy.npz")
"""A policy's file in its folder."""
SECONDS, START_S, TIMESTEP_S = 7.0, 1.0, 0.005
"""Length of a rollout, length of the excluded start, and physics step [s]."""
WINDOW_S = 0.5
"""Length of short windows, the shortest of the selection [s]."""
RUN_SPEED = 1.3
"""Speed above which double playback speed is a fault [m/s]; slower walks remain feasible at twice their speed."""
STILL = 0.3
"""Commands below this get no faults [m/s, rad/s]."""
SWAPPED = "feet swapped"
"""Not a fault for a standing robot, because its mirrored pose stands as well."""
NO_LABELS, TOLD_LABELS = ", no labels", ", KP2's labels"
"""Contact labels for the evaluation: those of the simulation, none, and those inferred by KP2."""


@dataclass
class Judged:
    """Evaluation of one rollout and of the faults planted into it."""

    fell: bool = False
    labelled: tuple[bool, float] = (False, 0.0)
    """Whether the whole rollout is accepted, and the accepted share of its duration."""
    unlabelled: bool = False
    told: bool = False
    """Whether the whole rollout is accepted without contacts, and with contacts inferred by KP2."""
    windows: list[bool] = field(default_factory=list)
    broken: set[str] = field(default_factory=set)
    """Criteria that the whole rollout violates, with labels of any kind or without."""
    found: dict[str, set[str]] = field(default_factory=dict)
    """Fault -> criteria violated with it but not by the rollout itself; empty if it was not found."""
    small: list[str] = field(default_factory=list)
    """Faults with too small a displacement to count."""


def policy_file(path: Path) -> Path | None:
    """Find the policy at a path: a file, or a folder that contains one; None if there is none."""
    if path.is_file():
        return path
    return next((path / name for name in NAMES if (path / name).is_file()), None)


def commands_on_axes() -> list[Command]:
    """Commands on the axes of the command ranges: vx -0.6 to 2.0 m/s, vy +-0.6 m/s, yaw +-1.5 rad/s."""
    axes: list[Command] = [(float(forward), 0.0, 0.0) for forward in np.arange(-0.6, 2.01, 0.2)]
    axes += [(0.0, lateral, 0.0) for lateral in (-0.6, -0.45, 0.45, 0.6)]
    return axes + [(0.0, 0.0, yaw) for yaw in (-1.5, -1.0, -0.5, 0.5, 1.0, 1.5)]


def drawn_commands(count: int, seed: int) -> list[Command]:
    """Draw commands uniformly from the whole box of the ranges."""
    rng = np.random.default_rng(seed)
    low, high = np.array([-0.6, -0.6, -1.5]), np.array([2.0, 0.6, 1.5])
    return [tuple(rng.uniform(low, high).tolist()) for _ in range(count)]


def walk(policy: Path, robot: Robot, command: Command) -> Rollout:
    """Roll out a policy with a constant command from rest, at the robot's torque limits."""
    if policy.name == PUBLISHED:
        return policy_walk(policy.parent, robot, command, SECONDS)
    one = deployed(ROBOT, load_policy(policy))
    plant = MujocoPlant(robot, MujocoOptions(timestep_s=TIMESTEP_S))
    motors = dataclasses.replace(one.motors(), envelope=TorqueEnvelope(limit=robot.torque_limit))
    return run(robot, plant, one.controller(), motors, steady_command(*command), SECONDS)


def judge(
    policy: Path,
    command: Command,
    seed: tuple[int, int],
    limits: FeasibilitySettings,
    planted: Collection[str] = tuple(FAULTS),
) -> Judged:
    """Evaluate a rollout at a command, unchanged and with each fault of `planted`."""
    robot, rng = load_robot("t1"), np.random.default_rng(seed)
    rollout = walk(policy, robot, command)
    if rollout.fell:
        return Judged(fell=True)
    clip = rollout.clip("walk", start_s=START_S)
    own = {kind: _judged(one, robot, limits) for kind, one in by_labels(clip, robot).items()}
    width = round(WINDOW_S * clip.fps)
    windows = [clip.cut(start, start + width, "window") for start in range(0, clip.frame_count - width + 1, width)]
    found = Judged(
        labelled=own[""][:2],
        unlabelled=own[NO_LABELS][0],
        told=own[TOLD_LABELS][0],
        windows=[_judged(window, robot, limits)[0] for window in windows],
        broken=set().union(*(broken for _, _, broken in own.values())),
    )
    if np.abs(command).max() >= STILL:
        _faults(clip, command, robot, rng, limits, found, planted)
    for fault, codes in found.found.items():
        kind = next((kind for kind in (NO_LABELS, TOLD_LABELS) if fault.endswith(kind)), "")
        found.found[fault] = codes - own[kind][2]
    return found


def by_labels(clip: RobotClip, robot: Robot) -> dict[str, RobotClip]:
    """The clip with its own contacts, without contacts, and with contacts inferred by KP2."""
    bare = dataclasses.replace(clip, contacts=None)
    told = dataclasses.replace(clip, contacts=label_robot_contacts(bare, robot))
    return {"": clip, NO_LABELS: bare, TOLD_LABELS: told}


def stands(clip: RobotClip) -> bool:
    """Whether a robot stands, by the definition of the database's skill balance."""
    velocity = command_velocity(clip.root_pos_w, clip.root_quat_w, clip.fps)
    speed = np.hypot(velocity.forward_m_s, velocity.lateral_m_s)
    return bool(speed < COMMANDS.standing_m_s and abs(velocity.yaw_rate_rad_s) < COMMANDS.standing_rad_s)


def _judged(clip: RobotClip, robot: Robot, limits: FeasibilitySettings) -> tuple[bool, float, set[str]]:
    """Whether a whole clip is accepted, the accepted share of its duration, and the violated criteria."""
    outcome = process(clip, {}, settings=limits, robot=robot)
    share = sum(piece.clip.frame_count for piece in outcome.pieces) / clip.frame_count
    codes = {reason.code for reason in outcome.reasons} - {"too_short"}
    return share == 1.0 and len(outcome.pieces) == 1, share, codes


def _faults(
    clip: RobotClip,
    command: Command,
    robot: Robot,
    rng: np.random.Generator,
    limits: FeasibilitySettings,
    found: Judged,
    names: Collection[str],
) -> None:
    """Plant each fault once and evaluate it with contact labels of every kind."""
    for name, fault in ((name, fault) for name, fault in FAULTS.items() if name in names):
        slow = name == "double speed" and command[0] < RUN_SPEED
        if slow or (name in (SWAPPED, LABELS) and stands(clip)):
            continue
        planted = fault.plant(clip, robot, rng)
        if not matters(name, clip, planted, robot):
            found.small.append(name)
            continue
        for kind, one in by_labels(planted, robot).items():
            if name != LABELS or not kind:
                found.found[name + kind] = _broken(one, robot, limits)


def _broken(clip: RobotClip, robot: Robot, limits: FeasibilitySettings) -> set[str]:
    """Criteria that the whole clip violates."""
    return {verdict.code for verdict in assess(motion_of(clip, robot, limits), limits).broken}
