"""Read a URDF: tree, limits and inertias by Pinocchio, shapes from the file."""

import math
from pathlib import Path
from xml.etree import ElementTree as Xml

import numpy as np
import pinocchio
from scipy.spatial.transform import Rotation

from pipeline.errors import FileError
from pipeline.robot_import.maker_model import MakerJoint, MakerLink, MakerModel, MakerShape, MakerSite, link_of, quat_of
from pipeline.robot_import.meshes import mesh_points

KINDS = ("revolute", "continuous", "fixed")
ROOT_JOINT = 1
"""Index of the free joint in Pinocchio's model; 0 is the universe."""


def read_urdf(path: Path, root: Xml.Element) -> MakerModel:
    """The model in a URDF's root element. Raises FileError."""
    _without_world(root)
    _check(path, root)
    try:
        model = pinocchio.buildModelFromXML(Xml.tostring(root, encoding="unicode"), pinocchio.JointModelFreeFlyer())
    except (ValueError, RuntimeError) as error:
        raise FileError(path, f"Pinocchio cannot read it ({error}).", "Correct the URDF.") from error
    elements = {joint.get("name", ""): joint for joint in root.iter("joint") if joint.get("type")}
    order = _depth_first(model, list(elements))
    index = {joint: position for position, joint in enumerate(order)}
    data = model.createData()
    pinocchio.forwardKinematics(model, data, pinocchio.neutral(model), np.zeros(model.nv))
    links = []
    for joint in order:
        name, inertia = model.names[joint], model.inertias[joint]
        if joint == ROOT_JOINT:
            links.append(link_of(_root_link(root), -1, None, pinocchio.SE3.Identity(), inertia))
        else:
            hinge, parent = _joint(elements[name], model, data, joint), index[model.parents[joint]]
            links.append(link_of(_ref(elements[name], "child"), parent, hinge, model.jointPlacements[joint], inertia))
    names = {joint: link.name for joint, link in zip(order, links, strict=True)}
    shapes, notes = _shapes(path, root, model, names)
    return MakerModel(
        path=path, links=tuple(links), shapes=shapes, sites=_sites(root, model, names, links), notes=notes
    )


def _without_world(root: Xml.Element) -> None:
    """Remove a massless root link to which the robot is attached by a floating or fixed joint."""
    name = _root_link(root)
    link = next((each for each in root.findall("link") if each.get("name") == name), None)
    joints = [each for each in root.findall("joint") if _ref(each, "parent") == name]
    if link is None or link.find("inertial") is not None or len(joints) != 1:
        return
    if joints[0].get("type") in ("floating", "fixed"):
        root.remove(link)
        root.remove(joints[0])


def _check(path: Path, root: Xml.Element) -> None:
    joints = root.findall("joint")
    bad = [f"'{each.get('name')}' ({each.get('type')})" for each in joints if each.get("type") not in KINDS]
    bad += [f"'{each.get('name')}' (mimic)" for each in joints if each.find("mimic") is not None]
    if bad:
        problem = f"these joints are no independent hinges: {', '.join(bad)}."
        raise FileError(path, problem, "Make them fixed or revolute in a copy of the file.")
    if not _root_link(root):
        raise FileError(path, "it has no single root link.", "Every link but one must be the child of one joint.")


def _root_link(root: Xml.Element) -> str:
    children = {_ref(joint, "child") for joint in root.findall("joint")}
    roots = [link.get("name", "") for link in root.findall("link") if link.get("name") not in children]
    return roots[0] if len(roots) == 1 else ""


def _ref(joint: Xml.Element, which: str) -> str:
    element = joint.find(which)
    return "" if element is None else element.get("link", "")


def _depth_first(model: pinocchio.Model, names: list[str]) -> list[int]:
    """Joints in depth-first order; siblings in the order of the file."""
    rank = {name: position for position, name in enumerate(names)}
    order, waiting = [], [ROOT_JOINT]
    while waiting:
        joint = waiting.pop()
        order.append(joint)
        children = [child for child in range(2, model.njoints) if model.parents[child] == joint]
        waiting += sorted(children, key=lambda child: rank[model.names[child]], reverse=True)
    return order


def _joint(element: Xml.Element, model: pinocchio.Model, data: pinocchio.Data, joint: int) -> MakerJoint:
    limit = element.find("limit")
    continuous = element.get("type") == "continuous"

    def stated(name: str) -> float | None:
        value = None if limit is None else limit.get(name)
        return None if value is None else float(value)

    return MakerJoint(
        name=model.names[joint],
        axis=np.array(data.joints[joint].S).reshape(6)[3:],
        lower=None if continuous else stated("lower"),
        upper=None if continuous else stated("upper"),
        torque=stated("effort"),
        speed=stated("velocity"),
        armature=None,
    )


def _shapes(
    path: Path, root: Xml.Element, model: pinocchio.Model, names: dict[int, str]
) -> tuple[tuple[MakerShape, ...], tuple[str, ...]]:
    shapes, notes = [], []
    for link in root.findall("link"):
        frame = model.frames[model.getFrameId(link.get("name", ""), pinocchio.FrameType.BODY)]
        owner = names[frame.parentJoint]
        for element in link:
            if element.tag not in ("collision", "visual"):
                continue
            try:
                shape = _shape(path, element, frame.placement, owner)
            except (OSError, ValueError) as error:
                notes.append(f"link '{link.get('name')}': {error}")
            else:
                shapes.append(shape)
    return tuple(shapes), tuple(dict.fromkeys(notes))


def _shape(path: Path, element: Xml.Element, placement: pinocchio.SE3, link: str) -> MakerShape:
    """Convert a geometry. Raises ValueError for one that cannot be used."""
    own = placement * _origin(element)
    geometry = element.find("geometry")
    form = next(iter(geometry), None) if geometry is not None else None
    if form is None:
        raise ValueError(f"a {element.tag} element has no geometry.")
    points, size = None, ()
    if form.tag == "box":
        size = tuple(0.5 * value for value in _numbers(form.get("size", "")))
    elif form.tag == "sphere":
        size = (float(form.get("radius", "nan")),)
    elif form.tag in ("cylinder", "capsule"):
        size = (float(form.get("radius", "nan")), 0.5 * float(form.get("length", "nan")))
    elif form.tag == "mesh":
        file = _mesh_file(path, form.get("filename", ""))
        scale = _numbers(form.get("scale", "1 1 1"))
        points = mesh_points(file, scale) @ np.array(own.rotation).T + np.array(own.translation)
    else:
        raise ValueError(f"its shape '{form.tag}' is none that is known.")
    if not all(math.isfinite(value) and value > 0.0 for value in size):
        raise ValueError(f"a {form.tag} has the sizes {size}.")
    return MakerShape(
        name=element.get("name", ""),
        link=link,
        kind=form.tag,
        collides=element.tag == "collision",
        shown=element.tag == "visual",
        pos=np.array(own.translation),
        quat=quat_of(own.rotation),
        size=size,
        points=points,
    )


def _mesh_file(path: Path, stated: str) -> Path:
    """Path of a mesh file: relative to the URDF, or below one of its parent folders for package:// names."""
    name = stated.removeprefix("file://")
    tails = [name]
    if name.startswith("package://"):
        parts = Path(name.removeprefix("package://")).parts
        tails = [str(Path(*parts[first:])) for first in range(len(parts))]
    for folder in (path.parent, *list(path.parent.parents)[:3]):
        for tail in tails:
            if (folder / tail).is_file():
                return folder / tail
    raise ValueError(f"the mesh '{stated}' is not there, so its shape is missing.")


def _origin(element: Xml.Element) -> pinocchio.SE3:
    origin = element.find("origin")
    if origin is None:
        return pinocchio.SE3.Identity()
    xyz, rpy = _numbers(origin.get("xyz", "0 0 0")), _numbers(origin.get("rpy", "0 0 0"))
    return pinocchio.SE3(Rotation.from_euler("xyz", rpy).as_matrix(), np.array(xyz))


def _sites(
    root: Xml.Element, model: pinocchio.Model, names: dict[int, str], links: list[MakerLink]
) -> tuple[MakerSite, ...]:
    """Sites from fixed links without mass and shape."""
    moving = {link.name for link in links}
    sites = []
    for link in root.findall("link"):
        name = link.get("name", "")
        if name in moving or any(link.find(part) is not None for part in ("inertial", "collision", "visual")):
            continue
        frame = model.frames[model.getFrameId(name, pinocchio.FrameType.BODY)]
        pos = np.array(frame.placement.translation)
        sites.append(MakerSite(name=name, link=names[frame.parentJoint], pos=pos))
    return tuple(sites)


def _numbers(text: str) -> list[float]:
    return [float(part) for part in text.split()]
