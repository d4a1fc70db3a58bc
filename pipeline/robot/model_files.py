"""The MJCF and the URDF of a robot, rendered from its tables.

MJCF: bodies, joints, shapes, sites, for simulation. URDF: for inverse kinematics and rigid-body dynamics.
"""

from collections.abc import Iterable
from xml.etree import ElementTree as Xml

from pipeline.robot.description import Description
from pipeline.robot.tables import LinkRow, ShapeRow


def numbers(values: Iterable[float]) -> str:
    """Numbers separated by spaces, exact, without a negative zero."""
    return " ".join(repr(float(value) + 0.0).removesuffix(".0") for value in values)


def to_text(root: Xml.Element) -> str:
    """The element as an indented document that ends with a newline."""
    Xml.indent(root, space="  ")
    return Xml.tostring(root, encoding="unicode") + "\n"


def _add(parent: Xml.Element, tag: str, **attributes: str | float | Iterable[float]) -> Xml.Element:
    """A new element below `parent`; attributes are texts, numbers or several numbers."""
    element = Xml.SubElement(parent, tag)
    for name, value in attributes.items():
        if not isinstance(value, str):
            value = numbers([value] if isinstance(value, (int, float)) else value)
        element.set(name, value)
    return element


COMMENT = "Rendered from the tables beside it by `python -m pipeline.robot.render`. Do not edit."


def render_mjcf(robot: Description, root_height: float) -> str:
    """MJCF with the root link `root_height` [m] above the origin: the default pose has its soles at z = 0."""
    model = Xml.Element("mujoco", model=robot.name)
    model.append(Xml.Comment(f" {COMMENT} "))
    _add(model, "compiler", angle="radian", eulerseq="XYZ", autolimits="true")
    visual = _add(_add(model, "default"), "default", **{"class": "visual"})
    _add(visual, "geom", contype="0", conaffinity="0", group="2", density="0")
    _body(_add(model, "worldbody"), robot, robot.links[0], root_height)
    if robot.config.contact_excludes:
        contact = _add(model, "contact")
        for first, second in robot.config.contact_excludes:
            _add(contact, "exclude", name=f"{first}-{second}", body1=first, body2=second)
    return to_text(model)


def _body(parent: Xml.Element, robot: Description, row: LinkRow, root_height: float) -> None:
    pos = row.numbers("x", "y", "z") if row.parent else (0.0, 0.0, root_height)
    body = _add(parent, "body", name=row.link, pos=pos, **_euler(row.numbers("roll", "pitch", "yaw")))
    inertia = row.numbers("ixx", "iyy", "izz", "ixy", "ixz", "iyz")
    _add(body, "inertial", pos=row.numbers("com_x", "com_y", "com_z"), mass=row.mass, fullinertia=inertia)
    if row.parent:
        joint, axis = robot.joint_rows[row.joint], row.numbers("axis_x", "axis_y", "axis_z")
        limits = (joint.lower, joint.upper)
        _add(body, "joint", name=row.joint, type="hinge", axis=axis, range=limits, armature=joint.armature)
    else:
        _add(body, "freejoint", name="root")
    for shape in robot.shapes:
        if shape.link == row.link:
            _geom(body, robot, shape)
    for site in robot.sites:
        if site.link == row.link:
            _add(body, "site", name=site.site, pos=site.numbers("x", "y", "z"), size="0.005", group="4")
    for child in robot.children(row.link):
        _body(body, robot, child, root_height)


def _geom(body: Xml.Element, robot: Description, shape: ShapeRow) -> None:
    if shape.role == "visual":
        kind, suffix = {"class": "visual"}, "visual"
    else:
        kind, suffix = {"group": "2" if shape.role == "both" else "3"}, "collision"
    _add(
        body,
        "geom",
        name=f"{shape.shape}_{suffix}",
        **kind,
        type=shape.kind,
        size=shape.size,
        pos=shape.numbers("x", "y", "z"),
        **_euler(shape.numbers("roll", "pitch", "yaw")),
        rgba=(*robot.config.colours[shape.colour], 1.0),
    )


def _euler(angles: tuple[float, ...]) -> dict[str, tuple[float, ...]]:
    """The attribute of a rotated frame; empty for an unrotated one."""
    return {"euler": angles} if any(angles) else {}


def render_urdf(robot: Description) -> str:
    """URDF. Velocity limits are those of `retarget_speed_limit`; each site is a fixed child link of its name.

    A capsule becomes a cylinder and two spheres. URDF has no armature.
    """
    model = Xml.Element("robot", name=robot.name)
    model.append(Xml.Comment(f" {COMMENT} "))
    for name, colour in robot.config.colours.items():
        _add(_add(model, "material", name=name), "color", rgba=(*colour, 1.0))
    for row in robot.links:
        _link(model, robot, row)
    for row in robot.links[1:]:
        limits, place = robot.joint_rows[row.joint], (row.numbers("x", "y", "z"), row.numbers("roll", "pitch", "yaw"))
        joint = _urdf_joint(model, row.joint, "revolute", place, row.parent, row.link)
        _add(joint, "axis", xyz=row.numbers("axis_x", "axis_y", "axis_z"))
        _add(joint, "limit", lower=limits.lower, upper=limits.upper, effort=limits.torque, velocity=limits.speed)
    for site in robot.sites:
        _add(model, "link", name=site.site)
        place = (site.numbers("x", "y", "z"), (0.0, 0.0, 0.0))
        _urdf_joint(model, f"{site.site}_fixed", "fixed", place, site.link, site.site)
    return to_text(model)


Place = tuple[tuple[float, ...], tuple[float, ...]]
"""Position [m] and rotation about the fixed x, y, z axes [rad]."""


def _urdf_joint(model: Xml.Element, name: str, kind: str, place: Place, parent: str, child: str) -> Xml.Element:
    joint = _add(model, "joint", name=name, type=kind)
    _add(joint, "origin", xyz=place[0], rpy=place[1])
    _add(joint, "parent", link=parent)
    _add(joint, "child", link=child)
    return joint


def _link(model: Xml.Element, robot: Description, row: LinkRow) -> None:
    link = _add(model, "link", name=row.link)
    inertial = _add(link, "inertial")
    _add(inertial, "origin", xyz=row.numbers("com_x", "com_y", "com_z"), rpy="0 0 0")
    _add(inertial, "mass", value=row.mass)
    terms = ("ixx", "ixy", "ixz", "iyy", "iyz", "izz")
    _add(inertial, "inertia", **dict(zip(terms, row.numbers(*terms), strict=True)))
    for element, unused in (("visual", "collision"), ("collision", "visual")):
        for shape in robot.shapes:
            if shape.link == row.link and shape.role != unused:
                _shape(link, element, shape)


def _shape(link: Xml.Element, element: str, shape: ShapeRow) -> None:
    for suffix, kind, size, xyz in _parts(shape):
        part = _add(link, element, name=f"{shape.shape}{suffix}")
        _add(part, "origin", xyz=xyz, rpy=shape.numbers("roll", "pitch", "yaw"))
        geometry = _add(part, "geometry")
        if kind == "box":
            _add(geometry, "box", size=[2.0 * half for half in size])
        elif kind == "sphere":
            _add(geometry, "sphere", radius=size[0])
        else:
            _add(geometry, "cylinder", radius=size[0], length=2.0 * size[1])
        if element == "visual":
            _add(part, "material", name=shape.colour)


def _parts(shape: ShapeRow) -> list[tuple[str, str, tuple[float, ...], tuple[float, ...]]]:
    """(name suffix, kind, size, position) of the URDF primitives that a shape is made of."""
    centre = shape.numbers("x", "y", "z")
    if shape.kind != "capsule":
        return [("", shape.kind, shape.size, centre)]
    parts = [("", "cylinder", shape.size, centre)]
    for suffix, sign in (("_end_a", 1), ("_end_b", -1)):
        end = tuple(c + sign * shape.size_b * a for c, a in zip(centre, shape.long_axis, strict=True))
        parts.append((suffix, "sphere", shape.size[:1], end))
    return parts
