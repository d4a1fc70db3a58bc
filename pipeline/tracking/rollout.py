"""Roll out one reference with the tracker in MuJoCo and record all forces."""

from collections.abc import Sequence
from dataclasses import dataclass

import mujoco
import numpy as np

from pipeline import rotation
from pipeline.clips.robot_clip import RobotClip, SimulatedForces
from pipeline.physics import GRAVITY, PHYSICS_S
from pipeline.robot import Robot
from pipeline.simulation.mujoco_plant import MujocoOptions, simulated_model
from pipeline.simulation.terrain import FlatGround
from pipeline.simulation.torque_envelope import PdControl, TorqueEnvelope
from pipeline.tracking.disturbance import NONE, Disturbance
from pipeline.tracking.reference import key_link_index, observe, reference_states
from pipeline.tracking.settings import FailureSettings
from pipeline.tracking.task import ACTION_SCALE, CONTROL_HZ, DECIMATION
from pipeline.tracking.tracker import Tracker

CONTACT_SHARE = 0.1
"""Mean vertical ground force over a control step, as a share of the weight, above which a foot is in contact; below it,
a foot merely brushes the ground in its swing."""


@dataclass(frozen=True, kw_only=True)
class Plant:
    """Simulated robot for rollouts."""

    robot: Robot
    envelope: TorqueEnvelope


@dataclass(frozen=True, kw_only=True)
class TrackedStretch:
    """Frames [start, stop) of a reference that a rollout followed."""

    start: int
    stop: int
    clip: RobotClip
    """The robot's motion at the same frames, with forces and contacts."""
    failed: str
    """Why the rollout ended before the reference; empty if it reached the end."""


def rollout(
    reference: RobotClip,
    plant: Plant,
    tracker: Tracker,
    failure: FailureSettings,
    disturbance: Disturbance = NONE,
    rng: np.random.Generator | None = None,
) -> tuple[TrackedStretch, ...]:
    """Track a 50 Hz reference to its end; after a failure, restart a little later on it.

    Args:
        reference: the motion to track
        plant: robot and motors
        tracker: the policy
        failure: limits at which tracking has failed
        disturbance: disturbance of the rollout
        rng: generator for start offset and action noise; required if the disturbance has any
    """
    world = _World(reference, plant, tracker, disturbance)
    stretches: list[TrackedStretch] = []
    start, last = 0, reference.frame_count - 1
    while start < last:
        stretch = world.follow(start, failure, rng)
        stretches.append(stretch)
        start = last if not stretch.failed else stretch.stop + round(failure.restart_s * CONTROL_HZ)
    return tuple(stretches)


class _World:
    """Model, state and buffers of the rollouts of one reference."""

    def __init__(self, reference: RobotClip, plant: Plant, tracker: Tracker, disturbance: Disturbance):
        robot = plant.robot
        self._clip, self._robot, self._tracker, self._disturbance = reference, robot, tracker, disturbance
        options = MujocoOptions(
            timestep_s=PHYSICS_S,
            integrator="implicitfast",
            friction=disturbance.friction,
            root_mass_factor=disturbance.trunk_mass,
        )
        self._model = simulated_model(robot, options, FlatGround())
        motion = (reference.root_pos_w, reference.root_quat_w, reference.joint_pos)
        self._reference = reference_states(self._model, *motion)
        self._data = mujoco.MjData(self._model)
        self._motors = PdControl(kp=disturbance.kp * robot.kp, kd=disturbance.kd * robot.kd, envelope=plant.envelope)
        self._links = 1 + key_link_index(robot.link_names, tracker.key_links)
        self._moved = np.array([robot.joint(name) for name in tracker.controlled])
        self._ends = self._model.site_bodyid[[self._model.site(name).id for name in (*robot.hands, *robot.feet)]]
        self._feet = self._ends[len(robot.hands) :].tolist()
        self._joints = len(robot.joint_names)

    def follow(self, start: int, failure: FailureSettings, rng: np.random.Generator | None) -> TrackedStretch:
        """Track from a frame of the reference to its end or to a failure."""
        last = self._clip.frame_count - 1
        record = _Record(last - start, self._joints, self._model.nbody, self._feet)
        self._place(start, rng)
        action = np.zeros(len(self._moved), dtype=np.float32)
        target = before = self._reference.joint_pos[start + 1]
        failed, frame = "", start
        while frame < last and not failed:
            action = self._act(frame + 1, action, rng)
            before, target = target, self._reference.joint_pos[frame + 1].copy()
            target[self._moved] += ACTION_SCALE * action
            record.state(self._data)
            self._step(frame - start, target, before if frame > start else target, record)
            frame += 1
            failed = self._failure(frame, failure)
        record.state(self._data)
        return TrackedStretch(start=start, stop=frame + 1, clip=self._recorded(record, start), failed=failed)

    def _place(self, frame: int, rng: np.random.Generator | None) -> None:
        """Set the state of a reference frame, with the disturbance's offset."""
        data, reference, joints = self._data, self._reference, self._joints
        mujoco.mj_resetData(self._model, data)
        data.qpos[:3], data.qpos[3:7] = reference.body_pos_w[frame, 0], reference.body_quat_w[frame, 0]
        data.qpos[7:] = reference.joint_pos[frame]
        data.qvel[:3] = reference.body_lin_vel_w[frame, 0]
        data.qvel[3:6] = rotation.rotate_inverse(reference.body_quat_w[frame, 0], reference.body_ang_vel_w[frame, 0])
        data.qvel[6 : 6 + joints] = reference.joint_vel[frame]
        if self._disturbance.start_offset and rng is not None:
            data.qpos[7 + self._moved] += self._disturbance.start_offset * rng.uniform(-1.0, 1.0, len(self._moved))
        data.qpos[7:] = np.clip(data.qpos[7:], self._robot.joint_lower, self._robot.joint_upper)
        mujoco.mj_kinematics(self._model, data)

    def _act(self, frame: int, last_action: np.ndarray, rng: np.random.Generator | None) -> np.ndarray:
        data = self._data
        mujoco.mj_kinematics(self._model, data)
        observation = observe(
            data.qpos,
            data.qvel,
            data.xpos[self._links],
            data.xmat[self._links],
            self._reference,
            frame,
            self._robot.default_joint_pos,
            last_action,
        )
        action = self._tracker.act(observation)
        if self._disturbance.action_noise and rng is not None:
            noise = self._disturbance.action_noise * rng.standard_normal(len(action))
            action = action + noise.astype(np.float32)
        return action

    def _step(self, tick: int, target: np.ndarray, before: np.ndarray, record: "_Record") -> None:
        """One control step: four physics steps with explicit motor torques."""
        data, model, motors, late = self._data, self._model, self._motors, self._disturbance.delay_steps
        push = self._push(tick / CONTROL_HZ)
        data.xfrc_applied[1, :3] = push
        for substep in range(DECIMATION):
            aim = target if substep >= late else before
            torque = motors.torque(aim, data.qpos[7:], data.qvel[6:])
            data.qfrc_applied[6:] = torque
            mujoco.mj_step(model, data)
            mujoco.mj_rnePostConstraint(model, data)
            record.forces(torque, data)
        record.end_of_step(push)

    def _push(self, time_s: float) -> np.ndarray:
        force = np.zeros(3)
        for push in self._disturbance.pushes:
            if push.start_s <= time_s < push.start_s + push.duration_s:
                force += push.force_w
        return force

    def _failure(self, frame: int, settings: FailureSettings) -> str:
        """Why tracking has failed at a frame, by the terminations of training; empty if it has not."""
        data, reference = self._data, self._reference
        if not np.isfinite(data.qpos).all():
            return "the simulation diverged"
        mujoco.mj_kinematics(self._model, data)
        height = abs(data.xpos[1, 2] - reference.body_pos_w[frame, 0, 2])
        if height > settings.root_height:
            return f"the root is {height:.2f} m off in height"
        w, x, y, z = reference.body_quat_w[frame, 0]
        up = w * w - x * x - y * y + z * z
        tilt = abs(data.xmat[1, 8] - up)
        if tilt > settings.gravity:
            return "the trunk has fallen"
        heights = reference.body_pos_w[frame, self._ends - 1, 2] - reference.body_pos_w[frame, 0, 2]
        off = np.abs((data.xpos[self._ends, 2] - data.xpos[1, 2]) - heights)
        worst = int(np.argmax(off))
        if off[worst] > settings.end_height:
            link = self._model.body(int(self._ends[worst])).name
            return f"{link} is {off[worst]:.2f} m off in height"
        away = float(np.linalg.norm(data.xpos[1] - reference.body_pos_w[frame, 0]))
        return f"the root is {away:.2f} m off the reference's path" if away > settings.path else ""

    def _recorded(self, record: "_Record", start: int) -> RobotClip:
        qpos = np.array(record.qpos)
        forces = record.as_forces()
        contacts = forces.foot_wrench_w[:, :, 2] > CONTACT_SHARE * GRAVITY * self._robot.total_mass
        poses = (qpos[:, :3], rotation.make_continuous(qpos[:, 3:7]), qpos[:, 7:])
        return self._robot.clip(self._clip.name, CONTROL_HZ, *poses, contacts=contacts, forces=forces)


class _Record:
    """Recorder of a rollout's states and forces."""

    def __init__(self, steps: int, joints: int, bodies: int, feet: Sequence[int]):
        self._feet = list(feet)
        self._contact, self._com, self._pos = np.zeros((bodies, 6)), np.zeros(3), np.zeros((bodies, 3))
        self.qpos: list[np.ndarray] = []
        self._torque = np.zeros((steps + 1, joints))
        self._wrench, self._other = np.zeros((steps + 1, 2, 6)), np.zeros((steps + 1, 3))
        self._push = np.zeros((steps + 1, 3))
        self._step = 0

    def state(self, data: mujoco.MjData) -> None:
        self.qpos.append(data.qpos.copy())

    def forces(self, torque: np.ndarray, data: mujoco.MjData) -> None:
        """Add one physics step's torques and contact forces; MuJoCo gives (moment, force) about the robot's centre of
        mass, pushes included."""
        self._torque[self._step] += torque
        self._contact += data.cfrc_ext
        self._com += data.subtree_com[1]
        self._pos += data.xpos

    def end_of_step(self, push: np.ndarray) -> None:
        """Store the means over the control step, also of the feet's lever arms, which change by millimetres."""
        step, contact = self._step, self._contact / DECIMATION
        force, arm = contact[self._feet, 3:], (self._com - self._pos[self._feet]) / DECIMATION
        self._torque[step] /= DECIMATION
        self._wrench[step, :, :3] = force
        self._wrench[step, :, 3:] = contact[self._feet, :3] + rotation.cross(arm, force)
        self._other[step] = contact[1:, 3:].sum(axis=0) - force.sum(axis=0) - push
        self._push[step] = push
        self._contact[:], self._com[:], self._pos[:] = 0.0, 0.0, 0.0
        self._step += 1

    def as_forces(self) -> SimulatedForces:
        """Forces of each frame; the last frame, which has no step, repeats the previous one."""
        rows = [*range(self._step), self._step - 1]
        return SimulatedForces(
            joint_torque=self._torque[rows],
            foot_wrench_w=self._wrench[rows],
            other_force_w=self._other[rows],
            push_w=self._push[rows],
        )
