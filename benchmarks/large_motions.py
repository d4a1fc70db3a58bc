"""Large motion files of every supported format: a short motion, repeated."""

from __future__ import annotations

import json
import pickle
from collections.abc import Callable
from pathlib import Path

import numpy as np
import torch

from pipeline.hardware_logs import write_mcap
from pipeline.hardware_logs.write import Storage
from pipeline.readers import read_motion
from pipeline.readers.isaac_amp import PARENTS as HUMANOID
from pipeline.robot import Kinematics, Robot, load_robot
from tests.factories import c3d_files, motion_files
from tests.factories.gltf import write_gltf
from tests.factories.robot_logs import noisy_log

ROOT = Path(__file__).resolve().parent.parent
FRAMES = 200
"""Frames of the repeated motion."""


def write_large(name: str, megabytes: float, folder: Path) -> Path:
    """Write a file of about `megabytes` in a format of `WRITERS`, with its companion files beside it."""
    return WRITERS[name](folder, megabytes * 1e6)


def _bvh(folder: Path, size: float) -> Path:
    head, rows = _split(motion_files.bvh(motion_files.upright(FRAMES, seed=1)), "Frame Time")
    return _repeated(
        folder / "large.bvh", head, rows, size, lambda text, count: text.replace(f"{FRAMES}\n", f"{count}\n")
    )


def _split(text: str, mark: str) -> tuple[str, list[str]]:
    """Split a text after the line with a mark: head, and the lines below."""
    end = text.index("\n", text.index(mark)) + 1
    return text[:end], text[end:].splitlines(keepends=True)


def _repeated(
    path: Path, head: str, rows: list[str], size: float, counted: Callable[[str, int], str] = lambda text, _: text
) -> Path:
    block = "".join(rows)
    times = max(1, round(size / len(block)))
    with path.open("w") as stream:
        stream.write(counted(head, times * len(rows)))
        for _ in range(times):
            stream.write(block)
    return path


def _amc(folder: Path, size: float) -> Path:
    (folder / "large.asf").write_text(motion_files.asf())
    random = np.random.default_rng(1)
    root = [[0.0, 17.0, 0.02 * frame, 0.0, 0.0, 0.0] for frame in range(FRAMES)]
    frames = [
        {
            name: random.uniform(-9, 9, len(dof.split())).round(4).tolist()
            for name, *_, dof in motion_files.asf_bones()
            if dof
        }
        for _ in range(FRAMES)
    ]
    head, *blocks = motion_files.amc(frames, root).partition("\n1\n")
    body = ("1\n" + blocks[1]).splitlines()
    with (path := folder / "large.amc").open("w") as stream:
        stream.write(head + "\n")
        number, written = 0, 0
        while written < size:
            for line in body:
                number += line.isdigit()
                written += stream.write(f"{number}\n" if line.isdigit() else line + "\n")
    return path


def _deepmimic(folder: Path, size: float) -> Path:
    rows = [row.copy() for row in motion_files.deepmimic(FRAMES)["Frames"]]
    random = np.random.default_rng(1)
    text = ",\n".join(json.dumps([*row[:2], *(value + random.uniform(0, 1e-6) for value in row[2:])]) for row in rows)
    times = max(1, round(size / len(text)))
    path = folder / "large.txt"
    path.write_text('{"Loop": "none", "Frames": [' + ",\n".join([text] * times) + "]}")
    return path


def _robot(frames: int) -> tuple[Robot, np.ndarray, np.ndarray, np.ndarray]:
    """The robot, and root positions, root quaternions wxyz and joints of a motion, repeated."""
    robot = load_robot(ROOT / "robots/t1")
    time = np.arange(frames) / 50.0
    root = np.stack([0.1 * np.sin(time), 0.1 * np.cos(time), np.full(frames, 0.67)], axis=1)
    quat = np.tile([1.0, 0.0, 0.0, 0.0], (frames, 1))
    joints = robot.default_joint_pos + 0.05 * np.sin(time)[:, None] * np.ones(len(robot.joint_names))
    return robot, root, quat, joints


def _csv(folder: Path, size: float) -> Path:
    robot, root, quat, joints = _robot(FRAMES)
    names = ["root_x", "root_y", "root_z", "quat_w", "quat_x", "quat_y", "quat_z", *robot.joint_names]
    rows = [",".join(f"{value:.9f}" for value in row) + "\n" for row in np.hstack([root, quat, joints])]
    return _repeated(folder / "large.csv", "# fps: 50\n" + ",".join(names) + "\n", rows, size)


def _smpl_arrays(size: float) -> dict[str, np.ndarray]:
    frames = int(size / (75 * 4))
    poses = np.zeros((frames, 72), dtype="f4")
    poses[:, 0], poses[:, 3:66] = np.pi / 2, 0.05 * np.sin(np.arange(frames) / 30.0)[:, None]
    trans = np.stack([np.zeros(frames), -0.02 * np.arange(frames), np.full(frames, 0.95)], axis=1).astype("f4")
    return {"poses": poses, "trans": trans, "fps": np.array(30.0)}


def _smpl(folder: Path, size: float) -> Path:
    np.savez(folder / "smpl.npz", allow_pickle=False, **_smpl_arrays(size))
    return folder / "smpl.npz"


def _pickle(folder: Path, size: float) -> Path:
    (folder / "smpl.pkl").write_bytes(pickle.dumps({"clip": _smpl_arrays(size)}))
    return folder / "smpl.pkl"


def _torch(folder: Path, size: float) -> Path:
    torch.save({name: torch.from_numpy(value) for name, value in _smpl_arrays(size).items()}, folder / "smpl.pt")
    return folder / "smpl.pt"


def _isaac_amp(folder: Path, size: float) -> Path:
    walk = read_motion(motion_files.smpl_npz(folder / "short.npz", frames=FRAMES), "clip").clip
    places = {"torso": "chest", "head": "head", "pelvis": "pelvis"}
    parts = {
        "upper_arm": "shoulder",
        "lower_arm": "elbow",
        "hand": "wrist",
        "thigh": "hip",
        "shin": "knee",
        "foot": "ankle",
    }
    places |= {f"{side}_{part}": f"{side}_{body}" for side in ("left", "right") for part, body in parts.items()}
    times = max(1, int(size / (FRAMES * len(HUMANOID) * 7 * 4)))
    pos = np.stack([walk.pos(places[name]) for name in HUMANOID], axis=1).astype("f4")
    quat = np.stack([walk.quat(places[name]) for name in HUMANOID], axis=1).astype("f4")
    arrays = {"body_positions": np.tile(pos, (times, 1, 1)), "body_rotations": np.tile(quat, (times, 1, 1))}
    np.savez(folder / "amp.npz", allow_pickle=False, **arrays, body_names=np.array(list(HUMANOID)), fps=np.array(30.0))
    return folder / "amp.npz"


def _tracking(folder: Path, size: float) -> Path:
    robot = load_robot(ROOT / "robots/t1")
    bodies = len(robot.link_names)
    frames = int(size / (4 * (2 * len(robot.joint_names) + 13 * bodies)))
    _, root, quat, joints = _robot(frames)
    poses = [
        Kinematics(robot).forward(root[start : start + 4096], quat[start : start + 4096], joints[start : start + 4096])
        for start in range(0, frames, 4096)
    ]
    place = np.concatenate([each.pos_w for each in poses]).astype("f4")
    turn = np.concatenate([each.quat_w for each in poses]).astype("f4")
    np.savez(
        folder / "tracking.npz",
        allow_pickle=False,
        fps=np.array([50.0]),
        joint_pos=joints.astype("f4"),
        joint_vel=np.gradient(joints, 0.02, axis=0).astype("f4"),
        body_pos_w=place,
        body_quat_w=turn,
        body_lin_vel_w=np.gradient(place, 0.02, axis=0).astype("f4"),
        body_ang_vel_w=np.zeros_like(place),
        joint_names=np.array(robot.joint_names),
        body_names=np.array(robot.link_names),
    )
    return folder / "tracking.npz"


def _robot_amp(folder: Path, size: float) -> Path:
    """The arrays of a whole-body-tracking archive under the names of Isaac Lab's AMP."""
    names = {
        "dof_positions": "joint_pos",
        "dof_velocities": "joint_vel",
        "body_positions": "body_pos_w",
        "body_rotations": "body_quat_w",
        "body_linear_velocities": "body_lin_vel_w",
        "body_angular_velocities": "body_ang_vel_w",
        "dof_names": "joint_names",
        "body_names": "body_names",
    }
    with np.load(_tracking(folder, size)) as arrays:
        renamed = {name: arrays[other] for name, other in names.items()}
    np.savez(folder / "robot_amp.npz", allow_pickle=False, fps=np.array(50.0), **renamed)
    return folder / "robot_amp.npz"


def _mcap(folder: Path, size: float) -> Path:
    """A log of the robot, not compressed: 500 states a second with noise in every number."""
    robot, path, plain = load_robot(ROOT / "robots/t1"), folder / "log.mcap", Storage(compression="")
    write_mcap(path, noisy_log(robot, 2.0, 50.0, np.random.default_rng(1)), plain)
    seconds = 2.0 * size / path.stat().st_size
    write_mcap(path, noisy_log(robot, seconds, 50.0, np.random.default_rng(1)), plain)
    return path


def _qpos(folder: Path, size: float) -> Path:
    robot, root, quat, joints = _robot(int(size / (4 * (7 + 6 + 2 * 23))))
    qpos = np.hstack([root, quat, joints])
    qvel = np.hstack([np.gradient(root, 0.02, axis=0), np.zeros((len(root), 3)), np.gradient(joints, 0.02, axis=0)])
    np.savez(
        folder / "qpos.npz",
        allow_pickle=False,
        qpos=qpos.astype("f4"),
        qvel=qvel.astype("f4"),
        joint_names=np.array(robot.joint_names),
    )
    return folder / "qpos.npz"


def _gmr(folder: Path, size: float) -> Path:
    robot, root, quat, joints = _robot(int(size / (8 * 30)))
    values = {"fps": 50.0, "root_pos": root, "root_rot": np.roll(quat, -1, axis=1), "dof_pos": joints}
    (folder / "gmr.pkl").write_bytes(pickle.dumps({**values, "dof_names": list(robot.joint_names)}))
    return folder / "gmr.pkl"


def _glb(folder: Path, size: float, suffix: str = ".glb") -> Path:
    frames = int(size / (4 * (1 + 3 + 4 * len(motion_files.NAMES)) * (4 / 3 if suffix == ".gltf" else 1)))
    short = motion_files.upright(FRAMES, seed=1)
    order = np.arange(frames) % FRAMES
    poses = motion_files.Poses(root=short.root[order], local=short.local[order])
    return write_gltf(folder / f"large{suffix}", poses)


def _gltf(folder: Path, size: float) -> Path:
    return _glb(folder, size, ".gltf")


def _c3d(folder: Path, size: float) -> Path:
    path = folder / "short.bvh"
    path.write_text(motion_files.bvh(motion_files.upright(FRAMES, seed=1)))
    points = c3d_files.markers(read_motion(path, "clip").clip)
    times = max(1, min(int(size / (16 * len(points) * FRAMES)), 60_000 // FRAMES))
    further = max(0, int(size / (16 * times * FRAMES)) - len(points))
    tiled = {name: np.tile(place, (times, 1)) for name, place in points.items()}
    c3d_files.write_c3d(folder / "large.c3d", tiled, 100.0, further=further)
    return folder / "large.c3d"


WRITERS: dict[str, Callable[[Path, float], Path]] = {
    "bvh": _bvh,
    "amc": _amc,
    "deepmimic": _deepmimic,
    "csv": _csv,
    "smpl npz": _smpl,
    "smpl pkl": _pickle,
    "smpl pt": _torch,
    "isaac amp npz": _isaac_amp,
    "tracking npz": _tracking,
    "robot amp npz": _robot_amp,
    "qpos npz": _qpos,
    "gmr pkl": _gmr,
    "glb": _glb,
    "gltf": _gltf,
    "c3d": _c3d,
    "mcap": _mcap,
}
"""Format -> function that writes a file of about a number of bytes into a folder."""
