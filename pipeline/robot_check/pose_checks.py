"""Checks of the default pose: soles on the ground, no self-collision, balance, sufficient gains."""

from collections.abc import Iterator
from pathlib import Path

import mujoco
import numpy as np
from scipy.spatial import ConvexHull

from pipeline.actuators.standing import read_standing_pose, stand
from pipeline.errors import FileError
from pipeline.physics import GRAVITY, PHYSICS_S
from pipeline.robot import Kinematics, Robot, mujoco_model
from pipeline.robot_check.body_checks import Finding
from pipeline.simulation.torque_envelope import TorqueEnvelope

LEVEL = 0.003
"""Largest height of a sole corner over the ground in the default pose [m]."""
SOLE = 0.003
"""Largest distance of the foot's lowest shape from its sole corners [m]."""
DEEP = 0.001
"""Least depth of an overlap that is reported [m]."""
BALANCE = 0.01
"""Least distance of the centre of mass from the edge of the support [m]."""
SAG = 0.2
"""Largest torque of a static stand over kp [rad]: how far the joint gives way."""
STANDING_S = 3.0
RANGE = (0.05, 6.4)
"""Least and largest range of a joint [rad]."""
SPEEDS = (1.0, 100.0)
"""Least and largest speed limit and motor speed [rad/s]."""
GROWTH = 1.001
"""Factor by which a disturbance may grow in one physics step."""
MARGIN = 0.9
"""Recommended share of the largest stable gain of a single joint, since coupled joints become unstable earlier."""


def default_pose(robot: Robot) -> Iterator[Finding]:
    """Soles off the ground, shapes that overlap, a centre of mass outside of the support."""
    model, data = _posed(robot)
    kinematics = Kinematics(robot)
    poses = kinematics.forward(data.qpos[None, :3], data.qpos[None, 3:7], data.qpos[None, 7:])
    corners = [name for foot in robot.sole_corners for name in foot]
    places = kinematics.site_pos_w(poses, corners)[0]
    for name, height in zip(corners, places[:, 2].tolist(), strict=True):
        if height > LEVEL:
            text = f"site '{name}' is {1000 * height:.1f} mm over the ground in the default pose"
            yield Finding(code="soles", text=f"{text}; at most {1000 * LEVEL:g} mm are expected.")
    yield from _foot_shapes(robot, model, data)
    yield from _contacts(robot, model, data)
    hull = ConvexHull(places[:, :2]).equations
    inside = -float((hull[:, :2] @ data.subtree_com[1][:2] + hull[:, 2]).max())
    if inside < BALANCE:
        x, y = data.subtree_com[1][:2]
        text = f"the centre of mass is at x = {x:.3f}, y = {y:.3f} m in the default pose, {inside:.3f} m inside the"
        yield Finding(code="balance", text=f"{text} soles; at least {BALANCE:g} m are expected.")


def _posed(robot: Robot) -> tuple[mujoco.MjModel, mujoco.MjData]:
    model = mujoco_model(robot, ground=True)
    data = mujoco.MjData(model)
    data.qpos[:7] = [0.0, 0.0, robot.default_root_height, 1.0, 0.0, 0.0, 0.0]
    data.qpos[7:] = robot.default_joint_pos
    mujoco.mj_forward(model, data)
    return model, data


def _foot_shapes(robot: Robot, model: mujoco.MjModel, data: mujoco.MjData) -> Iterator[Finding]:
    for sole in robot.feet:
        body = int(model.site(sole).bodyid[0])
        name = model.body(body).name
        geoms = [geom for geom in range(model.ngeom) if model.geom_bodyid[geom] == body and model.geom_contype[geom]]
        if not geoms:
            yield Finding(code="soles", text=f"link '{name}' has no collision shape to stand on (shapes.csv).")
            continue
        lowest = min(_lowest(model, data, geom) for geom in geoms) - float(data.site(sole).xpos[2])
        if abs(lowest) > SOLE:
            text = f"link '{name}': its lowest shape ends {1000 * lowest:+.1f} mm from the site '{sole}'"
            yield Finding(code="soles", text=f"{text}; {1000 * SOLE:g} mm are allowed (shapes.csv, sites.csv).")


def _lowest(model: mujoco.MjModel, data: mujoco.MjData, geom: int) -> float:
    """Height of a geom's lowest point [m]."""
    size, z_axes = model.geom_size[geom], data.geom_xmat[geom].reshape(3, 3)[2]
    kind, height = model.geom_type[geom], float(data.geom_xpos[geom][2])
    if kind == mujoco.mjtGeom.mjGEOM_BOX:
        return height - float(np.abs(z_axes) @ size)
    if kind == mujoco.mjtGeom.mjGEOM_SPHERE:
        return height - float(size[0])
    along = abs(float(z_axes[2])) * float(size[1])
    round_end = kind == mujoco.mjtGeom.mjGEOM_CAPSULE
    return height - along - float(size[0]) * (1.0 if round_end else float(np.hypot(z_axes[0], z_axes[1])))


def _contacts(robot: Robot, model: mujoco.MjModel, data: mujoco.MjData) -> Iterator[Finding]:
    feet = {int(model.site(name).bodyid[0]) for name in robot.feet}
    reported = set()
    for contact in data.contact[: data.ncon]:
        bodies = tuple(sorted(int(model.geom_bodyid[geom]) for geom in contact.geom))
        if contact.dist > -DEEP or bodies in reported or (bodies[0] == 0 and bodies[1] in feet):
            continue
        reported.add(bodies)
        names = [model.body(body).name for body in bodies]
        overlap = f"links '{names[0]}' and '{names[1]}' overlap"
        what = f"link '{names[1]}' is in the ground" if bodies[0] == 0 else overlap
        text = f"{what} by {-1000 * contact.dist:.1f} mm in the default pose"
        yield Finding(code="collision", text=f"{text} (shapes.csv, default_pos, contact_excludes).")


def drives(robot: Robot) -> Iterator[Finding]:
    """Joints whose range or speed is implausible, or whose motor and gain cannot carry the robot's weight."""
    for joint, name in enumerate(robot.joint_names):
        span = float(robot.joint_upper[joint] - robot.joint_lower[joint])
        if not RANGE[0] <= span <= RANGE[1]:
            text = f"joint '{name}' has a range of {span:.4g} rad"
            yield Finding(code="limits", text=f"{text}; {RANGE[0]:g} to {RANGE[1]:g} rad are expected (joints.csv).")
        speeds = {"speed limit": robot.retarget_speed_limit, "motor_speed": robot.motor_speed_limit}
        for what, speed in {what: float(values[joint]) for what, values in speeds.items()}.items():
            if not SPEEDS[0] <= speed <= SPEEDS[1]:
                text = f"joint '{name}' has a {what} of {speed:.4g} rad/s"
                yield Finding(code="limits", text=f"{text}; {SPEEDS[0]:g} to {SPEEDS[1]:g} are expected (joints.csv).")
    needed = np.abs(_standing_torque(robot))
    for joint, name in enumerate(robot.joint_names):
        limit, kp = float(robot.torque_limit[joint]), float(robot.kp[joint])
        if needed[joint] > limit:
            text = f"joint '{name}' needs {needed[joint]:.3g} N m in the default pose, its limit is {limit:g} N m"
            yield Finding(code="torque", text=f"{text} (joints.csv).")
        elif needed[joint] > SAG * kp:
            text = f"joint '{name}' gives way by {needed[joint] / kp:.2f} rad in the default pose"
            text += f" ({needed[joint]:.3g} N m): kp is {kp:g} N m/rad; at most {SAG:g} rad are expected."
            yield Finding(code="gains", text=text)


def step_stability(robot: Robot) -> Iterator[Finding]:
    """A joint that is unstable in simulation: gains too large for its inertia and the physics step of training.

    One step of v' = v - dt M^-1 (kp q + kd v), q' = q + dt v' around the default pose, off the ground, must not enlarge
    any disturbance. A single joint of inertia J is stable where kd dt / J + kp dt^2 / (2 J) < 2 (Jury's criterion).
    """
    model, data = _posed(robot)
    inverse = np.zeros((model.nv, model.nv))
    mujoco.mj_solveM(model, data, inverse, np.eye(model.nv))
    inverse = inverse[6:, 6:]
    stiff, damped = PHYSICS_S * inverse * robot.kp, PHYSICS_S * inverse * robot.kd
    eye = np.eye(len(robot.kp))
    speed = np.hstack([-stiff, eye - damped])
    step = np.vstack([np.hstack([eye, 0.0 * eye]) + PHYSICS_S * speed, speed])
    growth, shapes = np.linalg.eig(step)
    joints = sorted({int(np.abs(shapes[len(eye) :, each]).argmax()) for each in np.flatnonzero(abs(growth) > GROWTH)})
    for joint in joints:
        inertia, kp, kd = 1.0 / inverse[joint, joint], float(robot.kp[joint]), float(robot.kd[joint])
        text = f"joint '{robot.joint_names[joint]}' shakes in simulation: kp {kp:g} and kd {kd:g} are too large for its"
        text += f" inertia of {inertia:.2g} kg m^2 and a step of {1000 * PHYSICS_S:g} ms; lower"
        largest = min(MARGIN * (2.0 * inertia / PHYSICS_S - 0.5 * PHYSICS_S * kp), kd)
        lower = f"kd to {largest:.2g} N m s/rad"
        if largest <= 0.0 or largest == kd:  # kp alone is too large
            lower = f"kp below {MARGIN * 4.0 * inertia / PHYSICS_S**2:.2g} N m/rad and kd"
        yield Finding(code="gains", text=f"{text} {lower}, or correct the armature.")


def _standing_torque(robot: Robot) -> np.ndarray:
    """Torque of each joint in the default pose, the weight on both soles in equal parts [N m]."""
    model, data = _posed(robot)
    mujoco.mj_inverse(model, data)
    torque = data.qfrc_bias[6:].copy()
    jacobian = np.zeros((3, model.nv))
    for sole in robot.feet:
        site = model.site(sole)
        mujoco.mj_jac(model, data, jacobian, None, data.site(sole).xpos, int(site.bodyid[0]))
        torque -= jacobian[2, 6:] * 0.5 * robot.total_mass * GRAVITY
    return torque


def standing(folder: Path, robot: Robot) -> Iterator[Finding]:
    """A pose and gains of `standing.csv` with which the robot does not stand in simulation. The gains of joints.csv
    are for a policy that balances, so they are not tested."""
    try:
        pose = read_standing_pose(folder, robot)
    except FileError as error:
        yield Finding(code="standing", text=str(error))
        return
    if pose is None:
        return
    stood = stand(robot, pose, TorqueEnvelope(limit=robot.torque_limit), robot.armature, STANDING_S)
    if stood.fell:
        text = f"with the pose and gains of standing.csv the robot falls after {stood.seconds:.2f} s in simulation"
        yield Finding(code="standing", text=f"{text}; it should stand for {STANDING_S:g} s.")
