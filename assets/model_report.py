"""The evidence beside `robot_model`: do both model files say the same, and the joints as a table."""

from dataclasses import dataclass

import pandas as pd

from pipeline.robot import Robot


@dataclass(frozen=True, kw_only=True)
class Agreement:
    """Whether the models agree, and what was found."""

    holds: bool
    found: str


def models_agree(robot: Robot) -> Agreement:
    """Compile both model files with their own tools and compare mass and joints."""
    import mujoco
    import pinocchio

    mjcf = mujoco.MjModel.from_xml_string(robot.mjcf)
    urdf = pinocchio.buildModelFromXML(robot.urdf, pinocchio.JointModelFreeFlyer())
    masses = float(mjcf.body_subtreemass[0]), sum(inertia.mass for inertia in urdf.inertias)
    joints = {mjcf.joint(index).name for index in range(1, mjcf.njnt)}, set(urdf.names) - {"universe", "root_joint"}
    holds = abs(masses[0] - masses[1]) < 1e-6 and joints[0] == joints[1] == set(robot.joint_names)
    return Agreement(
        holds=holds, found=f"mass MJCF {masses[0]:.6f} kg, URDF {masses[1]:.6f} kg; {len(joints[0])} joints each"
    )


def joint_table(robot: Robot) -> pd.DataFrame:
    """One row a joint: limits, gains, armature. rad, rad/s, N m, kg m2."""
    columns = {
        "joint": robot.joint_names,
        "lower": robot.joint_lower,
        "upper": robot.joint_upper,
        "speed": robot.motor_speed_limit,
        "retarget speed": robot.retarget_speed_limit,
        "torque": robot.torque_limit,
        "armature": robot.armature,
        "kp": robot.kp,
        "kd": robot.kd,
        "default": robot.default_joint_pos,
    }
    return pd.DataFrame({name: list(values) for name, values in columns.items()})
