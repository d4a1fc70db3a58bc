"""A trial as a rollout in MuJoCo."""

import dataclasses
import math
from collections.abc import Callable

import mujoco
import numpy as np

from pipeline import rotation
from pipeline.deployment import PolicyController
from pipeline.errors import UnknownNameError
from pipeline.robot import Kinematics
from pipeline.simulation import terrain
from pipeline.simulation.mujoco_plant import MujocoOptions, MujocoPlant
from pipeline.simulation.plant import PlantState
from pipeline.simulation.record import Rollout
from pipeline.simulation.run import run
from pipeline.simulation.sensors import NoisySensors
from pipeline.simulation.torque_envelope import PdControl
from pipeline.validation.deployed import Deployed
from pipeline.validation.trial import Conditions, GroundSpec, Start, Trial

TIMESTEP_S = 0.002
WRENCH_EVERY = 5
"""Contact forces are read at every fifth step (100 Hz)."""
BUMP_AT_M, BUMP_WIDTH_M = 1.5, 0.4
STONE_GAP_M = 0.04


class Worlds:
    """Plants by their conditions, each compiled once."""

    def __init__(self, one: Deployed):
        self.one = one
        self._plants: dict[tuple, MujocoPlant] = {}

    def plant(self, conditions: Conditions) -> MujocoPlant:
        key = (conditions.friction, conditions.root_mass_factor, conditions.ground, conditions.ball)
        if key not in self._plants:
            options = MujocoOptions(
                timestep_s=TIMESTEP_S,
                friction=conditions.friction,
                root_mass_factor=conditions.root_mass_factor,
                armature=self.one.armature,
                ground=ground_of(conditions.ground),
                ball=conditions.ball,
            )
            self._plants[key] = MujocoPlant(self.one.robot, options)
        return self._plants[key]


def walk(worlds: Worlds, trial: Trial, stop_on_fall: bool = True) -> Rollout:
    """The rollout of a trial; equal trials give equal bits."""
    return _run(worlds, trial, worlds.one.controller(), stop_on_fall=stop_on_fall)


class Branches:
    """Rollouts of trials that differ only in their event: the common part before it is simulated once.

    The rollout of such a trial begins with the control step of the event and is bit-identical to the complete rollout.
    Trials with the same prefix must be consecutive.
    """

    def __init__(self, worlds: Worlds):
        self.worlds = worlds
        self._key = ""
        self._saved: tuple[mujoco.MjData, PolicyController] | None = None

    def walk(self, trial: Trial) -> Rollout:
        """Like `walk` with `stop_on_fall`, reusing the prefix if it can be shared."""
        if not shares_prefix(trial):
            return walk(self.worlds, trial)
        plant, rate_hz = self.worlds.plant(trial.conditions), self.worlds.one.task.control_hz
        until_s = math.floor(trial.events[0].start_s * rate_hz + 1e-6) / rate_hz  # a rollout begins with a control step
        if prefix_of(trial) != self._key:
            controller = self.worlds.one.controller()
            prefix = dataclasses.replace(trial, events=(), seconds=until_s)
            fell = _run(self.worlds, prefix, controller, stop_on_fall=True).fell
            self._key, self._saved = prefix_of(trial), None if fell else (plant.saved(), controller)
        if self._saved is None:
            return walk(self.worlds, trial)
        plant.restore(self._saved[0])
        return _run(self.worlds, trial, self._saved[1].fork(), stop_on_fall=True, resume_s=until_s)


def shares_prefix(trial: Trial) -> bool:
    """Whether the part before the event can be shared: default start, no delay or noise, one event."""
    conditions = trial.conditions
    return trial.seed == 0 and conditions.noise is None and conditions.delay_s == 0.0 and len(trial.events) == 1


def prefix_of(trial: Trial) -> str:
    """Key of the part of a trial before its event; equal for trials that share it."""
    start_s = trial.events[0].start_s if trial.events else 0.0
    return repr((trial.conditions, trial.command, start_s, trial.seed))


def _run(
    worlds: Worlds, trial: Trial, controller: PolicyController, *, stop_on_fall: bool, resume_s: float | None = None
) -> Rollout:
    one, conditions = worlds.one, trial.conditions
    plant = worlds.plant(conditions)
    rng = np.random.default_rng(trial.seed)
    start = None if trial.seed == 0 else drawn_start(one, trial.start, plant.ground, rng)
    sensors = one.reads if conditions.noise is None else NoisySensors(conditions.noise, rng, one.reads)
    rate_hz, gains = one.task.control_hz, conditions.gain_factor
    commands = trial.command.sampled(rate_hz, trial.seconds)
    motors = PdControl(kp=gains * one.task.kp, kd=gains * one.task.kd, envelope=one.envelope)
    return run(
        one.robot,
        plant,
        controller,
        motors,
        lambda time_s: commands[round(time_s * rate_hz)],
        trial.seconds,
        trial.events,
        sensors=sensors,
        start=start,
        delay_s=conditions.delay_s,
        wrench_every=WRENCH_EVERY,
        ground_height=None if isinstance(plant.ground, terrain.FlatGround) else plant.ground.height,
        stop_on_fall=stop_on_fall,
        resume_s=resume_s,
    )


def drawn_start(one: Deployed, start: Start, ground: terrain.Ground, rng: np.random.Generator) -> PlantState:
    """A random state near the default pose on the ground, turned with its plane, with no sole corner below it."""
    robot, joints = one.robot, len(one.robot.joint_names)
    joint_pos = one.task.default_joint_pos + rng.uniform(-start.joint_pos, start.joint_pos, joints)
    joint_pos = np.clip(joint_pos, robot.joint_lower, robot.joint_upper)
    tilt = rng.uniform(-start.tilt, start.tilt, 2)
    roll, pitch = terrain.tilt_at_start(ground)
    quat = rotation.from_rotvec(np.array([tilt[0] + roll, tilt[1] + pitch, 0.0]))
    names = [name for foot in robot.sole_corners for name in foot]
    corners = Kinematics(robot).sites_of_pose(names, joint_pos, quat)
    height = max(ground.height(x, y) - z for x, y, z in corners.tolist())
    return PlantState(
        root_pos_w=np.array([0.0, 0.0, height]),
        root_quat_w=quat,
        root_lin_vel_w=rng.uniform(-start.lin_vel, start.lin_vel, 3) * np.array([1.0, 1.0, 0.0]),
        root_ang_vel_b=rng.uniform(-start.ang_vel, start.ang_vel, 3),
        joint_pos=joint_pos,
        joint_vel=rng.uniform(-start.joint_vel, start.joint_vel, joints),
    )


GROUNDS: dict[str, Callable[[float, np.random.Generator], terrain.Ground]] = {
    "slope": lambda size, _: terrain.Slope(angle_deg=size),
    "cross_slope": lambda size, _: terrain.CrossSlope(angle_deg=size),
    "bump": lambda size, _: terrain.Bump(at_m=BUMP_AT_M, rise_m=size, width_m=BUMP_WIDTH_M),
    "gravel": lambda size, rng: terrain.gravel(rng, step_m=size),
    "stones": lambda size, rng: terrain.stepping_stones(rng, gap_m=STONE_GAP_M, step_m=size),
    "rough": lambda size, rng: terrain.rough_ground(rng, amplitude_m=size),
}
"""Terrain of a size by kind; see `GroundSpec`."""


def ground_of(spec: GroundSpec | None) -> terrain.Ground:
    """The terrain of a specification. Raises UnknownNameError."""
    if spec is None:
        return terrain.FlatGround()
    if spec.kind not in GROUNDS:
        raise UnknownNameError("terrain", spec.kind, tuple(GROUNDS))
    return GROUNDS[spec.kind](spec.size, np.random.default_rng(spec.seed))
