"""Export the clips of a database to files that other programs load, with a dataset card.

mjlab, BeyondMimic and GMR: archives without pickle. Rerun: `.rrd` with the poses of all links, joint positions and
velocities. LeRobot: `lerobot.py`.
"""

import dataclasses
import io
from collections.abc import Callable, Iterable, Iterator, Sequence
from pathlib import Path

import numpy as np

from pipeline import rotation, time_series
from pipeline.clips.robot_clip import RobotClip
from pipeline.dataset_export.lerobot import write_lerobot
from pipeline.errors import PipelineError, UnknownNameError
from pipeline.expert import check_database
from pipeline.expert.database_clip import read_database_clip
from pipeline.expert.dataset_card import FILE as CARD
from pipeline.expert.dataset_card import dataset_card
from pipeline.files import atomic, digest
from pipeline.files.swap import current
from pipeline.robot import Kinematics, Robot


def tracking_archive(clip: RobotClip, robot: Robot) -> bytes:
    """The npz that mjlab's and BeyondMimic's motion loaders read.

    `joint_pos`, `joint_vel` (t, j) [rad, rad/s], `body_pos_w`, `body_lin_vel_w`, `body_ang_vel_w` (t, b, 3) [m, m/s,
    rad/s], `body_quat_w` (t, b, 4) wxyz, `fps` (1,), and names that the original format lacks: `joint_names`,
    `body_names`. Links and joints are in the order of the robot's model.
    """
    poses = Kinematics(robot).forward(clip.root_pos_w, clip.root_quat_w, clip.joint_pos)
    quat = rotation.make_continuous(poses.quat_w)
    return _npz(
        fps=np.array([clip.fps]),
        joint_pos=clip.joint_pos,
        joint_vel=clip.joint_vel(),
        body_pos_w=poses.pos_w,
        body_quat_w=quat,
        body_lin_vel_w=time_series.derivative(poses.pos_w, clip.fps),
        body_ang_vel_w=rotation.angular_velocity_w(quat, clip.fps),
        joint_names=np.array(clip.joint_names),
        body_names=np.array(robot.link_names),
    )


def gmr_archive(clip: RobotClip, robot: Robot) -> bytes:
    """GMR's arrays in an npz instead of its pickle.

    `fps`, `root_pos` (t, 3) [m], `root_rot` (t, 4) xyzw, `root_rot_order`, `dof_pos` (t, j) [rad], `dof_names`,
    `local_body_pos` (t, b, 3) [m] of the links in the root's frame and `link_body_list`.
    """
    poses = Kinematics(robot).forward(clip.root_pos_w, clip.root_quat_w, clip.joint_pos)
    local = rotation.rotate_inverse(clip.root_quat_w[:, None], poses.pos_w - clip.root_pos_w[:, None])
    return _npz(
        fps=np.array(clip.fps),
        root_pos=clip.root_pos_w,
        root_rot=np.roll(clip.root_quat_w, -1, axis=1),
        root_rot_order=np.array("xyzw"),
        dof_pos=clip.joint_pos,
        dof_names=np.array(clip.joint_names),
        local_body_pos=local,
        link_body_list=np.array(robot.link_names),
    )


ARCHIVES: dict[str, Callable[[RobotClip, Robot], bytes]] = {"mjlab": tracking_archive, "gmr": gmr_archive}
"""Format -> the bytes of a clip's archive."""


def _npz(**arrays: np.ndarray) -> bytes:
    """npz with numbers as float32, as the loaders use, and unchanged texts; deterministic."""
    stream = io.BytesIO()
    plain = {name: each.astype("f4") if each.dtype.kind == "f" else each for name, each in arrays.items()}
    np.savez(stream, allow_pickle=False, **plain)
    return stream.getvalue()


APPLICATION = "booster-lab"
TIME, FRAME = "time", "frame"
"""Timelines: time from the first frame [s], and index of the frame."""


def write_rerun(path: Path, clip: RobotClip, robot: Robot) -> None:
    """Write a recording.

    world/<link>       Transform3D, position [m] and orientation of each link in the world (x forward, z up)
    world/links        Points3D, the links' origins
    joint_pos/<joint>  Scalars [rad]
    joint_vel/<joint>  Scalars [rad/s]

    The same clip has the same recording id; row ids in the file depend on the time of writing. Raises PipelineError.
    """
    try:
        import rerun as rr
    except ImportError as error:
        problem = "The package rerun-sdk is not installed. Run: pip install 'booster-lab[export]'"
        raise PipelineError(problem) from error
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


LEROBOT, RERUN = "lerobot", "rerun"
FORMATS = (*ARCHIVES, LEROBOT, RERUN)
"""Export formats."""
SUFFIXES = {**dict.fromkeys(ARCHIVES, ".npz"), RERUN: ".rrd"}
"""Format with one file per clip -> suffix of the file."""


def export_database(
    database: Path,
    kind: str,
    robots: Callable[[str], Robot],
    out: Path,
    skills: Sequence[str] = (),
    naming: str | None = None,
) -> int:
    """Write the clips of a database into a folder and return their number.

    Args:
        database: folder of the database
        kind: one of `FORMATS`
        robots: returns the robot of a name
        out: folder to write into
        skills: skills to export; all if empty
        naming: column of the robot's aliases.csv with the joint names to write; None: the robot's own names

    Raises DatabaseError for an incomplete or damaged database, UnknownNameError for an unknown skill, PipelineError for
    a missing package.
    """
    contents = check_database(database)
    known = sorted(set(contents.index["skill"]))
    for skill in skills:
        if skill not in known:
            raise UnknownNameError("skill", skill, known)
    rows = contents.index.loc[contents.index["skill"].isin(list(skills or known))]
    out.mkdir(parents=True, exist_ok=True)

    def clips(robot: Robot, named: Robot) -> Iterator[tuple[RobotClip, str, str]]:
        for file, skill in zip(rows["file"], rows["skill"], strict=True):
            clip, _ = read_database_clip(current(database) / file, robot)
            yield dataclasses.replace(clip, joint_names=named.joint_names), skill, file

    robot = robots(contents.manifest["robot"])
    named = robot.in_naming(naming) if naming else robot
    written = export_clips(kind, clips(robot, named), named, out)
    atomic.write_text(out / CARD, dataset_card(contents.manifest, rows))
    return written


def export_clips(kind: str, clips: Iterable[tuple[RobotClip, str, str]], robot: Robot, out: Path) -> int:
    """Write clips, each with its skill and its file in the database, into a folder and return their number."""
    if kind == LEROBOT:
        return write_lerobot(out, ((clip, skill) for clip, skill, _ in clips))
    count = 0
    for clip, _, file in clips:
        path = out / Path(file).with_suffix(SUFFIXES[kind])
        if kind == RERUN:
            write_rerun(path, clip, robot)
        else:
            atomic.write_bytes(path, ARCHIVES[kind](clip, robot))
        count += 1
    return count
