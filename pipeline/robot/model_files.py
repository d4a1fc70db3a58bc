"""The MJCF and the URDF of a robot, rendered from its tables.

MJCF: bodies, joints, shapes, sites, for simulation. URDF: for inverse kinematics and rigid-body dynamics.
"""

from __future__ import annotations

from collections.abc import Iterable
from xml.etree import ElementTree as Xml

from pipeline.robot.description import Description
from pipeline.robot.tables import LinkRow, ShapeRow, SiteRow


def numbers(values: Iterable[float]) -> str:
    """Numbers separated by spaces, exact, without a negative zero."""
    return " ".join(repr(float(value) + 0.0).removesuffix(".0") for value in values)


def to_text(root: Xml.Element) -> str:
    """The element as an indented document that ends with a newline."""
    Xml.indent(root, space="  ")
    return Xml.tostring(root, encoding="unicode") + "\n"


COMMENT = "Rendered from the tables beside it by `python -m pipeline.robot.render`. Do not edit."


def render_mjcf(robot: Description, root_height: float) -> str:
    """MJCF with the root link `root_height` [m] above the origin, so that the default pose stands on z = 0."""
    model = Xml.Element("mujoco", model=robot.name)
    model.append(Xml.Comment(f" {COMMENT} "))
    Xml.SubElement(model, "compiler", angle="radian", eulerseq="XYZ", autolimits="true")
    defaults = Xml.SubElement(Xml.SubElement(model, "default"), "default")
    defaults.set("class", "visual")
    Xml.SubElement(defaults, "geom", contype="0", conaffinity="0", group="2", density="0")
    world = Xml.SubElement(model, "worldbody")
    _body(world, robot, robot.links[0], root_height)
    if robot.config.contact_excludes:
        contact = Xml.SubElement(model, "contact")
        for first, second in robot.config.contact_excludes:
            Xml.SubElement(contact, "exclude", name=f"{first}-{second}", body1=first, body2=second)
    return to_text(model)


def _body(parent: Xml.Element, robot: Description, row: LinkRow, root_height: float) -> None:
    pos = row.numbers("x", "y", "z") if row.parent else (0.0, 0.0, root_height)
    body = Xml.SubElement(parent, "body", name=row.link, pos=numbers(pos))
    angles = row.numbers("roll", "pitch", "yaw")
    if any(angles):
        body.set("euler", numbers(angles))
    inertia = row.numbers("ixx", "iyy", "izz", "ixy", "ixz", "iyz")
    com = numbers(row.numbers("com_x", "com_y", "com_z"))
    Xml.SubElement(body, "inertial", pos=com, mass=numbers([row.mass]), fullinertia=numbers(inertia))
    if row.parent:
        _joint(body, robot, row)
    else:
        Xml.SubElement(body, "freejoint", name="root")
    for shape in robot.shapes:
        if shape.link == row.link:
            _geom(body, robot, shape)
    for site in robot.sites:
        if site.link == row.link:
            _site(body, site)
    for child in robot.children(row.link):
        _body(body, robot, child, root_height)


def _joint(body: Xml.Element, robot: Description, row: LinkRow) -> None:
    joint = robot.joint_rows[row.joint]
    Xml.SubElement(
        body,
        "joint",
        name=row.joint,
        type="hinge",
        axis=numbers(row.numbers("axis_x", "axis_y", "axis_z")),
        range=numbers([joint.lower, joint.upper]),
        armature=numbers([joint.armature]),
    )


def _geom(body: Xml.Element, robot: Description, shape: ShapeRow) -> None:
    visual = shape.role == "visual"
    geom = Xml.SubElement(body, "geom", name=f"{shape.shape}_{'visual' if visual else 'collision'}")
    if visual:
        geom.set("class", "visual")
    else:
        geom.set("group", "2" if shape.role == "both" else "3")
    geom.set("type", shape.kind)
    geom.set("size", numbers(shape.size))
    geom.set("pos", numbers(shape.numbers("x", "y", "z")))
    angles = shape.numbers("roll", "pitch", "yaw")
    if any(angles):
        geom.set("euler", numbers(angles))
    geom.set("rgba", numbers([*robot.config.colours[shape.colour], 1.0]))


def _site(body: Xml.Element, site: SiteRow) -> None:
    Xml.SubElement(body, "site", name=site.site, pos=numbers(site.numbers("x", "y", "z")), size="0.005", group="4")


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
        _urdf_joint(model, robot, row)
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


def _urdf_joint(model: Xml.Element, robot: Description, row: LinkRow) -> None:
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
