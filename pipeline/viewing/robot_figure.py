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
    """Vertices [m] and triangles (seen from outside their corners run counterclockwise) of a primitive.

    Args:
        kind: one of `KINDS`
        size: as in `figure.Shape`
        segments: corners of a circle; the vertices lie on the true surface

    Raises UnknownNameError for another kind.
    """
    if kind not in KINDS:
        raise UnknownNameError("primitive", kind, KINDS)
    if kind == "box":
        return _box(size)
    if kind in ("sphere", "ellipsoid"):
        vertices, faces = _turned(_arc(segments), segments)
        return vertices * np.array(size if kind == "ellipsoid" else size[:1] * 3), faces
    radius, half = size[:2]
    if kind == "cylinder":
        return _turned([(0.0, -half), *_wall(radius, half), (0.0, half)], segments)
    arc = _arc(segments)
    middle = len(arc) // 2
    lower = [(radius * r, radius * z - half) for r, z in arc[:middle]]
    upper = [(radius * r, radius * z + half) for r, z in arc[middle + 1 :]]
    return _turned([*lower, *_wall(radius, half), *upper], segments)


def _arc(segments: int) -> list[tuple[float, float]]:
    """Half a unit circle as (distance from the axis, height), from the lower to the upper pole; odd count."""
    angles = np.linspace(-np.pi / 2, np.pi / 2, 2 * max(segments // 4, 1) + 1)
    profile = [(float(np.cos(angle)), float(np.sin(angle))) for angle in angles]
    return [(0.0, -1.0), *profile[1:-1], (0.0, 1.0)]


def _wall(radius: float, half: float) -> list[tuple[float, float]]:
    """The side of a cylinder in bands about as high as its radius, so that triangles stay small and can be sorted."""
    bands = max(1, min(12, round(2 * half / radius)))
    return [(radius, float(z)) for z in np.linspace(-half, half, bands + 1)]


def _turned(profile: list[tuple[float, float]], segments: int) -> Mesh:
    """The solid that a profile of (distance, height) makes when turned about z; its ends lie on the axis."""
    turn = 2 * np.pi * np.arange(segments) / segments
    rings = [np.stack([r * np.cos(turn), r * np.sin(turn), np.full(segments, z)], axis=1) for r, z in profile[1:-1]]
    poles = np.array([[0.0, 0.0, profile[0][1]], [0.0, 0.0, profile[-1][1]]])
    vertices = np.concatenate([*rings, poles])
    here = np.arange(segments)
    after = (here + 1) % segments
    last, bottom, top = (len(rings) - 1) * segments, len(vertices) - 2, len(vertices) - 1
    faces = [np.stack([np.full(segments, bottom), after, here], axis=1)]
    for low in range(0, last, segments):
        high = low + segments
        faces.append(np.stack([low + here, low + after, high + after], axis=1))
        faces.append(np.stack([low + here, high + after, high + here], axis=1))
    faces.append(np.stack([last + here, last + after, np.full(segments, top)], axis=1))
    return vertices, np.concatenate(faces)


def _box(half: tuple[float, ...]) -> Mesh:
    corners = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)]) * np.array(half[:3])
    quads = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    faces = np.array([triangle for a, b, c, d in quads for triangle in ((a, b, c), (a, c, d))])
    return corners, faces


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
    """The figure of a robot clip, placed by the robot's kinematics; its name is the robot's unless one is given.

    Raises ClipError for a clip whose joints are not the robot's.
    """
    if clip.joint_names != robot.joint_names:
        raise ClipError(clip.name, "joints", f"its joints are not those of the robot '{robot.name}', in its order.")
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
