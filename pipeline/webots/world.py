"""The world: a floor, contact properties, and one robot."""

from __future__ import annotations

from pipeline.errors import PipelineError
from pipeline.physics import GRAVITY
from pipeline.robot import Robot
from pipeline.webots.proto import MATERIAL, VERSION, proto_name
from pipeline.webots.vrml import Node, Scene

TIMESTEPS_MS = (1.0, 5.0)
"""Allowed `basicTimeStep` [ms]: 1 as in Booster's own world, 5 as in training."""
FLOOR = "floor"
ERP, CFM = 0.2, 1e-5
SOFT_ERP, SOFT_CFM = 0.2, 1e-3
"""Webots' defaults, stated explicitly: error reduction and softness of a contact."""


class TimestepError(PipelineError):
    """A timestep that is not supported."""

    def __init__(self, timestep_ms: float):
        allowed = " or ".join(f"{each:g}" for each in TIMESTEPS_MS)
        super().__init__(f"a basicTimeStep of {timestep_ms:g} ms is not offered; choose {allowed} ms.")


def robot_world(robot: Robot, timestep_ms: float = 5.0, friction: float = 1.0) -> Scene:
    """The world file, in `worlds/` beside `protos/`. Contacts don't bounce, and bodies at rest stay simulated."""
    if timestep_ms not in TIMESTEPS_MS:
        raise TimestepError(timestep_ms)
    contact = {
        "coulombFriction": [friction],
        "bounce": (0.0,),
        "bounceVelocity": (0.0,),
        "softERP": (SOFT_ERP,),
        "softCFM": (SOFT_CFM,),
    }
    pairs = ((MATERIAL, FLOOR), (MATERIAL, MATERIAL))
    contacts = [
        Node(kind="ContactProperties", fields={"material1": one, "material2": two, **contact}) for one, two in pairs
    ]
    info = {
        "title": f"Booster Lab: {robot.name}",
        "gravity": (GRAVITY,),
        "CFM": (CFM,),
        "ERP": (ERP,),
        "basicTimeStep": (timestep_ms,),
        "physicsDisableLinearThreshold": (0.0,),
        "physicsDisableAngularThreshold": (0.0,),
        "coordinateSystem": "ENU",
        "contactProperties": contacts,
    }
    view = {"orientation": (0.0, 1.0, 0.0, 0.12), "position": (-3.5, 0.0, 1.2), "follow": robot.name}
    nodes = (
        Node(kind="WorldInfo", fields=info),
        Node(kind="Viewpoint", fields=view),
        Node(kind="Background", fields={"skyColor": [0.7, 0.8, 0.9]}),
        Node(kind="DirectionalLight", fields={"direction": (-0.4, 0.3, -1.0)}),
        _floor(),
        Node(kind=proto_name(robot), name="ROBOT"),
    )
    extern = (f"../protos/{proto_name(robot)}.proto",)
    return Scene(version=VERSION, extern=extern, protos=(), nodes=nodes)


def _floor() -> Node:
    appearance = Node(kind="PBRAppearance", fields={"baseColor": (0.5, 0.5, 0.5), "roughness": (1.0,)})
    plane = Node(kind="Plane", fields={"size": (100.0, 100.0)})
    shape = Node(kind="Shape", fields={"appearance": appearance, "geometry": plane})
    fields = {"children": [shape], "name": FLOOR, "contactMaterial": FLOOR, "boundingObject": plane}
    return Node(kind="Solid", fields=fields)
