"""Compare a project's PROTO and world with the robot that they were made from; list every deviation."""

from __future__ import annotations

import math
from collections.abc import Iterator
from pathlib import Path
from xml.etree import ElementTree as Xml

import numpy as np

from pipeline.errors import FileError
from pipeline.robot import Kinematics, Robot
from pipeline.simulation.armature_on_links import added_moments
from pipeline.webots.proto import ACCELEROMETER, CONTROLLER, GYRO, IMU_SITE, INERTIAL_UNIT, SENSOR_SUFFIX
from pipeline.webots.scene_model import SceneModel, read_scene
from pipeline.webots.stand_in.engine import start_poses

EXACT = 1e-9
"""Largest difference of numbers that are equal; they are written in full."""


def project_faults(world: Path, robot: Robot) -> tuple[str, ...]:
    """Every deviation of a world file's scene from the robot, as sentences."""
    try:
        scene = read_scene(world)
    except FileError as error:
        return (str(error),)
    checks = (_names(scene, robot), _motors(scene, robot), _masses(scene, robot), _poses(scene, robot), _world(scene))
    faults: list[str] = []
    for check in checks:
        faults += check
        if check is checks[0] and faults:
            break  # the other checks look up names
    return tuple(faults)


def _names(scene: SceneModel, robot: Robot) -> Iterator[str]:
    links = [body.name for body in scene.bodies[1:]]
    if links != list(robot.link_names[1:]):
        yield f"the solids are {', '.join(links)}, wanted are {', '.join(robot.link_names[1:])}"
    motors = [hinge.motor for _, hinge in scene.hinges]
    if sorted(motors) != sorted(robot.joint_names):
        yield f"the motors are {', '.join(motors)}, wanted are {', '.join(robot.joint_names)}"


def _motors(scene: SceneModel, robot: Robot) -> Iterator[str]:
    for _, hinge in scene.hinges:
        joint = robot.joint(hinge.motor)
        stops = hinge.stops or (0.0, 0.0)
        wanted = {
            "lower stop": (stops[0], max(robot.joint_lower[joint], -math.pi)),
            "upper stop": (stops[1], min(robot.joint_upper[joint], math.pi)),
            "maxTorque": (hinge.max_torque, robot.torque_limit[joint]),
            "maxVelocity": (hinge.max_velocity, robot.motor_speed_limit[joint]),
            "position": (hinge.position, robot.default_joint_pos[joint]),
        }
        for what, (got, bound) in wanted.items():
            if abs(got - bound) > EXACT:
                yield f"motor '{hinge.motor}': {what} is {got:g}, the robot's is {bound:g}"
        if hinge.sensor != hinge.motor + SENSOR_SUFFIX:
            yield f"motor '{hinge.motor}': its sensor is '{hinge.sensor}', wanted '{hinge.motor + SENSOR_SUFFIX}'"


def _masses(scene: SceneModel, robot: Robot) -> Iterator[str]:
    total = sum(body.mass for body in scene.bodies)
    if abs(total - robot.total_mass) > EXACT:
        yield f"the masses sum to {total:.6f} kg, the robot's to {robot.total_mass:.6f}"
    for link, (mass, com, moment) in inertials(robot).items():
        body = scene.bodies[robot.link(link)]
        if abs(body.mass - mass) > EXACT:
            yield f"solid '{link}': mass is {body.mass:g} kg, the robot's is {mass:g}"
        if np.abs(body.com - com).max() > EXACT:
            yield f"solid '{link}': centre of mass is {body.com.tolist()}, the robot's is {com.tolist()}"
        if np.abs(body.moment - moment).max() > EXACT:
            yield f"solid '{link}': inertia is not the link's with its rotor"
        if not body.shapes:
            yield f"solid '{link}': has no bounding object"


def inertials(robot: Robot) -> dict[str, tuple[float, np.ndarray, np.ndarray]]:
    """Mass, centre of mass and inertia with rotor of each link, from the robot's MJCF text."""
    added = added_moments(robot)
    found = {}
    for body in Xml.fromstring(robot.mjcf).iter("body"):
        inertial = body.find("inertial")
        if inertial is None:
            continue
        xx, yy, zz, xy, xz, yz = (float(each) for each in inertial.get("fullinertia", "").split())
        moment = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
        name = body.get("name", "")
        com = np.array([float(each) for each in inertial.get("pos", "").split()])
        found[name] = (float(inertial.get("mass", "nan")), com, moment + added.get(name, np.zeros((3, 3))))
    return found


def _poses(scene: SceneModel, robot: Robot) -> Iterator[str]:
    pos, quat = start_poses(scene)
    root, turn = np.array([[0.0, 0.0, robot.default_root_height]]), np.array([[1.0, 0.0, 0.0, 0.0]])
    poses = Kinematics(robot).forward(root, turn, robot.default_joint_pos[None])
    apart = np.linalg.norm(pos - poses.pos_w[0], axis=1)
    turned = 1.0 - np.abs((quat * poses.quat_w[0]).sum(axis=1))
    for index, link in enumerate(robot.link_names):
        if apart[index] > EXACT or turned[index] > EXACT:
            yield f"solid '{link}': stands {apart[index]:.2g} m from where the default pose has it, or is turned"


def _world(scene: SceneModel) -> Iterator[str]:
    if scene.contact.bounce != 0.0:
        yield f"contacts of robot and floor bounce ({scene.contact.bounce:g}), wanted 0"
    if scene.controller != CONTROLLER:
        yield f"the controller is '{scene.controller}', wanted '{CONTROLLER}'"
    wanted = {GYRO: "Gyro", INERTIAL_UNIT: "InertialUnit", ACCELEROMETER: "Accelerometer"}
    got = {name: kind for name, (kind, _) in scene.imu.items()}
    if got != wanted:
        yield f"the inertial sensors at site '{IMU_SITE}' are {got}, wanted {wanted}"
