"""A robot's motion as a figure of the visual primitives of its MJCF."""

from __future__ import annotations

import mujoco

from pipeline import rotation
from pipeline.clips.robot_clip import RobotClip
from pipeline.errors import ClipError, PipelineError
from pipeline.robot import Kinematics, Robot, mujoco_model
from pipeline.viewing.figure import Figure, Part, Shape

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
