"""Trials of the virtual robot with a planted failure each, and sound ones: what the detectors are held against."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from pipeline.deployment import PolicyController, load_policy
from pipeline.deployment.policy import digest
from pipeline.hardware_logs.robot_log import LogFacts, RobotLog
from pipeline.robot import Robot
from pipeline.simulation.plant import Push
from pipeline.simulation.record import Rollout
from pipeline.validation.deployed import Deployed, deployed, with_ankle_kd
from pipeline.virtual_robot.deviations import Deviations, Outage
from pipeline.virtual_robot.scripted import Hold
from pipeline.virtual_robot.trial import VirtualTrial, simulate

SECONDS = 8.0
KNEES = ("Left_Knee_Pitch", "Right_Knee_Pitch")


@dataclass(frozen=True, kw_only=True)
class Planted:
    """A trial and what must be found in it."""

    name: str
    trial: VirtualTrial
    kind: str
    """`sound`, or the planted kind."""
    seed: int
    joint: str = ""
    direction: str = ""
    value: float = float("nan")
    """What was planted, where it has a number."""


def walker(policies: Path) -> Deployed:
    """The published policy on the nominal T1, deployed with the ankle damping that its makers use."""
    policy = load_policy(policies / "t1_walk.npz")
    return with_ankle_kd(deployed(Path(__file__).resolve().parents[2] / "robots" / "t1", policy), 2.0)


def walk(one: Deployed, planted: Planted, robot: Robot | None = None) -> tuple[Rollout, RobotLog]:
    """The rollout and the log of a planted trial."""
    facts = LogFacts(robot=one.robot.name, policy_digest=digest(one.policy), notes={"trial": planted.name})
    rng = np.random.default_rng([8, planted.seed])
    return simulate(robot or one.robot, PolicyController(one.task, one.policy), planted.trial, rng, facts)


def _trial(command: tuple[float, float, float], seconds: float = SECONDS, **more) -> VirtualTrial:
    forward, lateral, yaw = command
    return VirtualTrial(command=((0.5, forward, lateral, yaw),), seconds=seconds, **more)


def fall_at_speed(seed: int, rng: np.random.Generator) -> Planted:
    """Targets that come late trip it at speed."""
    late = Deviations(delay_s=float(rng.uniform(0.055, 0.08)))
    trial = _trial((float(rng.uniform(1.4, 2.0)), 0.0, 0.0), deviations=late)
    return Planted(name="fall forward at speed", trial=trial, kind="fall", direction="forward", seed=seed)


def pushed_sideways(seed: int, rng: np.random.Generator) -> Planted:
    """A push to the side that no policy stands."""
    side = 1.0 if seed % 2 else -1.0
    force = np.array([0.0, side * rng.uniform(750.0, 950.0), 0.0])
    push = Push(start_s=float(rng.uniform(3.5, 4.5)), duration_s=0.1, force_w=force)
    trial = _trial((float(rng.uniform(0.5, 1.0)), 0.0, 0.0), pushes=(push,))
    return Planted(
        name="sideways fall under push",
        trial=trial,
        kind="fall",
        seed=seed,
        direction="left" if side > 0.0 else "right",
    )


def slippery(seed: int, rng: np.random.Generator) -> Planted:
    """A ground with little friction."""
    ground = Deviations(friction=float(rng.uniform(0.1, 0.16)))
    trial = _trial((float(rng.uniform(0.9, 1.5)), 0.0, 0.0), deviations=ground)
    return Planted(name="slip on low friction", trial=trial, kind="slip", seed=seed)


def weak_knee(seed: int, rng: np.random.Generator) -> Planted:
    """A knee that gives less than it should."""
    joint, share = KNEES[seed % 2], float(rng.uniform(0.35, 0.55))
    trial = _trial((float(rng.uniform(1.2, 1.8)), 0.0, 0.0), deviations=Deviations(torque_scale={joint: share}))
    return Planted(name="knee saturation", trial=trial, kind="torque_saturation", seed=seed, joint=joint, value=share)


def fallen_knee(forward: float) -> Planted:
    """A left knee so weak that the walk ends on the ground."""
    share = 0.32
    trial = _trial((forward, 0.0, 0.0), seconds=6.0, deviations=Deviations(torque_scale={KNEES[0]: share}))
    seed = round(10.0 * forward)
    return Planted(name="fall by a weak knee", trial=trial, kind="fall", seed=seed, joint=KNEES[0], value=share)


def hot_motor(seed: int, rng: np.random.Generator) -> Planted:
    """A motor whose cooling failed."""
    joint = ("Left_Hip_Roll", "Right_Knee_Pitch", "Left_Ankle_Pitch", "Right_Hip_Pitch")[seed % 4]
    trial = _trial((float(rng.uniform(0.6, 1.5)), 0.0, 0.0), deviations=Deviations(hot={joint: 900.0}))
    return Planted(name="overheating", trial=trial, kind="overheating", seed=seed, joint=joint)


def lagging(seed: int, rng: np.random.Generator) -> Planted:
    """Less of the command reaches the controller than is logged."""
    command = ((1.2, 0.0, 0.0), (0.0, 0.6, 0.0), (0.0, 0.0, 1.3), (-0.6, 0.0, 0.0), (1.8, 0.0, 0.0))[seed % 5]
    told = Deviations(command_scale=float(rng.uniform(0.4, 0.6)))
    return Planted(name="tracking lag", trial=_trial(command, deviations=told), kind="tracking", seed=seed)


def taken_in_hand(seed: int, rng: np.random.Generator) -> Planted:
    """A person lifts it off its feet; in every second case it is laid down."""
    start = float(rng.uniform(3.0, 4.5))
    lay = 1.3 if seed % 2 else 0.0
    rise_s = 1.6 if lay else 0.8
    hold = Hold(start_s=start, stop_s=start + 2.5, tilt_rad=lay, lift=float(rng.uniform(0.04, 0.1)), rise_s=rise_s)
    return Planted(
        name="hand-held stop", trial=_trial((float(rng.uniform(0.4, 1.2)), 0.0, 0.0), hold=hold), kind="held", seed=seed
    )


def flickering(seed: int, rng: np.random.Generator) -> Planted:
    """All motors are off for a moment, as when their enable flickers; the robot sags or falls."""
    start, length = float(rng.uniform(3.0, 4.5)), float(rng.uniform(0.3, 0.6))
    trial = _trial((float(rng.uniform(0.5, 1.2)), 0.0, 0.0), outages=(Outage(start_s=start, stop_s=start + length),))
    return Planted(name="motor enable flickers", trial=trial, kind="motor_flicker", seed=seed, value=length)


def without_authority(seed: int, rng: np.random.Generator) -> Planted:
    """The motors of a leg give nothing from some time on."""
    side = ("Left", "Right")[seed % 2]
    joints = tuple(f"{side}_{name}" for name in ("Hip_Pitch", "Knee_Pitch", "Ankle_Pitch"))
    outage = Outage(start_s=float(rng.uniform(3.0, 4.5)), joints=joints)
    trial = _trial((float(rng.uniform(0.5, 1.2)), 0.0, 0.0), outages=(outage,))
    return Planted(name="loss of motor authority", trial=trial, kind="authority_loss", seed=seed)


def sound(seed: int, rng: np.random.Generator) -> Planted:
    """A command that the policy follows; it does not step below .35 m/s, so slow ones are to stand."""
    forward, lateral, yaw = (float(rng.uniform(*ends)) for ends in ((-0.6, 1.8), (-0.6, 0.6), (-1.2, 1.2)))
    shape = seed % 5
    if shape == 0:
        command = (float(rng.choice([-0.6, 0.6, 1.0, 1.5, 1.9])), 0.0, 0.0)
    elif shape == 1:
        command = (0.0, float(rng.choice([-0.6, 0.6])), 0.0)
    elif shape == 2:
        command = (0.0, 0.0, float(rng.choice([-1.3, -0.8, 0.8, 1.3])))
    elif shape == 3:
        command = (0.0, 0.0, 0.0)
    else:
        command = (forward if abs(forward) > 0.45 else 0.8, 0.3 * lateral, 0.5 * yaw)
    return Planted(name="sound", trial=_trial(command, seconds=7.0), kind="sound", seed=seed)


KINDS: tuple[Callable[[int, np.random.Generator], Planted], ...] = (
    fall_at_speed,
    pushed_sideways,
    slippery,
    weak_knee,
    hot_motor,
    lagging,
    taken_in_hand,
    flickering,
    without_authority,
)


def planted_trials(of_each: int, sound_ones: int, draw: int = 0) -> list[Planted]:
    """`of_each` trials of each kind, then the sound ones; the same for the same numbers, others for another draw."""
    makers = [maker for maker in KINDS for _ in range(of_each)] + [sound] * sound_ones
    counts: dict[str, int] = {}
    trials = []
    for maker in makers:
        seed = counts.get(maker.__name__, 0)
        counts[maker.__name__] = seed + 1
        rng = np.random.default_rng([17, len(maker.__name__), seed, *([draw] if draw else [])])
        trials.append(maker(seed + 1000 * draw, rng))
    return trials
