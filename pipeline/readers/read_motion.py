"""Read one motion file of any known format as a clip, with the detected properties of the file.

Pickles (`.pkl`) and files of `torch.save` (`.pt`) are named arrays: one motion, in however many dictionaries.
"""

import dataclasses
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from pipeline.clips.human_clip import HumanClip
from pipeline.clips.outcome import Reason
from pipeline.clips.robot_clip import RobotClip
from pipeline.errors import FileError
from pipeline.files.array_file import ArrayFile
from pipeline.files.npz import read_npz_header
from pipeline.readers.amc import read_amc
from pipeline.readers.bvh import read_bvh
from pipeline.readers.c3d import read_c3d
from pipeline.readers.deepmimic import read_deepmimic
from pipeline.readers.gltf import read_gltf
from pipeline.readers.human_motion import to_human
from pipeline.readers.isaac_amp import is_isaac_amp, read_isaac_amp
from pipeline.readers.raw_motion import RawMotion
from pipeline.readers.restricted_pickle import PickledArray, load_pickle, load_torch
from pipeline.readers.robot_csv import read_robot_csv
from pipeline.readers.robot_log import read_robot_log
from pipeline.readers.robot_motion import RobotMotion, to_robot_clip
from pipeline.readers.robot_npz import is_gmr, is_robot, is_robot_amp, read_gmr, read_robot_amp, read_robot_npz
from pipeline.readers.smpl import is_smpl, read_smpl
from pipeline.readers.source import NOTHING_STATED, Statement
from pipeline.readers.unread import how_to_convert, refuse_pointer
from pipeline.readers.velocity_rate import checked_rate, declared_rate


@dataclass(frozen=True, kw_only=True)
class ReadMotion:
    """A clip from a file, and the detected properties of the file."""

    clip: HumanClip | RobotClip
    format: str
    """`bvh`, `amc`, `smpl`, `deepmimic`, `isaac_amp`, `robot_csv`, `robot_npz`, `robot_qpos`, `robot_amp`, …"""
    skeleton: str
    """Name of the skeleton map, or of the robot."""
    declared_fps: float | None
    """Frames per second as the file declares [Hz]; `clip.fps` may be stated or derived."""
    unit: str
    """Unit of length of the file."""
    metres_per_unit: float
    up_axis: str
    """The file's axis that points up."""
    files: tuple[Path, ...]
    """All files that were read: the motion first, then files that belong to it."""
    notes: tuple[Reason, ...]
    """Notes on the file; one with the effect `rejected` rejects the clip."""


def read_motion(path: Path, name: str, statement: Statement = NOTHING_STATED) -> ReadMotion:
    """Read the motion in a file as the clip `name`.

    Raises FileError for an unreadable file, AmbiguousFileError for a unit, axis or rate that is neither in the file nor
    stated; its text explains how to state it.
    """
    refuse_pointer(path)
    reader = _READERS.get(path.suffix.lower())
    if reader is None:
        problem = f"'{path.suffix}' is not a motion file; known are: {', '.join(sorted(_READERS))}."
        raise FileError(path, problem, how_to_convert(path.suffix))
    motion = reader(path, statement)
    file = motion.files[0] if isinstance(motion, RawMotion) else motion.path
    fps, rate_notes = checked_rate(file, motion.fps, motion.rate_by_velocity, statement)
    if isinstance(motion, RobotMotion):
        clip, order_notes = to_robot_clip(motion, name, fps, statement)
        return ReadMotion(
            clip=clip,
            format=motion.format,
            skeleton=clip.robot,
            declared_fps=declared_rate(motion.fps if motion.fps is not None else fps),
            unit="m",
            metres_per_unit=1.0,
            up_axis="z",
            files=(motion.path,),
            notes=(*motion.notes, *rate_notes, *order_notes),
        )
    canonical = to_human(dataclasses.replace(motion, fps=fps), name, statement, consume=True)
    return ReadMotion(
        **vars(canonical),
        format=motion.format,
        declared_fps=declared_rate(motion.fps),
        files=motion.files,
        notes=(*motion.notes, *rate_notes, *_assumed(motion, statement)),
    )


def _assumed(motion: RawMotion, statement: Statement) -> tuple[Reason, ...]:
    """A note that the rate is neither in the file nor stated."""
    if motion.assumed_fps is None or motion.fps is not None or statement.fps is not None:
        return ()
    text = f"The file does not say its frame rate; {motion.assumed_fps:g} Hz is what recordings of this kind have."
    return (Reason(code="assumed_rate", text=text, effect="noted", value=motion.assumed_fps, unit="Hz"),)


def _of_arrays(arrays: ArrayFile, statement: Statement) -> RawMotion | RobotMotion:
    """The motion in named arrays of any file format."""
    if is_gmr(arrays):
        return read_gmr(arrays)
    if is_smpl(arrays):
        model = None if statement.body_model is None else Path(statement.body_model)
        return read_smpl(arrays, model, arrays.assumed_fps if isinstance(arrays, LoadedArrays) else None)
    if is_robot_amp(arrays):
        return read_robot_amp(arrays)
    if is_isaac_amp(arrays):
        return read_isaac_amp(arrays)
    if is_robot(arrays):
        return read_robot_npz(arrays)
    found = ", ".join(name[:40] for name in sorted(arrays.shapes)[:12]) or "nothing"
    wanted = (
        "poses (or root_orient and pose_body) and trans (SMPL), body_positions (Isaac Lab AMP), joint_pos, qpos or "
        "root_pos, root_rot and dof_pos (a robot)"
    )
    raise FileError(arrays.path, f"no known motion: it holds {found}; known are {wanted}.")


MAX_DEPTH = 4
"""Most levels of nested dictionaries that are searched."""

MAX_LIST = 10_000
"""Most entries of a list that is converted to an array."""

GLOBAL = "smpl_params_global"
"""Key of GVHMR's motion in the world frame."""

GVHMR_RATE_HZ = 30.0
"""Rate of GVHMR's results, which do not state it [Hz]."""


@dataclass(frozen=True, kw_only=True)
class LoadedArrays(ArrayFile):
    """Named arrays in memory."""

    path: Path
    shapes: Mapping[str, tuple[int, ...]]
    values: Mapping[str, np.ndarray]
    assumed_fps: float | None = None
    """Known rate of the program that writes such files [Hz]."""

    def stored(self, name: str) -> np.ndarray:
        """One array as it was loaded. Raises FileError when it is missing."""
        if name not in self.values:
            raise FileError(self.path, f"'{name}' is missing; there are: {', '.join(sorted(self.values))}.")
        return self.values[name]


def open_loaded(path: Path, load: Callable[[Path], Any]) -> LoadedArrays:
    """The motion in a file that `load_pickle` or `load_torch` reads. Raises FileError, or OSError on disk errors."""
    value, assumed = load(path), None
    for _ in range(MAX_DEPTH):
        if not isinstance(value, dict):
            raise FileError(path, f"it holds a {type(value).__name__}, expected named arrays of one motion.")
        if isinstance(value.get(GLOBAL), dict):
            value, assumed = value[GLOBAL], GVHMR_RATE_HZ
        arrays = {str(name): array for name, each in value.items() if (array := _array(each)) is not None}
        inner = {str(name): each for name, each in value.items() if isinstance(each, dict)}
        if any(array.ndim >= 2 for array in arrays.values()) or not inner:
            shapes = {name: array.shape for name, array in arrays.items()}
            return LoadedArrays(path=path, shapes=shapes, values=arrays, assumed_fps=assumed)
        if len(inner) > 1:
            names = ", ".join(name[:40] for name in list(inner)[:5])
            do = f"Write a file for each, as {path.stem}_<motion>.npz with numpy.savez(name, **motion)."
            raise FileError(path, f"it holds {len(inner)} motions ({names}, ...); a file holds one.", do)
        (value,) = inner.values()
    raise FileError(path, f"its arrays are in more than {MAX_DEPTH} dictionaries.")


def _array(value: Any) -> np.ndarray | None:
    """A value as an array; None if it can't be converted."""
    if isinstance(value, PickledArray):
        return value.value
    if isinstance(value, np.ndarray):
        return value
    if isinstance(value, (bool, int, float, str)):
        return np.array(value)
    if isinstance(value, (list, tuple)) and 0 < len(value) <= MAX_LIST:
        if all(isinstance(each, str) for each in value):
            return np.array(value)
        if all(isinstance(each, (int, float)) for each in value):
            return np.array(value, dtype=float)
    return None


_READERS: dict[str, Callable[[Path, Statement], RawMotion | RobotMotion]] = {
    ".amc": lambda path, statement: read_amc(path, statement.asf),
    ".bvh": lambda path, _: read_bvh(path),
    ".c3d": lambda path, _: read_c3d(path),
    ".csv": lambda path, _: read_robot_csv(path),
    ".glb": lambda path, _: read_gltf(path),
    ".gltf": lambda path, _: read_gltf(path),
    ".mcap": lambda path, _: read_robot_log(path),
    ".npz": lambda path, statement: _of_arrays(read_npz_header(path), statement),
    ".pkl": lambda path, statement: _of_arrays(open_loaded(path, load_pickle), statement),
    ".pt": lambda path, statement: _of_arrays(open_loaded(path, load_torch), statement),
    ".txt": lambda path, _: read_deepmimic(path),
}

SUFFIXES = tuple(_READERS)
"""Suffixes of motion files."""


def may_be_of_a_robot(path: Path) -> bool:
    """Whether a file of this kind may contain a robot's motion, whose result depends on the folders of robots."""
    return path.suffix.lower() in {".csv", ".mcap", ".npz", ".pkl", ".pt"}
