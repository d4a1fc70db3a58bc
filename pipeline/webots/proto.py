"""The robot as a Webots PROTO, from the tables of its folder: links, hinges, motors, sensors, primitives, masses.

Webots has no armature, so rotor inertia is added to the driven links. Joint limits are mechanical stops, which Webots
accepts between -pi and pi. Motors are driven by torque, limited by `maxTorque`; `maxVelocity` acts in position control
only.
"""

import math

import numpy as np

from pipeline import rotation
from pipeline.robot import Robot
from pipeline.robot.description import Description
from pipeline.robot.tables import LinkRow, ShapeRow
from pipeline.simulation.mujoco_plant import added_moments
from pipeline.webots.vrml import Is, Node, Proto, Scene, node

VERSION = "R2023b"
"""Release of the node types; later releases can read the files."""
CONTROLLER = "booster_lab"
IMU_SITE = "imu"
SENSORS = {"Gyro": "imu_gyro", "InertialUnit": "imu_orientation", "Accelerometer": "imu_accelerometer"}
"""Names of the inertial sensors, by node type."""
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
        children = [*self.sensors(row), *self.children(row)]
        return node("Robot", **own, children=children, contactMaterial=MATERIAL, **self.body(row), selfCollision=True)

    def sensors(self, row: LinkRow) -> list[Node]:
        """The IMU's sensors, if its site is on this link."""
        return [
            node(kind, translation=site.numbers("x", "y", "z"), name=name)
            for site in self.source.sites
            if site.site == IMU_SITE and site.link == row.link
            for kind, name in SENSORS.items()
        ]

    def children(self, row: LinkRow) -> list[Node]:
        looks = [_placed(shape, self.look(shape)) for shape in self.shapes(row, "collision")]
        return looks + [self.hinge(child) for child in self.source.children(row.link)]

    def hinge(self, row: LinkRow) -> Node:
        tree, joint = self.robot.tree, self.source.joint_rows[row.joint]
        link = self.robot.link(row.link)
        axis = rotation.rotate(tree.quat[link], tree.axis[link])
        turned = rotation.from_axis_angle(tree.axis[link], joint.default_pos)
        at = tuple(tree.pos[link].tolist())
        parameters = node(
            "HingeJointParameters",
            position=(joint.default_pos,),
            axis=tuple(axis.tolist()),
            anchor=at,
            minStop=(max(joint.lower, -math.pi),),
            maxStop=(min(joint.upper, math.pi),),
        )
        motor = node("RotationalMotor", name=row.joint, maxVelocity=(joint.motor_speed,), maxTorque=(joint.torque,))
        solid = node(
            "Solid",
            translation=at,
            rotation=axis_angle(rotation.multiply(tree.quat[link], turned)),
            children=[*self.sensors(row), *self.children(row)],
            name=row.link,
            contactMaterial=MATERIAL,
            **self.body(row),
        )
        sensor = node("PositionSensor", name=row.joint + SENSOR_SUFFIX)
        return node("HingeJoint", jointParameters=parameters, device=[motor, sensor], endPoint=solid)

    def body(self, row: LinkRow) -> dict[str, Node]:
        """Bounding object and mass of a link."""
        shapes = [_placed(shape, _geometry(shape)) for shape in self.shapes(row, "visual")]
        moment = row.inertia + self.added.get(row.link, np.zeros((3, 3)))
        physics = node(
            "Physics",
            density=(-1.0,),
            mass=(row.mass,),
            centerOfMass=list(row.numbers("com_x", "com_y", "com_z")),
            inertiaMatrix=moment[[0, 1, 2, 0, 0, 1], [0, 1, 2, 1, 2, 2]].tolist(),
        )
        bounds = node("Group", children=shapes or [node("Sphere", radius=(SPECK,))])
        return {"boundingObject": bounds, "physics": physics}

    def shapes(self, row: LinkRow, unwanted: str) -> list[ShapeRow]:
        return [shape for shape in self.source.shapes if shape.link == row.link and shape.role != unwanted]

    def look(self, shape: ShapeRow) -> Node:
        colour = self.source.config.colours[shape.colour]
        appearance = node("PBRAppearance", baseColor=colour, roughness=(0.8,), metalness=(0.0,))
        return node("Shape", appearance=appearance, geometry=_geometry(shape))


def _placed(shape: ShapeRow, child: Node) -> Node:
    """A node at the pose of a shape. The angles are about the fixed x, y, z axes, as in URDF."""
    angles = zip(np.eye(3), shape.numbers("roll", "pitch", "yaw"), strict=True)
    roll, pitch, yaw = (rotation.from_axis_angle(axis, angle) for axis, angle in angles)
    turn = axis_angle(rotation.multiply(yaw, rotation.multiply(pitch, roll)))
    return node("Pose", translation=shape.numbers("x", "y", "z"), rotation=turn, children=[child])


def _geometry(shape: ShapeRow) -> Node:
    if shape.kind == "box":
        return node("Box", size=tuple(2.0 * half for half in shape.size))
    if shape.kind == "sphere":
        return node("Sphere", radius=shape.size)
    radius, half = shape.size
    return node(shape.kind.capitalize(), height=(2.0 * half,), radius=(radius,))


def axis_angle(quat: np.ndarray) -> tuple[float, ...]:
    """A quaternion (wxyz) as Webots' rotation: unit axis and angle [rad]."""
    turn = rotation.to_rotvec(quat)
    angle = float(np.linalg.norm(turn))
    if angle < 1e-12:
        return (0.0, 0.0, 1.0, 0.0)
    return (*(turn / angle).tolist(), angle)
