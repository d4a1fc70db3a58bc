"""A scripted motion and a simulated robot that tracks it: a pair of reference and rollout, made by physics."""

from __future__ import annotations

import numpy as np

from pipeline.clips.robot_clip import RobotClip
from pipeline.deployment.controller import Reading
from pipeline.deployment.task import DeploymentTask, deployment_task
from pipeline.robot import Robot
from pipeline.simulation.mujoco_plant import MujocoOptions, MujocoPlant
from pipeline.simulation.plant import Event
from pipeline.simulation.record import Rollout
from pipeline.simulation.run import run
from pipeline.simulation.torque_envelope import PdControl, TorqueEnvelope
from tests.factories.policy_walks import steady_command
from tests.factories.robot_clips import standing


def waving(robot: Robot, seconds: float = 4.0) -> RobotClip:
    """Both feet stay, the head nods and both arms swing by .5 rad, once in 2 s, from rest."""
    clip = standing(robot, seconds, name="test/wave")
    times_s = np.arange(clip.frame_count) / clip.fps
    swing = 0.25 * (1.0 - np.cos(np.pi * times_s))
    joints = clip.joint_pos.copy()
    signs = {"Left_Shoulder_Pitch": -1.0, "Right_Shoulder_Pitch": -1.0, "Head_pitch": 1.0}
    for joint, name in enumerate(robot.joint_names):
        joints[:, joint] += signs.get(name.removeprefix("A"), 0.0) * swing
    return RobotClip(**{**vars(clip), "joint_pos": joints})


class Follower:
    """A controller that gives the reference's joints as targets, one frame a control step."""

    def __init__(self, task: DeploymentTask, reference: RobotClip):
        self.task, self._reference = task, reference
        self.reset()

    def reset(self) -> None:
        self._frame = 0

    def targets(self, reading: Reading, command: np.ndarray) -> np.ndarray:
        target = self._reference.joint_pos[min(self._frame, self._reference.frame_count - 1)]
        self._frame += 1
        return target


def tracked(robot: Robot, reference: RobotClip, ankles: float = 4.0, events: tuple[Event, ...] = ()) -> Rollout:
    """The robot in MuJoCo with the reference's joints as the targets of its motors, nothing else balances it.

    With ankles `ankles` times as stiff as the robot's own it stands; with its own it falls after a second or two.
    """
    stiff = np.array([ankles if "Ankle" in name else 1.0 for name in robot.joint_names])
    kp, kd = robot.kp * stiff, robot.kd * stiff
    control = PdControl(kp=kp, kd=kd, envelope=TorqueEnvelope(limit=robot.torque_limit))
    plant = MujocoPlant(robot, MujocoOptions(timestep_s=0.005))
    follower = Follower(deployment_task(robot, kp, kd), reference)
    return run(robot, plant, follower, control, steady_command(0.0, 0.0, 0.0), reference.duration_s, events)
