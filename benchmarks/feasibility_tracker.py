"""A reference followed in MuJoCo by a robot that is helped at its root with what the reference lacks, and no more.

No controller of the project tracks a reference, and one that does would bend it. Here every step (5 ms) asks what
forces the motion needs, drawn back to the reference by critically damped springs, and which admissible contact forces
supply it with all motors within their limits (`pipeline.simulation.contact_wrench`). The motors give their part of it;
what is missing at the root is given from outside. A robot that is `held` to the help another one got has that, give
or take what still counts as explained by contact forces: what its motors lack shows as a body that goes elsewhere.
"""

from __future__ import annotations

from dataclasses import dataclass

import mujoco
import numpy as np
from jaxtyping import Bool, Float

from pipeline import rotation, time_series
from pipeline.feasibility.motion import Motion
from pipeline.feasibility.torque_settings import TorqueSettings
from pipeline.robot import Kinematics, Robot, mujoco_model
from pipeline.simulation.contact_wrench import GRAVITY, solve_contacts
from pipeline.simulation.inverse_dynamics import MotionForces, StateSeries, states
from pipeline.simulation.mujoco_plant import MujocoOptions, MujocoPlant

STEP_S = 0.005
MORE_FORCE, MORE_LEVER_M = 0.05, 0.01
"""How much more help than it was held with a weak robot may take: force over the weight, and lever [m]."""
PULL_HZ = 3.0
"""Natural frequency of the springs; at 2 and 5 Hz more references are lost, at 3 none of 57."""
LIMITS_FIRST = 10.0
"""Cost of torque past a limit against the root: the motors keep to their limits."""
FELL_M = 0.2
"""Height of the root below which nothing is followed any more."""


@dataclass(frozen=True, kw_only=True)
class Followed:
    """What came of following a reference, at each step."""

    qpos: Float[np.ndarray, "t q"]
    """NaN from where it fell on."""
    torque: Float[np.ndarray, "t j"]
    """[N m]"""
    help_w: Float[np.ndarray, "t 6"]
    """Force [N] and moment about the ground below the root [N m], world frame."""
    reference_qpos: Float[np.ndarray, "t q"]
    contacts: Bool[np.ndarray, "t 2"]
    """The reference's."""

    @property
    def fell(self) -> bool:
        return not bool(np.isfinite(self.qpos).all())


def follow(motion: Motion, settings: TorqueSettings, held: Followed | None = None) -> Followed:
    """The motion followed by its robot, whose torque limits are kept; `held` is another's run of the same motion."""
    robot = motion.robot
    aim = _aim(motion, settings.cutoff_hz)
    count = len(aim.qpos)
    frame = np.minimum((np.arange(count) * STEP_S * motion.clip.fps + 0.5).astype(int), motion.clip.frame_count - 1)
    contacts = motion.contacts[frame]
    may_bear = _widened(contacts, round(1.0 / motion.clip.fps / STEP_S))
    plant = MujocoPlant(robot, MujocoOptions(timestep_s=STEP_S, friction=settings.friction))
    supply = _Supply(robot, settings)
    data = plant.data
    data.qpos[:], data.qvel[:] = aim.qpos[0], aim.qvel[0]
    mujoco.mj_forward(plant.model, data)
    qpos, torque, help_w = (
        np.full_like(aim.qpos, np.nan),
        np.zeros((count, len(robot.joint_names))),
        np.zeros((count, 6)),
    )
    for step in range(count):
        if not np.isfinite(data.qpos).all() or data.qpos[2] < FELL_M:
            break
        qpos[step] = data.qpos
        torque[step], help_w[step] = supply(data, _wanted(data, aim, step), may_bear[step])
        if held is not None:
            help_w[step] = _near(help_w[step], held.help_w[step], robot)
        _push(data, help_w[step])
        plant.step(torque[step])
    return Followed(qpos=qpos, torque=torque, help_w=help_w, reference_qpos=aim.qpos, contacts=contacts)


def moved(robot: Robot, one: Float[np.ndarray, "t q"], other: Float[np.ndarray, "t q"]) -> Float[np.ndarray, " t"]:
    """Distance [m] of the body that is furthest away from where it is in the other run; infinite after a fall."""
    found = np.full(len(one), np.inf)
    both = np.isfinite(one).all(axis=1) & np.isfinite(other).all(axis=1)
    here, there = (_bodies_w(robot, qpos[both]) for qpos in (one, other))
    found[both] = np.linalg.norm(here - there, axis=2).max(axis=1)
    return found


def _bodies_w(robot: Robot, qpos: np.ndarray) -> Float[np.ndarray, "t l 3"]:
    return Kinematics(robot).forward(qpos[:, :3], qpos[:, 3:7], qpos[:, 7:]).pos_w


def _aim(motion: Motion, cutoff_hz: float) -> StateSeries:
    """The reference's states at the steps of the simulation."""
    clip = motion.clip
    series = states(clip.root_pos_w, clip.root_quat_w, clip.joint_pos, clip.fps, cutoff_hz)
    times_s = np.arange(int((clip.frame_count - 1) / clip.fps / STEP_S) + 1) * STEP_S
    qpos = np.concatenate(
        [
            time_series.resample_cubic(series.qpos[:, :3], clip.fps, times_s),
            time_series.resample_quat_cubic(series.qpos[:, 3:7], clip.fps, times_s),
            time_series.resample_cubic(series.qpos[:, 7:], clip.fps, times_s),
        ],
        axis=1,
    )
    frames_s = np.arange(clip.frame_count) / clip.fps
    qvel, qacc = (
        np.stack([np.interp(times_s, frames_s, column) for column in values.T], axis=1)
        for values in (series.qvel, series.qacc)
    )
    return StateSeries(qpos=qpos, qvel=qvel, qacc=qacc)


def _widened(contacts: Bool[np.ndarray, "t 2"], steps: int) -> Bool[np.ndarray, "t 2"]:
    """Contacts with a frame about each, as an acceleration at the frames' rate is over three of them."""
    wide = contacts.copy()
    for away in range(1, steps + 1):
        wide[away:] |= contacts[:-away]
        wide[:-away] |= contacts[away:]
    return wide


def _wanted(data: mujoco.MjData, aim: StateSeries, step: int) -> Float[np.ndarray, " v"]:
    """Acceleration of the reference, drawn back to it."""
    turn = rotation.to_rotvec(rotation.multiply(rotation.conjugate(data.qpos[3:7]), aim.qpos[step, 3:7]))
    away = np.concatenate([aim.qpos[step, :3] - data.qpos[:3], turn, aim.qpos[step, 7:] - data.qpos[7:]])
    rate = 2.0 * np.pi * PULL_HZ
    return aim.qacc[step] + rate**2 * away + 2.0 * rate * (aim.qvel[step] - data.qvel)


class _Supply:
    """What motors and ground give for an acceleration that is wanted."""

    def __init__(self, robot: Robot, settings: TorqueSettings):
        self._robot, self._settings = robot, settings
        self._model = mujoco_model(robot)
        self._model.opt.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_CONSTRAINT)
        self._data = mujoco.MjData(self._model)
        self._corners = [self._model.site(name).id for foot in robot.sole_corners for name in foot]

    def __call__(
        self, data: mujoco.MjData, qacc: Float[np.ndarray, " v"], may_bear: Bool[np.ndarray, " 2"]
    ) -> tuple[Float[np.ndarray, " j"], Float[np.ndarray, " 6"]]:
        """Torque of the motors, within their limits, and what is missing at the root."""
        robot, settings = self._robot, self._settings
        forces = self._forces(data, qacc)
        corners_w = self._data.site_xpos[self._corners].reshape(1, 2, 4, 3)
        found = solve_contacts(
            robot,
            forces,
            data.qpos[None, :3].copy(),
            corners_w,
            may_bear[None, :, None] & (corners_w[..., 2] < settings.touch_height),
            friction=settings.friction,
            excess_weight=LIMITS_FIRST,
            heading=rotation.yaw_of(data.qpos[None, 3:7].copy()),
        )
        return np.clip(found.joint_torque[0], -robot.torque_limit, robot.torque_limit), found.residual_w[0]

    def _forces(self, data: mujoco.MjData, qacc: np.ndarray) -> MotionForces:
        """As `motion_forces`, of one state and with the model at hand."""
        own = self._data
        own.qpos[:], own.qvel[:], own.qacc[:] = data.qpos, data.qvel, qacc
        mujoco.mj_inverse(self._model, own)
        force = own.qfrc_inverse
        moment_w = rotation.rotate(own.qpos[3:7].copy(), force[3:6])
        return MotionForces(
            root_wrench_w=np.concatenate([force[:3], moment_w])[None],
            joint_torque=force[None, 6:].copy(),
            joint_axis_w=own.xaxis[None, 1:].copy(),
            joint_anchor_w=own.xanchor[None, 1:].copy(),
        )


def _near(help_w: np.ndarray, held_w: np.ndarray, robot: Robot) -> Float[np.ndarray, " 6"]:
    """The help that is asked for, no further from what is held than MORE_FORCE and MORE_LEVER_M."""
    weight = robot.total_mass * GRAVITY
    more = help_w - held_w
    for part, most in ((slice(3), MORE_FORCE), (slice(3, 6), MORE_LEVER_M)):
        more[part] *= min(1.0, most * weight / max(float(np.linalg.norm(more[part])), 1e-9))
    return held_w + more


def _push(data: mujoco.MjData, help_w: np.ndarray) -> None:
    """Apply a wrench about the ground below the root to the root link."""
    arm = data.qpos[:3] * np.array([1.0, 1.0, 0.0]) - data.xipos[1]
    data.xfrc_applied[1, :3] = help_w[:3]
    data.xfrc_applied[1, 3:] = help_w[3:] + np.cross(arm, help_w[:3])
