"""A robot as a DART skeleton: its URDF without visuals and sites, with rotor inertia on the driven links."""

from __future__ import annotations

from xml.etree import ElementTree as Xml

import dartpy as dart
import numpy as np

from pipeline.robot import Robot
from pipeline.simulation.armature_on_links import added_moments


def dart_skeleton(robot: Robot, friction: float) -> dart.dynamics.Skeleton:
    """Skeleton with a floating root. Self-collision is as in MuJoCo: not between parent and child.

    Joint position limits are enforced. Speed and torque limits are not: they are the motors' and applied before the
    plant.
    """
    loader = dart.utils.DartLoader()
    skeleton = loader.parseSkeletonString(dynamics_urdf(robot), dart.common.Uri(""))
    skeleton.enableSelfCollisionCheck()
    skeleton.disableAdjacentBodyCheck()
    for name in robot.joint_names:
        joint = skeleton.getJoint(name)
        joint.setLimitEnforcement(True)
        joint.setVelocityLowerLimit(0, -np.inf)
        joint.setVelocityUpperLimit(0, np.inf)
        joint.setForceLowerLimit(0, -np.inf)
        joint.setForceUpperLimit(0, np.inf)
    for name in robot.link_names:
        set_friction(skeleton.getBodyNode(name), friction)
    for name, moment in added_moments(robot).items():
        body = skeleton.getBodyNode(name)
        own = body.getInertia()
        body.setInertia(dart.dynamics.Inertia(own.getMass(), own.getLocalCOM(), own.getMoment() + moment))
    return skeleton


def ground_skeleton(friction: float) -> dart.dynamics.Skeleton:
    """A fixed box whose top is the plane z = 0."""
    thickness, side = 1.0, 400.0
    skeleton = dart.dynamics.Skeleton("ground")
    _, body = skeleton.createWeldJointAndBodyNodePair()
    node = body.createShapeNode(dart.dynamics.BoxShape([side, side, thickness]))
    node.setRelativeTranslation([0.0, 0.0, -thickness / 2.0])
    node.createCollisionAspect()
    node.createDynamicsAspect()
    set_friction(body, friction)
    return skeleton


def set_friction(body: dart.dynamics.BodyNode, friction: float) -> None:
    """Give all shapes of a body a coefficient of friction, and no bounce."""
    for index in range(body.getNumShapeNodes()):
        aspect = body.getShapeNode(index).getDynamicsAspect()
        aspect.setFrictionCoeff(friction)
        aspect.setRestitutionCoeff(0.0)


def dynamics_urdf(robot: Robot) -> str:
    """The URDF without visuals and without the massless links of sites, to which DART would assign a mass."""
    model = Xml.fromstring(robot.urdf)
    for element in list(model):
        site = element.tag == "link" and element.get("name") not in robot.link_names
        if site or (element.tag == "joint" and element.get("type") == "fixed"):
            model.remove(element)
        for visual in element.findall("visual"):
            element.remove(visual)
    return Xml.tostring(model, encoding="unicode")
