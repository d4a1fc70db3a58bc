"""DeepMimic motion text: JSON rows of 44 numbers on the humanoid3d figure.

Columns: duration of the frame [s]; root position 3, root quaternion wxyz 4; then by joint, each relative
to its parent: quaternions wxyz for ball joints, an angle [rad] about z for knees and elbows. The figure
(x forward, y up, z right) is that of DeepMimic's data/characters/humanoid3d.txt.
"""

import json
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float

from pipeline import rotation
from pipeline.errors import FileError
from pipeline.files import page_memory
from pipeline.files.array_file import ROWS_AT_ONCE, known_numbers
from pipeline.readers.raw_motion import RawMotion, TreePoses, check_unit, parent_indices
from pipeline.readers.text_file import MAX_FRAMES, read_text
from pipeline.readers.velocity_rate import STATE_RATE

SKELETON: dict[str, tuple[str | None, tuple[float, float, float]]] = {
    "root": (None, (0.0, 0.0, 0.0)),
    "chest": ("root", (0.0, 0.236151, 0.0)),
    "neck": ("chest", (0.0, 0.223894, 0.0)),
    "right_hip": ("root", (0.0, 0.0, 0.084887)),
    "right_knee": ("right_hip", (0.0, -0.421546, 0.0)),
    "right_ankle": ("right_knee", (0.0, -0.409870, 0.0)),
    "right_shoulder": ("chest", (-0.02405, 0.24350, 0.18311)),
    "right_elbow": ("right_shoulder", (0.0, -0.274788, 0.0)),
    "right_wrist": ("right_elbow", (0.0, -0.258947, 0.0)),
    "left_hip": ("root", (0.0, 0.0, -0.084887)),
    "left_knee": ("left_hip", (0.0, -0.421546, 0.0)),
    "left_ankle": ("left_knee", (0.0, -0.409870, 0.0)),
    "left_shoulder": ("chest", (-0.02405, 0.24350, -0.18311)),
    "left_elbow": ("left_shoulder", (0.0, -0.274788, 0.0)),
    "left_wrist": ("left_elbow", (0.0, -0.258947, 0.0)),
}
"""Joint -> parent and offset in the parent's frame [m]."""

HINGES = ("right_knee", "right_elbow", "left_knee", "left_elbow")
FIXED = ("right_wrist", "left_wrist")
COLUMNS = 44


def read_deepmimic(path: Path) -> RawMotion:
    """Read a DeepMimic motion. Raises FileError."""
    rows = _rows(path)
    fps, rate_fault = _rate(path, rows[:, 0])
    parents = parent_indices({joint: parent for joint, (parent, _) in SKELETON.items()})
    offsets = np.array([offset for _, offset in SKELETON.values()])
    for joint, first in _columns().items():
        if joint not in HINGES:
            for start in range(0, len(rows), ROWS_AT_ONCE):
                part = rows[start : start + ROWS_AT_ONCE, first : first + 4]
                check_unit(path, part, f"the quaternion of '{joint}'", start)
    return RawMotion(
        format="deepmimic",
        joint_names=tuple(SKELETON),
        parents=parents,
        rest_offset=offsets,
        poses=TreePoses(
            parents=parents,
            offsets=offsets,
            rows=(rows,),
            local=lambda start, stop: _local(rows[start:stop]),
        ),
        fps=fps,
        rate_fault=rate_fault,
        files=(path,),
        unit="m",
    )


def _columns() -> dict[str, int]:
    """First column of each moving joint."""
    columns, column = {}, 4
    for name in SKELETON:
        if name not in FIXED:
            columns[name] = column
            column += 1 if name in HINGES else 4
    return columns


def _local(rows: Float[np.ndarray, "t 44"]) -> tuple[Float[np.ndarray, "t 3"], Float[np.ndarray, "t 15 4"]]:
    """Positions of the root [m] and orientations of the joints in their parents' frames."""
    quat = np.broadcast_to(rotation.IDENTITY, (len(rows), len(SKELETON), 4)).copy()
    for joint, first in _columns().items():
        index = list(SKELETON).index(joint)
        if joint in HINGES:
            quat[:, index] = rotation.from_axis_angle(np.array([0.0, 0.0, 1.0]), rows[:, first])
        else:
            quat[:, index] = rotation.normalize(rows[:, first : first + 4])
    return rows[:, 1:4], quat


def _rows(path: Path) -> Float[np.ndarray, "t 44"]:
    try:
        value = json.loads(read_text(path), object_pairs_hook=_without_doubles, parse_int=float)
    except (ValueError, RecursionError) as error:
        line = getattr(error, "lineno", None)
        raise FileError(path, f"it is not DeepMimic JSON: {getattr(error, 'msg', error)}.", line=line) from error
    frames = value.get("Frames") if isinstance(value, dict) else None
    if not isinstance(frames, list) or not frames:
        raise FileError(path, "there is no list 'Frames', or it is empty.")
    if len(frames) > MAX_FRAMES:
        raise FileError(path, f"{len(frames)} frames are more than the {MAX_FRAMES} allowed.")
    for index, frame in enumerate(frames):
        if not isinstance(frame, list) or len(frame) != COLUMNS:
            got = len(frame) if isinstance(frame, list) else type(frame).__name__
            raise FileError(path, f"frame {index} has {got} numbers, expected {COLUMNS} (humanoid3d).")
        if not all(isinstance(entry, (int, float)) and not isinstance(entry, bool) for entry in frame):
            raise FileError(path, f"frame {index} holds something that is not a number.")
    rows = page_memory.empty((len(frames), COLUMNS))
    for start in range(0, len(frames), ROWS_AT_ONCE):
        part = np.array(frames[start : start + ROWS_AT_ONCE], dtype=float)
        rows[start : start + ROWS_AT_ONCE] = known_numbers(part)
    return rows


def _without_doubles(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    """A JSON object without duplicate keys. Raises ValueError."""
    found = dict(pairs)
    if len(found) < len(pairs):
        raise ValueError("a key is there twice")
    return found


def _rate(path: Path, durations_s: Float[np.ndarray, " t"]) -> tuple[float | None, FileError | None]:
    """Frames per second [Hz], or the error in the durations. The last frame's duration is not used."""
    used = durations_s[:-1] if len(durations_s) > 1 else durations_s
    typical = float(np.median(used))
    if not 1e-4 <= typical <= 1.0:
        return None, FileError(path, f"a frame lasts {typical:g} s, expected 0.0001 to 1.", STATE_RATE)
    if np.max(np.abs(used - typical)) > 0.02 * typical:
        problem = f"frames last from {np.min(used):g} to {np.max(used):g} s; one rate is expected."
        return None, FileError(path, problem, STATE_RATE)
    return 1.0 / typical, None
