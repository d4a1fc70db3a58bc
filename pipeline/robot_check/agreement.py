"""Check that a robot's MJCF and URDF describe the same robot, with MuJoCo and Pinocchio."""

import mujoco

from pipeline.robot import Robot


def models_agree(robot: Robot) -> tuple[bool, str]:
    """Compile the MJCF with MuJoCo and the URDF with Pinocchio; compare mass (to 1e-6 kg) and joint names.

    Returns whether they agree, and a text on the result.
    """
    import pinocchio

    mjcf = mujoco.MjModel.from_xml_string(robot.mjcf)
    urdf = pinocchio.buildModelFromXML(robot.urdf, pinocchio.JointModelFreeFlyer())
    masses = float(mjcf.body_subtreemass[0]), sum(inertia.mass for inertia in urdf.inertias)
    joints = {mjcf.joint(index).name for index in range(1, mjcf.njnt)}, set(urdf.names) - {"universe", "root_joint"}
    holds = abs(masses[0] - masses[1]) < 1e-6 and joints[0] == joints[1] == set(robot.joint_names)
    return holds, f"mass MJCF {masses[0]:.6f} kg, URDF {masses[1]:.6f} kg; {len(joints[0])} joints each"
