"""The robot in MuJoCo as a plant: friction, armature, masses, terrain and a ball of one's choice."""

from __future__ import annotations

import copy
from dataclasses import dataclass

import mujoco
import numpy as np
from jaxtyping import Float

from pipeline import rotation
from pipeline.errors import UnknownNameError
from pipeline.robot import Robot
from pipeline.simulation.plant import NoBallError, PlantState
from pipeline.simulation.terrain import FlatGround, Ground

INTEGRATORS = {
    "euler": mujoco.mjtIntegrator.mjINT_EULER,
    "implicitfast": mujoco.mjtIntegrator.mjINT_IMPLICITFAST,
    "implicit": mujoco.mjtIntegrator.mjINT_IMPLICIT,
    "rk4": mujoco.mjtIntegrator.mjINT_RK4,
}
PARKED_W = np.array([0.0, 0.0, 50.0])
"""Where the ball waits [m]."""
BALL_DISTANCE = 0.6
"""From its centre to the root link's centre of mass when it is let go [m]: outside the arms."""


@dataclass(frozen=True, kw_only=True)
class Ball:
    """A ball that can be thrown at the robot. It flies straight: gravity does not act on it."""

    mass: float
    """[kg]"""
    radius: float
    """[m]"""


@dataclass(frozen=True, kw_only=True)
class MujocoOptions:
    """How the robot is simulated; what isn't given is the robot's own."""

    timestep_s: float = 0.002
    integrator: str = "euler"
    friction: float = 1.0
    """Sliding friction between all shapes."""
    armature: Float[np.ndarray, " j"] | None = None
    """[kg m^2]"""
    root_mass_factor: float = 1.0
    """Of mass and inertia of the root link."""
    ground: Ground | None = None
    """Flat where not given."""
    ball: Ball | None = None


class MujocoPlant:
    """See `Plant`; it also tells accelerations, and throws a ball where the options have one."""

    def __init__(self, robot: Robot, options: MujocoOptions | None = None):
        self.robot, self.options = robot, options or MujocoOptions()
        self.ground: Ground = self.options.ground or FlatGround()
        self.timestep_s = self.options.timestep_s
        self.model = _model(robot, self.options, self.ground)
        self.data = mujoco.MjData(self.model)
        joints = len(robot.joint_names)
        self._pushed = False
        self._qpos, self._qvel = slice(7, 7 + joints), slice(6, 6 + joints)
        self._feet = [int(self.model.site_bodyid[self.model.site(name).id]) for name in robot.feet]
        self._default = PlantState(
            root_pos_w=np.array([0.0, 0.0, robot.default_root_height + self.ground.height(0.0, 0.0)]),
            root_quat_w=rotation.IDENTITY.copy(),
            root_lin_vel_w=np.zeros(3),
            root_ang_vel_b=np.zeros(3),
            joint_pos=np.array(robot.default_joint_pos),
            joint_vel=np.zeros(joints),
        )
        self.reset()

    def reset(self, state: PlantState | None = None) -> None:
        data, state = self.data, state or self._default
        mujoco.mj_resetData(self.model, data)
        self._pushed = False
        data.qpos[:3], data.qpos[3:7], data.qpos[self._qpos] = state.root_pos_w, state.root_quat_w, state.joint_pos
        data.qvel[:3], data.qvel[3:6] = state.root_lin_vel_w, state.root_ang_vel_b
        data.qvel[self._qvel] = state.joint_vel
        self.remove_ball()
        mujoco.mj_forward(self.model, data)

    def state(self) -> PlantState:
        qpos, qvel = self.data.qpos.copy(), self.data.qvel.copy()
        return PlantState(
            root_pos_w=qpos[:3],
            root_quat_w=qpos[3:7],
            root_lin_vel_w=qvel[:3],
            root_ang_vel_b=qvel[3:6],
            joint_pos=qpos[self._qpos],
            joint_vel=qvel[self._qvel],
        )

    def step(self, torque: Float[np.ndarray, " j"], force_w: Float[np.ndarray, " 3"] | None = None) -> None:
        self.data.qfrc_applied[self._qvel] = torque
        if force_w is not None or self._pushed:
            self.data.xfrc_applied[1, :3] = 0.0 if force_w is None else force_w
            self._pushed = force_w is not None
        mujoco.mj_step(self.model, self.data)

    def foot_wrench_w(self) -> Float[np.ndarray, "2 6"]:
        """MuJoCo gives (moment, force) about the centre of mass of the whole robot."""
        model, data = self.model, self.data
        mujoco.mj_rnePostConstraint(model, data)
        wrench = data.cfrc_ext[self._feet]
        force, moment = wrench[:, 3:], wrench[:, :3]
        arm = data.subtree_com[model.body_rootid[self._feet]] - data.xpos[self._feet]
        return np.concatenate([force, moment + rotation.cross(arm, force)], axis=1)

    def saved(self) -> mujoco.MjData:
        """A copy of all that the next step depends on."""
        return copy.copy(self.data)

    def restore(self, saved: mujoco.MjData) -> None:
        """Back to what was saved; steps from there have the same bits."""
        mujoco.mj_copyData(self.data, self.model, saved)
        self._pushed = True  # what pushed it then is in the copy

    def kick(self, delta_v_w: Float[np.ndarray, " 3"]) -> None:
        self.data.qvel[:3] += delta_v_w

    def acceleration(self) -> Float[np.ndarray, " v"]:
        return self.data.qacc[: self._qvel.stop].copy()

    def throw(self, direction_w: Float[np.ndarray, " 3"], speed: float) -> None:
        """From `BALL_DISTANCE` before the root link's centre of mass, at its height and towards it."""
        if self.options.ball is None:
            raise NoBallError(self)
        self._place_ball(self.data.xipos[1] - BALL_DISTANCE * direction_w, speed * direction_w)

    def remove_ball(self) -> None:
        """Back to where it waits."""
        if self.options.ball is not None:
            self._place_ball(PARKED_W, np.zeros(3))

    def ball_velocity_w(self) -> Float[np.ndarray, " 3"]:
        """[m/s]"""
        return self.data.qvel[self._qvel.stop : self._qvel.stop + 3].copy()

    def _place_ball(self, pos_w: np.ndarray, lin_vel_w: np.ndarray) -> None:
        first, first_v = self._qpos.stop, self._qvel.stop
        self.data.qpos[first : first + 3], self.data.qpos[first + 3 :] = pos_w, rotation.IDENTITY
        self.data.qvel[first_v : first_v + 3], self.data.qvel[first_v + 3 :] = lin_vel_w, 0.0


def _model(robot: Robot, options: MujocoOptions, ground: Ground) -> mujoco.MjModel:
    if options.integrator not in INTEGRATORS:
        raise UnknownNameError("integrator", options.integrator, tuple(INTEGRATORS))
    spec = mujoco.MjSpec.from_string(robot.mjcf)
    spec.option.timestep, spec.option.integrator = options.timestep_s, INTEGRATORS[options.integrator]
    # a simulation that diverges would stand in the default pose again, and count as one that never fell
    spec.option.disableflags |= mujoco.mjtDisableBit.mjDSBL_AUTORESET
    ground.add_to(spec)
    if options.ball is not None:
        body = spec.worldbody.add_body(name="ball", pos=PARKED_W, gravcomp=1.0)
        body.add_freejoint()
        body.add_geom(type=mujoco.mjtGeom.mjGEOM_SPHERE, size=[options.ball.radius, 0.0, 0.0], mass=options.ball.mass)
    model = spec.compile()
    joints = len(robot.joint_names)
    model.geom_friction[:, 0] = options.friction
    if options.armature is not None:
        model.dof_armature[6 : 6 + joints] = options.armature
    model.body_mass[1] *= options.root_mass_factor
    model.body_inertia[1] *= options.root_mass_factor
    mujoco.mj_setConst(model, mujoco.MjData(model))
    return model
