"""A robot's motion as a figure of the visual primitives of its MJCF."""

from functools import lru_cache

import mujoco
import numpy as np
from jaxtyping import Float, Int

from pipeline import rotation
from pipeline.clips.robot_clip import RobotClip
from pipeline.errors import ClipError, PipelineError, UnknownNameError
from pipeline.robot import Kinematics, Robot, mujoco_model
from pipeline.viewing.figure import Figure, Part, Shape

KINDS = ("box", "sphere", "ellipsoid", "capsule", "cylinder")

Mesh = tuple[Float[np.ndarray, "v 3"], Int[np.ndarray, "f 3"]]


@lru_cache(maxsize=512)
def shape_mesh(kind: str, size: tuple[float, ...], segments: int) -> Mesh:
    """Vertices [m] and triangles (seen from outside their corners run counterclockwise) of a `figure.Shape`.

    Circles have `segments` corners, on the true surface. Raises UnknownNameError for another kind.
    """
    if kind not in KINDS:
        raise UnknownNameError("primitive", kind, KINDS)
    from trimesh import creation  # slow import (0.5 s), only needed for drawing

    if kind == "box":
        mesh = creation.box(extents=2.0 * np.array(size))
    else:
        mesh = creation.revolve(np.array(_profile(kind, size, segments)), sections=segments)
    scale = np.array(size) if kind == "ellipsoid" else 1.0
    return np.asarray(mesh.vertices) * scale, np.asarray(mesh.faces)


def _profile(kind: str, size: tuple[float, ...], segments: int) -> list[tuple[float, float]]:
    """Profile of a body of revolution about z, as (distance from the axis, height) from bottom to top [m].

    An ellipsoid has the profile of the unit sphere. The side of a cylinder is divided into bands about as high as its
    radius, so that the triangles are small enough for sorting by depth.
    """
    radius, half = (1.0, 0.0) if kind == "ellipsoid" else (*size, 0.0)[:2]
    quarter = np.linspace(0.0, np.pi / 2, max(segments // 4, 1) + 1)[1:-1]
    arc = [(radius * float(np.cos(turn)), radius * float(np.sin(turn))) for turn in quarter if kind != "cylinder"]
    bands = max(1, min(12, round(2 * half / radius)))
    wall = [(radius, float(z)) for z in np.linspace(-half, half, bands + 1 if half else 1)]
    top = half if kind == "cylinder" else half + radius
    lower, upper = ([(r, sign * (z + half)) for r, z in arc] for sign in (-1.0, 1.0))
    return [(0.0, -top), *lower[::-1], *wall, *upper, (0.0, top)]


DRAWN_GROUP = 2
"""MJCF group of drawn geoms; group 3 is collision only."""

_KIND = {
    mujoco.mjtGeom.mjGEOM_BOX: ("box", 3),
    mujoco.mjtGeom.mjGEOM_SPHERE: ("sphere", 1),
    mujoco.mjtGeom.mjGEOM_ELLIPSOID: ("ellipsoid", 3),
    mujoco.mjtGeom.mjGEOM_CAPSULE: ("capsule", 2),
    mujoco.mjtGeom.mjGEOM_CYLINDER: ("cylinder", 2),
}


def robot_figure(clip: RobotClip, robot: Robot, name: str = "") -> Figure:
    """The figure of a robot clip by the robot's kinematics. Raises ClipError if the joints are not the robot's."""
    if clip.joint_names != robot.joint_names:
        do = "" if clip.robot == robot.name else f" It is for the robot '{clip.robot}': add --robot {clip.robot}."
        raise ClipError(clip.name, "joints", f"its joints are not those of the robot '{robot.name}', in its order.{do}")
    parts = robot_parts(robot)
    link = [robot.link(part.name) for part in parts]
    poses = Kinematics(robot).forward(clip.root_pos_w, clip.root_quat_w, clip.joint_pos)
    return Figure(
        name=name or robot.name,
        fps=clip.fps,
        parts=parts,
        pos_w=poses.pos_w[:, link],
        quat_w=poses.quat_w[:, link],
        root_pos_w=clip.root_pos_w,
        heading=rotation.yaw_of(clip.root_quat_w),
        contacts=clip.contacts,
    )


def robot_parts(robot: Robot) -> tuple[Part, ...]:
    """Links with visual primitives, in the robot's order."""
    shapes = _shapes_of_links(robot)
    foot = {robot.human.get("left_foot"): 0, robot.human.get("right_foot"): 1}
    return tuple(
        Part(name=name, shapes=shapes[name], foot=foot.get(name)) for name in robot.link_names if name in shapes
    )


def _shapes_of_links(robot: Robot) -> dict[str, tuple[Shape, ...]]:
    model = mujoco_model(robot)
    shapes: dict[str, tuple[Shape, ...]] = {}
    for index in range(model.ngeom):
        geom = model.geom(index)
        if int(geom.group[0]) != DRAWN_GROUP:
            continue
        kind = _KIND.get(mujoco.mjtGeom(int(geom.type[0])))
        if kind is None:
            raise PipelineError(
                f"robot '{robot.name}' geom '{geom.name}': only {', '.join(name for name, _ in _KIND.values())} "
                f"can be drawn; put it in another group than {DRAWN_GROUP} and a primitive in its place."
            )
        shape = Shape(
            name=geom.name,
            kind=kind[0],
            size=tuple(float(value) for value in geom.size[: kind[1]]),
            color=(float(geom.rgba[0]), float(geom.rgba[1]), float(geom.rgba[2])),
            pos=(float(geom.pos[0]), float(geom.pos[1]), float(geom.pos[2])),
            quat=(float(geom.quat[0]), float(geom.quat[1]), float(geom.quat[2]), float(geom.quat[3])),
        )
        link = model.body(int(geom.bodyid[0])).name
        shapes[link] = (*shapes.get(link, ()), shape)
    return shapes
