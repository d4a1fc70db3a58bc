"""A clip as a Rerun recording (`.rrd`): poses of all links, joint positions and velocities, over time."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from pipeline.clips.robot_clip import RobotClip
from pipeline.errors import PipelineError
from pipeline.files import digest
from pipeline.robot import Kinematics, Robot

APPLICATION = "booster-lab"
TIME, FRAME = "time", "frame"
"""Timelines: seconds from the first frame, and the number of the frame."""


class NotInstalledError(PipelineError):
    """A package of an optional extra is missing."""

    def __init__(self, package: str, extra: str):
        super().__init__(f"The package {package} is not installed. Run: pip install 'booster-lab[{extra}]'")


def write_rerun(path: Path, clip: RobotClip, robot: Robot) -> None:
    """Write a recording.

    world/<link>       Transform3D, position [m] and orientation of each link in the world (x ahead, z up)
    world/links        Points3D, the links' origins
    joint_pos/<joint>  Scalars [rad]
    joint_vel/<joint>  Scalars [rad/s]

    The same clip has the same recording id; row ids in the file are of the time of writing. Raises NotInstalledError.
    """
    try:
        import rerun as rr
    except ImportError as error:
        raise NotInstalledError("rerun-sdk", "export") from error
    poses = Kinematics(robot).forward(clip.root_pos_w, clip.root_quat_w, clip.joint_pos)
    order = np.arange(clip.frame_count)
    indexes = [rr.TimeColumn(TIME, duration=order / clip.fps), rr.TimeColumn(FRAME, sequence=order)]
    recording = rr.RecordingStream(APPLICATION, recording_id=digest.of_json([clip.name, robot.name])[:32])
    recording.save(path)
    recording.send_recording_name(clip.name)
    recording.log("world", rr.ViewCoordinates.RIGHT_HAND_Z_UP, static=True)
    for link, name in enumerate(robot.link_names):
        quat_xyzw = np.roll(poses.quat_w[:, link], -1, axis=1)
        columns = rr.Transform3D.columns(translation=poses.pos_w[:, link], quaternion=quat_xyzw)
        recording.send_columns(f"world/{name}", indexes=indexes, columns=columns)
    points = rr.Points3D.columns(positions=poses.pos_w.reshape(-1, 3)).partition(
        lengths=np.full(clip.frame_count, len(robot.link_names))
    )
    recording.send_columns("world/links", indexes=indexes, columns=points)
    velocity = clip.joint_vel()
    for joint, name in enumerate(clip.joint_names):
        for kind, values in (("joint_pos", clip.joint_pos), ("joint_vel", velocity)):
            columns = rr.Scalars.columns(scalars=values[:, joint])
            recording.send_columns(f"{kind}/{name}", indexes=indexes, columns=columns)
    recording.flush()
    recording.disconnect()
