"""URDF for placo: the robot's URDF reduced to what the solver's tasks need, which makes a solve faster."""

from xml.etree import ElementTree as Xml

import numpy as np
from scipy.spatial.transform import Rotation

from pipeline.errors import PipelineError
from pipeline.robot import Robot

FRAME = "_link_frame"
"""Suffix of frames that are added to the URDF."""


def frame_on(robot: Robot, link: str) -> str:
    """Name of a link's frame that differs from all joint names (placo searches both with one name)."""
    return f"{link}{FRAME}" if link in robot.joint_names else link


def solver_urdf(robot: Robot) -> str:
    """The reduced URDF: without sites, with uncontrolled joints fixed at their default angle, and with an additional
    frame for each link that has the name of a joint."""
    root = Xml.fromstring(robot.urdf)
    for link in root.findall("link"):
        if link.get("name") in robot.site_names:
            root.remove(link)
    for joint in root.findall("joint[@type='fixed']"):
        child = joint.find("child")
        if child is not None and child.get("link") in robot.site_names:
            root.remove(joint)
    for name in set(robot.joint_names) - set(robot.controlled):
        _fix(root, name, float(robot.default_joint_pos[robot.joint(name)]))
    for link in robot.link_names:
        if link in robot.joint_names:
            Xml.SubElement(root, "link", name=f"{link}{FRAME}")
            joint = Xml.SubElement(root, "joint", name=f"{link}{FRAME}_fixed", type="fixed")
            Xml.SubElement(joint, "parent", link=link)
            Xml.SubElement(joint, "child", link=f"{link}{FRAME}")
    return Xml.tostring(root, encoding="unicode")


def _fix(urdf: Xml.Element, name: str, angle: float) -> None:
    """Replace a hinge of a URDF by a fixed joint at `angle` [rad]. Raises PipelineError if it has no origin or axis."""
    joint, origin, axis = (urdf.find(f"joint[@name='{name}']{below}") for below in ("", "/origin", "/axis"))
    if joint is None or origin is None or axis is None:
        raise PipelineError(f"the URDF has no joint '{name}' with an origin and an axis, so it can't be fixed.")
    rpy, axis_b = (np.array(text.split(), float) for text in (origin.attrib["rpy"], axis.attrib["xyz"]))
    turned = Rotation.from_euler("xyz", rpy) * Rotation.from_rotvec(angle * axis_b)
    origin.set("rpy", " ".join(map(str, turned.as_euler("xyz"))))
    joint.set("type", "fixed")
