"""The robot in MuJoCo as a plant with given friction, armature, masses, terrain and a ball; depth of self-collisions.

For engines without armature (`put_armature_on_links`): an armature acts only on the joint's speed. The same inertia
about the joint axis on the child link acts on the link's absolute angular velocity, including its parent's: an
approximation that is good if parents rotate slowly. MuJoCo with this approximation is called the bridge: differences
between MuJoCo and the bridge come from the approximation, those between the bridge and another engine from contact and
solver.
"""

import copy
import functools
import threading
from dataclasses import dataclass

import mujoco
import numpy as np
from jaxtyping import Float

from pipeline import rotation
from pipeline.clips.robot_clip import RobotClip
from pipeline.errors import UnknownNameError
from pipeline.robot import Robot
from pipeline.simulation.plant import NoBallError, Plant, PlantState, standing_state
from pipeline.simulation.terrain import FlatGround, Ground

INTEGRATORS = {
    "euler": mujoco.mjtIntegrator.mjINT_EULER,
    "implicitfast": mujoco.mjtIntegrator.mjINT_IMPLICITFAST,
    "implicit": mujoco.mjtIntegrator.mjINT_IMPLICIT,
    "rk4": mujoco.mjtIntegrator.mjINT_RK4,
}
PARKED_W = np.array([0.0, 0.0, 50.0])
"""Position of the unused ball [m]."""
BALL_DISTANCE = 0.6
"""Initial distance of its centre to the root link's centre of mass [m], outside the arms' reach."""


@dataclass(frozen=True, kw_only=True)
class Ball:
    """A ball that can be thrown at the robot. It flies straight: gravity does not act on it."""

    mass: float
    """[kg]"""
    radius: float
    """[m]"""


@dataclass(frozen=True, kw_only=True)
class MujocoOptions:
    """Options of the simulation; by default the robot's own values."""

    timestep_s: float = 0.002
    integrator: str = "euler"
    friction: float = 1.0
    """Sliding friction between all shapes."""
    armature: Float[np.ndarray, " j"] | None = None
    """Armature of the joints [kg m^2]; None: the robot's."""
    root_mass_factor: float = 1.0
    """Factor on mass and inertia of the root link."""
    ground: Ground | None = None
    """Terrain; None: flat."""
    ball: Ball | None = None


class MujocoPlant(Plant):
    """See `Plant`; it also has accelerations, and throws a ball if the options have one."""

    def __init__(self, robot: Robot, options: MujocoOptions | None = None):
        self.robot, self.options = robot, options or MujocoOptions()
        self.ground: Ground = self.options.ground or FlatGround()
        self.timestep_s = self.options.timestep_s
        self.model = simulated_model(robot, self.options, self.ground)
        self.data = mujoco.MjData(self.model)
        joints = len(robot.joint_names)
        self._pushed = False
        self._qpos, self._qvel = slice(7, 7 + joints), slice(6, 6 + joints)
        self._feet = [int(self.model.site_bodyid[self.model.site(name).id]) for name in robot.feet]
        self._default = standing_state(robot, self.ground)
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
        """A copy of the complete simulation state."""
        return copy.copy(self.data)

    def restore(self, saved: mujoco.MjData) -> None:
        """Restore a saved state; subsequent steps are bit-identical."""
        mujoco.mj_copyData(self.data, self.model, saved)
        self._pushed = True  # the saved state includes applied forces

    def kick(self, delta_v_w: Float[np.ndarray, " 3"]) -> None:
        self.data.qvel[:3] += delta_v_w

    def acceleration(self) -> Float[np.ndarray, " v"]:
        return self.data.qacc[: self._qvel.stop].copy()

    def throw(self, direction_w: Float[np.ndarray, " 3"], speed: float) -> None:
        """Throw the ball at the root link's centre of mass, from `BALL_DISTANCE` before it and at its height."""
        if self.options.ball is None:
            raise NoBallError(self)
        self._place_ball(self.data.xipos[1] - BALL_DISTANCE * direction_w, speed * direction_w)

    def remove_ball(self) -> None:
        if self.options.ball is not None:
            self._place_ball(PARKED_W, np.zeros(3))

    def _place_ball(self, pos_w: np.ndarray, lin_vel_w: np.ndarray) -> None:
        first, first_v = self._qpos.stop, self._qvel.stop
        self.data.qpos[first : first + 3], self.data.qpos[first + 3 :] = pos_w, rotation.IDENTITY
        self.data.qvel[first_v : first_v + 3], self.data.qvel[first_v + 3 :] = lin_vel_w, 0.0


def simulated_model(robot: Robot, options: MujocoOptions, ground: Ground) -> mujoco.MjModel:
    """The robot on a ground, with the options. Raises UnknownNameError for an unknown integrator."""
    if options.integrator not in INTEGRATORS:
        raise UnknownNameError("integrator", options.integrator, tuple(INTEGRATORS))
    spec = mujoco.MjSpec.from_string(robot.mjcf)
    spec.option.timestep, spec.option.integrator = options.timestep_s, INTEGRATORS[options.integrator]
    # MuJoCo would reset a diverged simulation to the default pose, so that it would never count as a fall
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


@dataclass(frozen=True, kw_only=True)
class SelfCollision:
    """Deepest self-collision of each frame."""

    depth: Float[np.ndarray, " t"]
    """Depth of the overlap [m]; 0 without one."""
    pairs: tuple[tuple[str, str] | None, ...]
    """Names of the two shapes that overlap most; None where none do."""


def self_collision(clip: RobotClip, robot: Robot) -> SelfCollision:
    """Overlap of shapes of links that are not parent and child; without the ground."""
    model, data = _COLLISION.model(robot.mjcf)
    qpos = np.concatenate([clip.root_pos_w, clip.root_quat_w, clip.joint_pos], axis=1)
    depth = np.zeros(clip.frame_count)
    pairs: list[tuple[str, str] | None] = [None] * clip.frame_count
    state = data.qpos
    for frame in range(clip.frame_count):
        state[:] = qpos[frame]
        mujoco.mj_kinematics(model, data)
        mujoco.mj_collision(model, data)
        if data.ncon:
            worst = int(np.argmin(data.contact.dist))
            depth[frame] = max(-float(data.contact.dist[worst]), 0.0)
            shapes = data.contact.geom[worst]
            pairs[frame] = (model.geom(shapes[0]).name, model.geom(shapes[1]).name)
    return SelfCollision(depth=depth, pairs=tuple(pairs))


class _CollisionModels(threading.local):
    """Per-thread cache of read-only models and their data; creating them takes longer than a short clip."""

    def __init__(self) -> None:
        self.model = functools.lru_cache(maxsize=4)(_with_data)


def _with_data(mjcf: str) -> tuple[mujoco.MjModel, mujoco.MjData]:
    """The model without sites and visual shapes, which can not collide; a frame takes 0.75 of the time."""
    spec = mujoco.MjSpec.from_string(mjcf)
    for each in (*spec.sites, *(geom for geom in spec.geoms if not (geom.contype or geom.conaffinity))):
        spec.delete(each)
    model = spec.compile()
    return model, mujoco.MjData(model)


_COLLISION = _CollisionModels()


def added_moments(robot: Robot) -> dict[str, Float[np.ndarray, "3 3"]]:
    """Added inertia of each link with a joint: armature times axis axis^T [kg m^2], in the link frame.

    It is not a valid rigid-body inertia (only about one axis), and its sum with a small link's inertia may not be
    either: engines accept it, MuJoCo's compiler does not.
    """
    tree = robot.tree
    return {
        name: float(robot.armature[tree.joint[link]]) * np.outer(tree.axis[link], tree.axis[link])
        for link, name in enumerate(robot.link_names)
        if link
    }


def put_armature_on_links(model: mujoco.MjModel, robot: Robot) -> None:
    """Change a compiled MuJoCo model of the robot: joints without armature, its inertia on the links."""
    for name, moment in added_moments(robot).items():
        body = model.body(name)
        turn = rotation.to_matrix(np.array(body.iquat))
        principal, axes = np.linalg.eigh(turn @ np.diag(body.inertia) @ turn.T + moment)
        axes[:, 2] *= np.linalg.det(axes)
        body.inertia[:], body.iquat[:] = principal, rotation.from_matrix(axes)
    model.dof_armature[6 : 6 + len(robot.joint_names)] = 0.0
    mujoco.mj_setConst(model, mujoco.MjData(model))


def bridge_plant(robot: Robot, options: MujocoOptions) -> MujocoPlant:
    """The robot in MuJoCo, its armature on the links."""
    plant = MujocoPlant(robot, options)
    put_armature_on_links(plant.model, robot)
    plant.reset()
    return plant
