"""The robot as a Webots PROTO, from the tables of its folder: links, hinges, motors, sensors, primitives, masses.

Webots has no armature, so rotor inertia is added to the driven links. Joint limits are mechanical stops, which Webots
accepts between -pi and pi. Motors are driven by torque, limited by `maxTorque`; `maxVelocity` acts in position control
only.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from pipeline import rotation
from pipeline.robot import Robot
from pipeline.robot.description import Description
from pipeline.robot.tables import LinkRow, ShapeRow
from pipeline.simulation.mujoco_plant import added_moments
from pipeline.webots.vrml import Is, Node, Proto, Scene

VERSION = "R2023b"
"""The release whose node types are used; later ones read its files."""
CONTROLLER = "booster_lab"
IMU_SITE = "imu"
GYRO, INERTIAL_UNIT, ACCELEROMETER = "imu_gyro", "imu_orientation", "imu_accelerometer"
SENSOR_SUFFIX = "_sensor"
MATERIAL = "robot"
"""Contact material of all links."""
SPECK = 0.001
"""Radius [m] of the sphere in links without collision shapes: Webots requires a bounding object for a mass."""


def proto_name(robot: Robot) -> str:
    return f"Booster{robot.name.upper()}"


def robot_proto(source: Description, robot: Robot) -> Scene:
    """The PROTO file of a robot."""
    interface = (
        ("SFVec3f", "translation", (0.0, 0.0, robot.default_root_height)),
        ("SFRotation", "rotation", (0.0, 0.0, 1.0, 0.0)),
        ("SFString", "name", robot.name),
        ("SFString", "controller", CONTROLLER),
        ("SFBool", "supervisor", True),
    )
    body = _Writer(source, robot).root()
    proto = Proto(name=proto_name(robot), interface=interface, body=body)
    return Scene(version=VERSION, extern=(), protos=(proto,), nodes=())


class _Writer:
    def __init__(self, source: Description, robot: Robot):
        self.source, self.robot, self.added = source, robot, added_moments(robot)

    def root(self) -> Node:
        row = self.source.links[0]
        own = {name: Is(name) for name in ("translation", "rotation", "name", "controller", "supervisor")}
        return Node(
            kind="Robot",
            fields={
                **own,
                "children": [*self.sensors(row), *self.children(row)],
                "contactMaterial": MATERIAL,
                **self.body(row),
                "selfCollision": True,
            },
        )

    def sensors(self, row: LinkRow) -> list[Node]:
        """The IMU's sensors, if its site is on this link."""
        sites = [site for site in self.source.sites if site.site == IMU_SITE and site.link == row.link]
        kinds = {"Gyro": GYRO, "InertialUnit": INERTIAL_UNIT, "Accelerometer": ACCELEROMETER}
        return [
            Node(kind=kind, fields={"translation": site.numbers("x", "y", "z"), "name": name})
            for site in sites
            for kind, name in kinds.items()
        ]

    def children(self, row: LinkRow) -> list[Node]:
        looks = [_placed(shape, [self.look(shape)]) for shape in self.shapes(row, "collision")]
        return looks + [self.hinge(child) for child in self.source.children(row.link)]

    def hinge(self, row: LinkRow) -> Node:
        robot, joint = self.robot, self.source.joint_rows[row.joint]
        link = robot.link(row.link)
        axis = rotation.rotate(robot.tree.quat[link], robot.tree.axis[link])
        turned = rotation.from_axis_angle(robot.tree.axis[link], joint.default_pos)
        at = tuple(robot.tree.pos[link].tolist())
        parameters = {
            "position": (joint.default_pos,),
            "axis": tuple(axis.tolist()),
            "anchor": at,
            "minStop": (max(joint.lower, -math.pi),),
            "maxStop": (min(joint.upper, math.pi),),
        }
        motor = {"name": row.joint, "maxVelocity": (joint.motor_speed,), "maxTorque": (joint.torque,)}
        solid = {
            "translation": at,
            "rotation": axis_angle(rotation.multiply(robot.tree.quat[link], turned)),
            "children": [*self.sensors(row), *self.children(row)],
            "name": row.link,
            "contactMaterial": MATERIAL,
            **self.body(row),
        }
        sensor = Node(kind="PositionSensor", fields={"name": row.joint + SENSOR_SUFFIX})
        return Node(
            kind="HingeJoint",
            fields={
                "jointParameters": Node(kind="HingeJointParameters", fields=parameters),
                "device": [Node(kind="RotationalMotor", fields=motor), sensor],
                "endPoint": Node(kind="Solid", fields=solid),
            },
        )

    def body(self, row: LinkRow) -> dict[str, Any]:
        """Bounding object and mass of a link."""
        shapes = [_placed(shape, [_geometry(shape)]) for shape in self.shapes(row, "visual")]
        bounds = shapes or [Node(kind="Sphere", fields={"radius": (SPECK,)})]
        xx, xy, xz, yy, yz, zz = row.numbers("ixx", "ixy", "ixz", "iyy", "iyz", "izz")
        moment = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]) + self.added.get(row.link, np.zeros((3, 3)))
        six = moment[[0, 1, 2, 0, 0, 1], [0, 1, 2, 1, 2, 2]]
        physics = {
            "density": (-1.0,),
            "mass": (row.mass,),
            "centerOfMass": list(row.numbers("com_x", "com_y", "com_z")),
            "inertiaMatrix": six.tolist(),
        }
        return {
            "boundingObject": Node(kind="Group", fields={"children": bounds}),
            "physics": Node(kind="Physics", fields=physics),
        }

    def shapes(self, row: LinkRow, unwanted: str) -> list[ShapeRow]:
        return [shape for shape in self.source.shapes if shape.link == row.link and shape.role != unwanted]

    def look(self, shape: ShapeRow) -> Node:
        colour = self.source.config.colours[shape.colour]
        appearance = {"baseColor": colour, "roughness": (0.8,), "metalness": (0.0,)}
        fields = {"appearance": Node(kind="PBRAppearance", fields=appearance), "geometry": _geometry(shape)}
        return Node(kind="Shape", fields=fields)


def _placed(shape: ShapeRow, children: list[Node]) -> Node:
    quat = _quat(shape.numbers("roll", "pitch", "yaw"))
    place = {"translation": shape.numbers("x", "y", "z"), "rotation": axis_angle(quat), "children": children}
    return Node(kind="Pose", fields=place)


def _geometry(shape: ShapeRow) -> Node:
    if shape.kind == "box":
        return Node(kind="Box", fields={"size": tuple(2.0 * half for half in shape.size)})
    if shape.kind == "sphere":
        return Node(kind="Sphere", fields={"radius": shape.size})
    radius, half = shape.size
    return Node(kind=shape.kind.capitalize(), fields={"height": (2.0 * half,), "radius": (radius,)})


def _quat(roll_pitch_yaw: tuple[float, ...]) -> np.ndarray:
    """Quaternion of rotations about the fixed x, y, z axes, as in URDF."""
    turns = [rotation.from_axis_angle(axis, angle) for axis, angle in zip(np.eye(3), roll_pitch_yaw, strict=True)]
    return rotation.multiply(turns[2], rotation.multiply(turns[1], turns[0]))


def axis_angle(quat: np.ndarray) -> tuple[float, ...]:
    """A quaternion (wxyz) as Webots' rotation: unit axis and angle [rad]."""
    turn = rotation.to_rotvec(quat)
    angle = float(np.linalg.norm(turn))
    if angle < 1e-12:
        return (0.0, 0.0, 1.0, 0.0)
    return (*(turn / angle).tolist(), angle)
