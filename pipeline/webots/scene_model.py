"""A project's PROTO and world, read back as bodies, hinges, devices and contacts.

The stand-ins simulate this model instead of the robot's tables, so an error in the PROTO shows in them.
"""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float

from pipeline import rotation
from pipeline.errors import FileError
from pipeline.webots.proto import SENSORS
from pipeline.webots.vrml import Node, Proto, Scene, VrmlError, from_text


@dataclass(frozen=True, kw_only=True)
class Primitive:
    """A bounding object in its body's frame: box (full sizes), sphere (radius), cylinder and capsule (radius, height
    without caps) along its z."""

    kind: str
    size: tuple[float, ...]
    pos: Float[np.ndarray, " 3"]
    quat: Float[np.ndarray, " 4"]


@dataclass(frozen=True, kw_only=True)
class Hinge:
    """The joint between a body and its parent, in the parent's frame."""

    anchor: Float[np.ndarray, " 3"]
    axis: Float[np.ndarray, " 3"]
    position: float
    """At the start [rad]."""
    stops: tuple[float, float] | None
    """[rad]; None if both fields are 0, which means no stops in Webots."""
    motor: str
    sensor: str
    max_torque: float
    """[N m]"""
    max_velocity: float
    """[rad/s]"""


@dataclass(frozen=True, kw_only=True)
class Body:
    """A solid with mass. Its pose is in the parent's frame, at the hinge's `position`."""

    name: str
    parent: int
    """Index; -1 for the robot itself."""
    pos: Float[np.ndarray, " 3"]
    quat: Float[np.ndarray, " 4"]
    mass: float
    com: Float[np.ndarray, " 3"]
    moment: Float[np.ndarray, "3 3"]
    """About the centre of mass, in the body's axes [kg m^2]."""
    shapes: tuple[Primitive, ...]
    hinge: Hinge | None


@dataclass(frozen=True, kw_only=True)
class SceneModel:
    """A world with one robot on a floor at z = 0. Bodies follow their parents, the root is first."""

    name: str
    controller: str
    timestep_ms: float
    gravity: float
    erp: float
    cfm: float
    friction: float
    """Contact properties of robot and floor, as those below."""
    bounce: float
    soft_erp: float
    soft_cfm: float
    bodies: tuple[Body, ...]
    imu: dict[str, tuple[str, Float[np.ndarray, " 3"]]]
    """Name of each inertial sensor of the root -> node type and position in the root's frame [m]."""
    self_collision: bool

    @property
    def hinges(self) -> tuple[tuple[int, Hinge], ...]:
        """Index of the moved body and its hinge, in the order of the file."""
        return tuple((index, body.hinge) for index, body in enumerate(self.bodies) if body.hinge is not None)


def read_scene(world: Path) -> SceneModel:
    """The model of a world file and the PROTO that it names. Raises FileError."""
    scene = _scene(world)
    protos = {proto.name: proto for path in scene.extern for proto in _scene(world.parent / path).protos}
    placed = [node for node in scene.nodes if node.kind in protos]
    if len(placed) != 1:
        raise FileError(world, f"has {len(placed)} robots of its PROTOs {', '.join(protos) or '(none)'}, expected one.")
    proto = protos[placed[0].kind]
    try:
        values = {name: placed[0].fields.get(name, default) for _, name, default in proto.interface}
        return _model(scene, proto, values)
    except (KeyError, IndexError, StopIteration, TypeError, ValueError) as error:
        raise FileError(world, f"lacks or misstates a field of its robot or WorldInfo ({error!r}).") from error


def _scene(path: Path) -> Scene:
    if not path.is_file():
        raise FileError(path, "there is no such file.", "Write the project with booster-lab webots-project.")
    try:
        return from_text(path.read_text(encoding="utf-8"))
    except VrmlError as error:
        raise FileError(path, str(error)) from error


def _model(scene: Scene, proto: Proto, values: dict[str, Any]) -> SceneModel:
    """The model of a scene with a PROTO, `values` of its interface by name."""
    info = next(node for node in scene.nodes if node.kind == "WorldInfo").fields
    own = proto.body.fields
    bodies: list[Body] = []
    _add(bodies, proto.body, -1, None, values)
    sensors = [node for node in own["children"] if node.kind in SENSORS]
    floor = next(node for node in scene.nodes if node.kind == "Solid" and node.all("Plane"))
    materials = {own["contactMaterial"], floor.fields["contactMaterial"]}
    pairs = [each.fields for each in info["contactProperties"]]
    contact = next(each for each in pairs if {each["material1"], each["material2"]} == materials)
    return SceneModel(
        name=values["name"],
        controller=values["controller"],
        timestep_ms=info["basicTimeStep"][0],
        gravity=info["gravity"][0],
        erp=info["ERP"][0],
        cfm=info["CFM"][0],
        friction=contact["coulombFriction"][0],
        bounce=contact["bounce"][0],
        soft_erp=contact["softERP"][0],
        soft_cfm=contact["softCFM"][0],
        bodies=tuple(bodies),
        imu={node.fields["name"]: (node.kind, np.array(node.fields["translation"])) for node in sensors},
        self_collision=own.get("selfCollision", False),
    )


def _add(bodies: list[Body], solid: Node, parent: int, joint: Node | None, values: dict[str, Any]) -> None:
    fields = solid.fields if joint else {**solid.fields, **{key: values[key] for key in ("translation", "rotation")}}
    physics = fields["physics"].fields
    i11, i22, i33, i12, i13, i23 = physics["inertiaMatrix"]
    index = len(bodies)
    bodies.append(
        Body(
            name=fields["name"] if joint else values["name"],
            parent=parent,
            pos=np.array(fields["translation"]),
            quat=_quat(fields["rotation"]),
            mass=physics["mass"][0],
            com=np.array(physics["centerOfMass"]),
            moment=np.array([[i11, i12, i13], [i12, i22, i23], [i13, i23, i33]]),
            shapes=tuple(_shapes(fields["boundingObject"])),
            hinge=None if joint is None else _hinge(joint),
        )
    )
    for child in fields["children"]:
        if child.kind == "HingeJoint":
            _add(bodies, child.fields["endPoint"], index, child, values)


def _hinge(joint: Node) -> Hinge:
    parameters = joint.fields["jointParameters"].fields
    motor, sensor = joint.fields["device"]
    low, high = parameters["minStop"][0], parameters["maxStop"][0]
    return Hinge(
        anchor=np.array(parameters["anchor"]),
        axis=np.array(parameters["axis"]),
        position=parameters["position"][0],
        stops=(low, high) if low or high else None,
        motor=motor.fields["name"],
        sensor=sensor.fields["name"],
        max_torque=motor.fields["maxTorque"][0],
        max_velocity=motor.fields["maxVelocity"][0],
    )


SIZES = {"Box": ("size",), "Sphere": ("radius",), **dict.fromkeys(("Cylinder", "Capsule"), ("radius", "height"))}
"""Fields with the sizes of a primitive."""


def _shapes(bound: Node) -> list[Primitive]:
    """Primitives of a Group, each with or without a Pose."""
    found = []
    for child in bound.fields["children"]:
        shape, pos, quat = child, np.zeros(3), rotation.IDENTITY.copy()
        if child.kind == "Pose":
            (shape,) = child.fields["children"]
            pos, quat = np.array(child.fields["translation"]), _quat(child.fields["rotation"])
        size = tuple(number for key in SIZES[shape.kind] for number in shape.fields[key])
        found.append(Primitive(kind=shape.kind.lower(), size=size, pos=pos, quat=quat))
    return found


def _quat(axis_angle: tuple[float, ...]) -> np.ndarray:
    return rotation.from_axis_angle(np.array(axis_angle[:3]), axis_angle[3])
