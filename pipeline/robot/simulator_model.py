"""The robot in MuJoCo."""

from __future__ import annotations

import mujoco

from pipeline.robot.robot import Robot


def mujoco_model(robot: Robot, ground: bool = False, timestep: float = 0.005) -> mujoco.MjModel:
    """The robot's MuJoCo model: armature in, no actuators.

    `qpos` is the root's position [m] and quaternion (wxyz), then the joints in the robot's order; body
    1 + i is link i.

    Args:
        robot: the robot
        ground: add a plane `ground` at z = 0
        timestep: of the simulation [s]
    """
    return compiled(robot.mjcf, ground, timestep)


def compiled(mjcf: str, ground: bool = False, timestep: float = 0.005) -> mujoco.MjModel:
    """The model of a robot's MJCF text; see `mujoco_model`."""
    spec = mujoco.MjSpec.from_string(mjcf)
    spec.option.timestep = timestep
    if ground:
        spec.worldbody.add_geom(name="ground", type=mujoco.mjtGeom.mjGEOM_PLANE, size=[0.0, 0.0, 0.05])
    return spec.compile()
