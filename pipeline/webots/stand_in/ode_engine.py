"""A scene in ODE, the engine that Webots is built on, through Debian's python3-pyode: upstream ODE, not Webots.

Contacts as in Webots: friction pyramid (ContactApprox1), softERP and softCFM of the ContactProperties, no bounce.
`World.step` is used, since the robot falls with `quickStep`.
"""

import importlib.machinery
import importlib.util
import os
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float

from pipeline import rotation
from pipeline.errors import PipelineError
from pipeline.webots.scene_model import Body, Primitive, SceneModel
from pipeline.webots.stand_in.mujoco_engine import RootMotion, start_poses

FOLDER_VARIABLE = "BOOSTER_LAB_ODE"
"""Environment variable with the folder of pyode's module, if it is not installed."""
DEBIAN_FOLDER = Path("/usr/lib/python3/dist-packages")
NOT_FOUND = "ode not found"


class OdeNotFoundError(PipelineError):
    """pyode can't be imported."""

    def __init__(self, why: str):
        super().__init__(f"{NOT_FOUND} ({why}); install Debian's python3-pyode, or run the mujoco stand-in.")


def load_ode() -> Any:
    """Load pyode: installed, from the folder `BOOSTER_LAB_ODE`, or Debian's. Raises OdeNotFoundError."""
    try:
        return _with_worlds(importlib.import_module("ode"))
    except ImportError as error:
        why = str(error)
    for folder in (os.environ.get(FOLDER_VARIABLE, ""), DEBIAN_FOLDER):
        spec = importlib.machinery.PathFinder.find_spec("ode", [str(folder)]) if folder else None
        if spec is None or spec.loader is None:
            continue
        try:
            module = importlib.util.module_from_spec(spec)
            spec.loader.exec_module(module)
            return _with_worlds(module)
        except ImportError as error:
            why = str(error)
    raise OdeNotFoundError(why)


def _with_worlds(module: Any) -> Any:
    """The module, if it is pyode and not a folder of the same name."""
    if not hasattr(module, "World"):
        raise ImportError("the installed module 'ode' is not pyode")
    return module


class OdeEngine:
    """The bodies of a scene in ODE; a body's origin there is its centre of mass."""

    def __init__(self, scene: SceneModel, ode: Any | None = None):
        self.scene, self.ode = scene, ode or load_ode()
        self.timestep_s = scene.timestep_ms / 1000.0
        self.world, self.space = self.ode.World(), self.ode.SimpleSpace()
        self.world.setGravity((0.0, 0.0, -scene.gravity))
        self.world.setERP(scene.erp)
        self.world.setCFM(scene.cfm)
        self.contacts = self.ode.JointGroup()
        self.floor = self.ode.GeomPlane(self.space, (0.0, 0.0, 1.0), 0.0)
        self.bodies: list[Any] = []
        self.geoms: list[Any] = []
        pos, quat = start_poses(scene)
        for index, body in enumerate(scene.bodies):
            self.bodies.append(self._body(body, pos[index], quat[index]))
        self.hinges = [self._hinge(index, pos, quat) for index, _ in scene.hinges]
        self.start = np.array([hinge.position for _, hinge in scene.hinges])

    def step(self, torque: Float[np.ndarray, " h"]) -> None:
        self.space.collide(None, self._touch)
        for hinge, value in zip(self.hinges, torque, strict=True):
            hinge.addTorque(float(value))
        self.world.step(self.timestep_s)
        self.contacts.empty()

    def joint_pos(self) -> Float[np.ndarray, " h"]:
        return self.start + np.array([hinge.getAngle() for hinge in self.hinges])

    def root(self) -> RootMotion:
        body, com = self.bodies[0], self.scene.bodies[0].com
        quat_w = np.array(body.getQuaternion())
        arm_w = rotation.rotate(quat_w, -com)
        turning = np.array(body.getAngularVel())
        return RootMotion(
            pos_w=np.array(body.getPosition()) + arm_w,
            quat_w=quat_w,
            lin_vel_w=np.array(body.getLinearVel()) + np.cross(turning, arm_w),
            ang_vel_w=turning,
        )

    def _body(self, body: Body, pos: np.ndarray, quat: np.ndarray) -> Any:
        made = self.ode.Body(self.world)
        mass, moment = self.ode.Mass(), body.moment
        six = (*moment.diagonal().tolist(), float(moment[0, 1]), float(moment[0, 2]), float(moment[1, 2]))
        mass.setParameters(body.mass, 0.0, 0.0, 0.0, *six)
        made.setMass(mass)
        made.setPosition(tuple((pos + rotation.rotate(quat, body.com)).tolist()))
        made.setQuaternion(tuple(quat.tolist()))
        for shape in body.shapes:
            geom = self._geom(shape)
            geom.setBody(made)
            geom.setOffsetPosition(tuple((shape.pos - body.com).tolist()))
            geom.setOffsetQuaternion(tuple(shape.quat.tolist()))
            self.geoms.append(geom)
        return made

    def _geom(self, shape: Primitive) -> Any:
        ode, space = self.ode, self.space
        if shape.kind == "box":
            return ode.GeomBox(space, shape.size)
        if shape.kind == "sphere":
            return ode.GeomSphere(space, shape.size[0])
        kind = ode.GeomCylinder if shape.kind == "cylinder" else ode.GeomCapsule
        return kind(space, *shape.size)

    def _hinge(self, index: int, pos: np.ndarray, quat: np.ndarray) -> Any:
        """Angles and stops are relative to the start."""
        body = self.scene.bodies[index]
        model = body.hinge
        assert model is not None
        hinge = self.ode.HingeJoint(self.world)
        hinge.attach(self.bodies[index], self.bodies[body.parent])
        anchor_w = pos[body.parent] + rotation.rotate(quat[body.parent], model.anchor)
        hinge.setAnchor(tuple(anchor_w.tolist()))
        hinge.setAxis(tuple(rotation.rotate(quat[body.parent], model.axis).tolist()))
        if model.stops is not None:
            low, high = (float(np.clip(stop - model.position, -np.pi, np.pi)) for stop in model.stops)
            hinge.setParam(self.ode.ParamLoStop, low)
            hinge.setParam(self.ode.ParamHiStop, high)
        return hinge

    def _touch(self, _: Any, one: Any, two: Any) -> None:
        """Add the contacts of two nearby shapes."""
        ode = self.ode
        first, second = one.getBody(), two.getBody()
        if first is second or (first and second and (not self.scene.self_collision or ode.areConnected(first, second))):
            return
        for contact in ode.collide(one, two):
            contact.setMode(ode.ContactSoftERP | ode.ContactSoftCFM | ode.ContactApprox1)
            contact.setMu(self.scene.friction)
            contact.setSoftERP(self.scene.soft_erp)
            contact.setSoftCFM(self.scene.soft_cfm)
            ode.ContactJoint(self.world, self.contacts, contact).attach(first, second)
