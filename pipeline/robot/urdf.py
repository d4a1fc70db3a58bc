"""The URDF of a robot, rendered from its tables: for inverse kinematics and rigid-body dynamics."""

from __future__ import annotations

from xml.etree import ElementTree as Xml

from pipeline.robot.description import Description
from pipeline.robot.mjcf import COMMENT, numbers, to_text
from pipeline.robot.tables import LinkRow, ShapeRow


def render_urdf(robot: Description) -> str:
    """URDF. Velocity limits are those of `retarget_speed_limit`; each site is a fixed child link of its name.

    A capsule becomes a cylinder and two spheres. URDF has no armature.
    """
    model = Xml.Element("robot", name=robot.name)
    model.append(Xml.Comment(f" {COMMENT} "))
    for name, colour in robot.config.colours.items():
        Xml.SubElement(Xml.SubElement(model, "material", name=name), "color", rgba=numbers([*colour, 1.0]))
    for row in robot.links:
        _link(model, robot, row)
    for row in robot.links[1:]:
        _joint(model, robot, row)
    for site in robot.sites:
        Xml.SubElement(model, "link", name=site.site)
        joint = Xml.SubElement(model, "joint", name=f"{site.site}_fixed", type="fixed")
        Xml.SubElement(joint, "origin", xyz=numbers(site.numbers("x", "y", "z")), rpy="0 0 0")
        Xml.SubElement(joint, "parent", link=site.link)
        Xml.SubElement(joint, "child", link=site.site)
    return to_text(model)


def _link(model: Xml.Element, robot: Description, row: LinkRow) -> None:
    link = Xml.SubElement(model, "link", name=row.link)
    inertial = Xml.SubElement(link, "inertial")
    Xml.SubElement(inertial, "origin", xyz=numbers(row.numbers("com_x", "com_y", "com_z")), rpy="0 0 0")
    Xml.SubElement(inertial, "mass", value=numbers([row.mass]))
    terms = ("ixx", "ixy", "ixz", "iyy", "iyz", "izz")
    Xml.SubElement(inertial, "inertia", {term: numbers(row.numbers(term)) for term in terms})
    shapes = [shape for shape in robot.shapes if shape.link == row.link]
    for element, unused in (("visual", "collision"), ("collision", "visual")):
        for shape in shapes:
            if shape.role != unused:
                _shape(link, element, shape)


def _joint(model: Xml.Element, robot: Description, row: LinkRow) -> None:
    limits = robot.joint_rows[row.joint]
    joint = Xml.SubElement(model, "joint", name=row.joint, type="revolute")
    xyz, rpy = row.numbers("x", "y", "z"), row.numbers("roll", "pitch", "yaw")
    Xml.SubElement(joint, "origin", xyz=numbers(xyz), rpy=numbers(rpy))
    Xml.SubElement(joint, "parent", link=row.parent)
    Xml.SubElement(joint, "child", link=row.link)
    Xml.SubElement(joint, "axis", xyz=numbers(row.numbers("axis_x", "axis_y", "axis_z")))
    Xml.SubElement(
        joint,
        "limit",
        lower=numbers([limits.lower]),
        upper=numbers([limits.upper]),
        effort=numbers([limits.torque]),
        velocity=numbers([limits.speed]),
    )


def _shape(link: Xml.Element, element: str, shape: ShapeRow) -> None:
    for suffix, kind, size, xyz in _parts(shape):
        part = Xml.SubElement(link, element, name=f"{shape.shape}{suffix}")
        Xml.SubElement(part, "origin", xyz=numbers(xyz), rpy=numbers(shape.numbers("roll", "pitch", "yaw")))
        geometry = Xml.SubElement(part, "geometry")
        if kind == "box":
            Xml.SubElement(geometry, "box", size=numbers([2.0 * half for half in size]))
        elif kind == "sphere":
            Xml.SubElement(geometry, "sphere", radius=numbers(size[:1]))
        else:
            Xml.SubElement(geometry, "cylinder", radius=numbers(size[:1]), length=numbers([2.0 * size[1]]))
        if element == "visual":
            Xml.SubElement(part, "material", name=shape.colour)


def _parts(shape: ShapeRow) -> list[tuple[str, str, tuple[float, ...], tuple[float, ...]]]:
    """(name suffix, kind, size, position) of the URDF primitives that a shape is made of."""
    centre = shape.numbers("x", "y", "z")
    if shape.kind != "capsule":
        return [("", shape.kind, shape.size, centre)]
    ends = [
        tuple(c + sign * shape.size_b * a for c, a in zip(centre, shape.long_axis, strict=True)) for sign in (1, -1)
    ]
    return [
        ("", "cylinder", shape.size, centre),
        ("_end_a", "sphere", shape.size[:1], ends[0]),
        ("_end_b", "sphere", shape.size[:1], ends[1]),
    ]
