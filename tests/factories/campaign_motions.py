"""Mutated motion files, and whether a clip that was read from one contradicts it."""

from __future__ import annotations

import contextlib
import functools
import io
import json
import pickle
import tempfile
import warnings
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

import mujoco
import numpy as np

from pipeline.cli.main import main
from pipeline.clips.outcome import Piece
from pipeline.clips.robot_clip import RobotClip
from pipeline.robot import Robot, load_robot
from tests.factories import motion_files as files
from tests.factories import mutants_bvh, mutants_npz, mutants_text, mutations
from tests.factories.campaign import CRASHED, REFUSED, RIGHT, WRONG, Case, Verdict, is_sentence
from tests.factories.campaign_text import described
from tests.factories.fates import CHANGED, catalogued, fate, numbers_of
from tests.factories.gltf import write_gltf

TOLERANCE = 1e-4
"""Largest change of a number in a frame that was not touched [m, rad]."""
FRAME_CHANGES = ("flip", "nan", "offset", "scale")


@dataclass(frozen=True)
class Base:
    """A clean file that is mutated."""

    file: str
    content: bytes
    beside: tuple[tuple[str, bytes], ...] = ()
    """Further files of the folder, never mutated."""
    arrays: Callable[[], dict[str, np.ndarray]] | None = None
    """The arrays of an archive."""
    text: bool = False

    def put(self, folder: Path, content: bytes) -> Path:
        for name, data in self.beside:
            (folder / name).write_bytes(data)
        (folder / self.file).write_bytes(content)
        return folder / self.file


@functools.cache
def _t1() -> Robot:
    return load_robot("t1")


def _walking() -> RobotClip:
    """A T1 that moves along x, turned by 0.4 rad; every joint moves on its own."""
    robot, fps, frames = _t1(), 50.0, 60
    time_s = np.arange(frames)[:, None] / fps
    return RobotClip(
        name="test/walking",
        fps=fps,
        robot=robot.name,
        joint_names=robot.joint_names,
        root_pos_w=np.concatenate([0.8 * time_s, 0.1 * np.sin(time_s), 0.66 + 0.01 * np.cos(3.0 * time_s)], axis=1),
        root_quat_w=np.tile([np.cos(0.2), 0.0, 0.0, np.sin(0.2)], (frames, 1)),
        joint_pos=robot.default_joint_pos + 0.1 * np.sin(4.0 * time_s + np.arange(len(robot.joint_names))),
        contacts=np.ones((frames, 2), dtype=bool),
    )


def tracking_archive() -> dict[str, np.ndarray]:
    """A whole-body-tracking archive of a T1: joints, their speeds and the world poses of all links, by MuJoCo."""
    robot, clip = _t1(), _walking()
    pos, quat = _link_poses(robot, clip.root_pos_w, clip.root_quat_w, clip.joint_pos)
    return {
        "fps": np.array([clip.fps]),
        "joint_pos": clip.joint_pos,
        "joint_vel": np.gradient(clip.joint_pos, 1.0 / clip.fps, axis=0),
        "joint_names": np.array(robot.joint_names),
        "body_pos_w": pos,
        "body_quat_w": quat,
        "body_lin_vel_w": np.gradient(pos, 1.0 / clip.fps, axis=0),
        "body_names": np.array(robot.link_names),
    }


def qpos_archive() -> dict[str, np.ndarray]:
    """Positions and speeds of a T1 as MuJoCo keeps them."""
    clip = _walking()
    qpos = np.concatenate([clip.root_pos_w, clip.root_quat_w, clip.joint_pos], axis=1)
    return {
        "qpos": qpos,
        "qvel": np.gradient(np.delete(qpos, 6, axis=1), 1.0 / clip.fps, axis=0),
        "frequency": clip.fps,
    }


def gmr_archive() -> dict[str, np.ndarray]:
    """A T1's motion under GMR's names."""
    clip = _walking()
    quat_xyzw = np.roll(clip.root_quat_w, -1, axis=1)
    return {"fps": np.array(clip.fps), "root_pos": clip.root_pos_w, "root_rot": quat_xyzw, "dof_pos": clip.joint_pos}


def _link_poses(robot: Robot, root: np.ndarray, quat: np.ndarray, joints: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """World poses (t, links, 3 and 4) of the robot's links, computed by MuJoCo."""
    model = mujoco.MjModel.from_xml_string(robot.mjcf)
    data = mujoco.MjData(model)
    columns = [int(model.joint(name).qposadr[0]) for name in robot.joint_names]
    links = [model.body(name).id for name in robot.link_names]
    pos, turns = np.empty((len(root), len(links), 3)), np.empty((len(root), len(links), 4))
    for frame in range(len(root)):
        data.qpos[:3], data.qpos[3:7] = root[frame], quat[frame]
        data.qpos[columns] = joints[frame]
        mujoco.mj_kinematics(model, data)
        pos[frame], turns[frame] = data.xpos[links], data.xquat[links]
    return pos, turns


@functools.cache
def bases() -> tuple[Base, ...]:
    """Clean files of every format."""
    found = [
        Base("walk.bvh", mutants_bvh.CLEAN.encode(), text=True),
        Base("07_01.amc", mutants_text.AMC.encode(), tuple(mutants_text.BESIDE.items()), text=True),
        Base("walk.txt", json.dumps(mutants_text.MOTION).replace("], [", "],\n[").encode(), text=True),
        Base("robot.csv", mutants_text.robot_csv().encode(), text=True),
    ]
    for name, arrays in (
        ("smpl.npz", mutants_npz.arrays),
        ("tracking.npz", tracking_archive),
        ("qpos.npz", qpos_archive),
        ("gmr.npz", gmr_archive),
    ):
        found.append(Base(name, mutants_npz.packed(arrays()), arrays=arrays))
    plain = {name: value.item() if value.ndim == 0 else value for name, value in gmr_archive().items()}
    found.append(Base("gmr.pkl", pickle.dumps(plain)))
    return (*found, _gltf("walk.glb"), _gltf("walk.gltf"))


def _gltf(name: str) -> Base:
    with tempfile.TemporaryDirectory() as folder:
        path = write_gltf(Path(folder) / name, files.upright(60, seed=1))
        return Base(name, path.read_bytes(), text=name.endswith(".gltf"))


def motion_cases(seed: int, count: int, folder: Path) -> Iterator[Case]:
    """`count` mutated motion files, the formats in turn; `folder` is for the clean files."""
    clean = {}
    for base in bases():
        (folder / base.file).mkdir(parents=True)
        clean[base.file] = catalogued(base.put(folder / base.file, base.content)).pieces[0]
    for index in range(count):
        base = bases()[index % len(bases())]
        rng = np.random.default_rng([seed, 1, index])
        content, what, frames = _mutated(base, rng)
        if content != base.content:
            run = functools.partial(_judge, base, content, frames, clean[base.file])
            yield Case(f"motion {index} {base.file}: {what}", run)


def _mutated(base: Base, rng: np.random.Generator) -> tuple[bytes, str, set[int] | None]:
    """The mutated content, what was done, and of an archive whose numbers changed in single frames those frames."""
    if base.arrays is not None and rng.random() < 0.7:
        return _mutated_arrays(base.arrays(), rng)
    mutate = mutations.mutated_text if base.text else mutations.mutated_bytes
    return (*mutate(base.content, rng), None)


def _mutated_arrays(arrays: dict[str, np.ndarray], rng: np.random.Generator) -> tuple[bytes, str, set[int] | None]:
    arrays = {name: np.array(value) for name, value in arrays.items()}
    name = str(rng.choice(sorted(arrays)))
    value, frames = arrays[name], None
    kind = str(rng.choice([*FRAME_CHANGES, "all scaled", "all negated", "left out", "row removed", "columns", "type"]))
    numbers = value.dtype.kind == "f" and value.ndim >= 2
    if kind in FRAME_CHANGES and numbers:
        frame = int(rng.integers(len(value)))
        entry = value.reshape(len(value), -1)[frame]
        column, frames = int(rng.integers(len(entry))), {frame}
        new = {
            "flip": -entry[column],
            "nan": np.nan,
            "offset": entry[column] + rng.normal(),
            "scale": entry[column] * 57.3,
        }
        entry[column] = new[kind]
    elif kind == "all scaled" and value.dtype.kind == "f":
        arrays[name] = value * float(rng.choice([0.5, 2.0, 0.01, 57.3]))
    elif kind == "all negated" and value.dtype.kind == "f":
        arrays[name] = -value
    elif kind == "left out":
        del arrays[name]
    elif kind == "row removed" and value.ndim >= 1 and len(value) > 1:
        arrays[name] = np.delete(value, int(rng.integers(len(value))), axis=0)
    elif kind == "columns" and value.ndim >= 2:
        arrays[name] = np.roll(value, 1, axis=1)
    elif kind == "columns" and value.ndim == 1 and len(value) > 1:
        arrays[name] = rng.permutation(value)
    else:
        kind = "type"
        types = [value.astype(str), np.array([value.tolist()], dtype=object), value.astype(str)[..., None], value[None]]
        arrays[name] = types[int(rng.integers(len(types)))]
    return mutants_npz.packed(arrays, allow_pickle=True), f"{kind} {name}", frames


def _judge(base: Base, content: bytes, frames: set[int] | None, clean: Piece, folder: Path) -> Verdict:
    """`booster-lab inspect` and the catalogue on the file."""
    path, size = base.put(folder, content), len(content)
    out, errors = io.StringIO(), io.StringIO()
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(errors):
        warnings.simplefilter("error", RuntimeWarning)
        code = main(["inspect", str(path), "--json"])
    text = errors.getvalue()
    if code == 1:
        whole = is_sentence(text, path.name) and not out.getvalue()
        return Verdict(REFUSED if whole else CRASHED, text if whole else f"no sentence: {text[-800:]}", size)
    if code != 0 or text:
        return Verdict(CRASHED, f"exit {code}: {text[-800:]}", size)
    json.loads(out.getvalue())
    outcome, sentence = fate(path, clean)
    if outcome != CHANGED:
        return Verdict(RIGHT, sentence, size)
    faults = contradictions(base, content, frames, catalogued(path).pieces[0], clean)
    return Verdict(WRONG if faults else RIGHT, "; ".join(faults), size)


def contradictions(base: Base, content: bytes, frames: set[int] | None, piece: Piece, clean: Piece) -> list[str]:
    """What in the file speaks against the clip that was read from it, by means of its own."""
    faults: list[str] = []
    if base.text and base.file != "walk.gltf":
        before, after = described(base.file, base.content), described(base.file, content)
        faults += after.faults
        if before.head == after.head and len(before.frames) == len(after.frames):
            pairs = enumerate(zip(before.frames, after.frames, strict=True))
            frames = {frame for frame, (one, other) in pairs if one != other}
        elif not faults and len(after.frames) != piece.clip.frame_count and len(before.frames) != len(after.frames):
            faults.append(f"{len(after.frames)} frames in the file, {piece.clip.frame_count} in the clip")
    elif base.arrays is not None:
        faults += _archive_faults(_arrays_of(content), piece)
    if frames is not None and piece.clip.frame_count == clean.clip.frame_count:
        faults += _changes_elsewhere(frames, piece, clean)
    return faults


def _arrays_of(content: bytes) -> dict[str, np.ndarray]:
    """The arrays of numbers and text of an archive."""
    with np.load(io.BytesIO(content)) as archive:
        return {name: archive[name] for name in archive.files}


def _changes_elsewhere(frames: set[int], piece: Piece, clean: Piece) -> list[str]:
    """Numbers that differ in frames whose numbers in the file are as before."""
    kept = np.array([frame not in frames for frame in range(clean.clip.frame_count)])
    for found, true in zip(numbers_of(piece.clip)[1:], numbers_of(clean.clip)[1:], strict=True):
        off = np.abs(found[kept] - true[kept])
        if found.shape != true.shape or np.nanmax(off, initial=0.0) > TOLERANCE:
            return [f"numbers of frames that the mutation did not touch differ by {np.nanmax(off, initial=0.0):.3g}"]
    return []


def _archive_faults(arrays: dict[str, np.ndarray], piece: Piece) -> list[str]:
    """Speeds that are not those of the positions at the clip's rate, and links that are not where the joints say."""
    clip, faults = piece.clip, []
    rate = clip.fps
    for positions, speeds in (("joint_pos", "joint_vel"), ("body_pos_w", "body_lin_vel_w")):
        if positions in arrays and speeds in arrays:
            derived = np.diff(arrays[positions], axis=0) * rate
            stated = 0.5 * (arrays[speeds][1:] + arrays[speeds][:-1])
            scale = np.abs(derived).sum()
            if scale > 0.0 and np.abs(derived - stated).sum() > 0.3 * scale:
                faults.append(f"{speeds} is not the rate of change of {positions}")
    if "qvel" in arrays and arrays["qvel"].shape[1] == arrays["qpos"].shape[1] - 1:
        derived, stated = np.diff(arrays["qpos"][:, 7:], axis=0) * rate, arrays["qvel"][1:, 6:]
        if np.abs(derived - stated).sum() > 0.3 * np.abs(derived).sum():
            faults.append("qvel is not the rate of change of qpos")
    if "body_pos_w" in arrays and arrays["body_pos_w"].shape[1] == len(_t1().link_names):
        names = arrays["body_names"].tolist()
        if set(names) == set(_t1().link_names):
            order = [names.index(name) for name in _t1().link_names]
            pos, _ = _link_poses(_t1(), clip.root_pos_w, clip.root_quat_w, clip.joint_pos)
            stated = arrays["body_pos_w"][:, order]
            off = np.linalg.norm((pos - pos[:, :1]) - (stated - stated[:, :1]), axis=2)
            if np.median(off.max(axis=1)) > 0.05:
                faults.append(f"links are {np.median(off.max(axis=1)):.2f} m from where the file has them")
    return faults
