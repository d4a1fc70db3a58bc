"""A robot that stands in MuJoCo, as a clip with all forces of its simulation."""

from __future__ import annotations

import numpy as np

from pipeline.clips.robot_clip import RobotClip, SimulatedForces
from pipeline.robot import Robot
from pipeline.simulation.mujoco_plant import MujocoOptions, MujocoPlant

FPS, STEPS = 50.0, 4
"""Rate of the clip [Hz] and physics steps in each of its frames."""
SETTLE_S = 0.5
"""Time before the first frame, in which the soles come to rest on the ground."""


def simulated_standing(
    robot: Robot, seconds: float = 2.0, push_w: tuple[float, float, float] = (0.0, 0.0, 0.0)
) -> RobotClip:
    """The default pose held by PD control with stiff ankles.

    Args:
        push_w: constant force on the root link [N], from the first frame on
    """
    plant = MujocoPlant(robot, MujocoOptions(timestep_s=1.0 / FPS / STEPS))
    stiff = np.array([4.0 if "Ankle" in name else 1.0 for name in robot.joint_names])
    frames, settling = round(seconds * FPS), round(SETTLE_S * FPS)
    root, quat, joints, torques, wrenches = [], [], [], [], []
    for frame in range(settling + frames):
        state = plant.state()
        force_w = np.array(push_w) if frame >= settling else None
        torque_steps, wrench_steps = [], []
        for _ in range(STEPS):
            now = plant.state()
            torque = stiff * (robot.kp * (robot.default_joint_pos - now.joint_pos) - robot.kd * now.joint_vel)
            torque = np.clip(torque, -robot.torque_limit, robot.torque_limit)
            plant.step(torque, force_w)
            torque_steps.append(torque)
            wrench_steps.append(plant.foot_wrench_w())
        if frame >= settling:
            root.append(state.root_pos_w)
            quat.append(state.root_quat_w)
            joints.append(state.joint_pos)
            torques.append(np.mean(torque_steps, axis=0))
            wrenches.append(np.mean(wrench_steps, axis=0))
    return RobotClip(
        name="test/simulated",
        fps=FPS,
        robot=robot.name,
        joint_names=robot.joint_names,
        root_pos_w=np.array(root),
        root_quat_w=np.array(quat),
        joint_pos=np.array(joints),
        contacts=np.array(wrenches)[:, :, 2] > 1.0,
        forces=SimulatedForces(
            joint_torque=np.array(torques),
            foot_wrench_w=np.array(wrenches),
            other_force_w=np.zeros((frames, 3)),
            push_w=np.tile(push_w, (frames, 1)),
        ),
    )
