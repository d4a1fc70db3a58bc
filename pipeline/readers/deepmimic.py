"""DeepMimic motion text: JSON rows of 44 numbers on the humanoid3d figure.

Columns: duration of the frame [s]; root position 3, root quaternion wxyz 4; then by joint, each relative
to its parent: quaternions wxyz for ball joints, an angle [rad] about z for knees and elbows. The figure
(x forward, y up, z right) is that of DeepMimic's data/characters/humanoid3d.txt.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float

from pipeline import rotation
from pipeline.errors import FileError
from pipeline.files.array_file import known_numbers
from pipeline.readers.poses import StoredPoses
from pipeline.readers.quaternion_order import check_unit
from pipeline.readers.raw_motion import RawMotion, forward_kinematics
from pipeline.readers.text_file import MAX_FRAMES, read_lines

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
"""Joint -> parent and place in the parent's frame [m]."""

HINGES = ("right_knee", "right_elbow", "left_knee", "left_elbow")
FIXED = ("right_wrist", "left_wrist")
COLUMNS = 44


def read_deepmimic(path: Path) -> RawMotion:
    """A DeepMimic motion. Raises FileError."""
    rows = _rows(path)
    local_pos = np.array([offset for _, offset in SKELETON.values()])
    local_pos = np.broadcast_to(local_pos, (len(rows), len(SKELETON), 3)).copy()
    local_pos[:, 0] = rows[:, 1:4]
    local_quat = np.broadcast_to(rotation.IDENTITY, (len(rows), len(SKELETON), 4)).copy()
    column = 4
    for index, name in enumerate(SKELETON):
        if name in HINGES:
            local_quat[:, index] = rotation.from_axis_angle(np.array([0.0, 0.0, 1.0]), rows[:, column])
            column += 1
        elif name not in FIXED:
            check_unit(path, rows[:, column : column + 4], f"the quaternion of '{name}'")
            local_quat[:, index] = rotation.normalize(rows[:, column : column + 4])
            column += 4
    names = tuple(SKELETON)
    parents = tuple(-1 if parent is None else names.index(parent) for parent, _ in SKELETON.values())
    pos, quat = forward_kinematics(parents, local_pos, local_quat)
    return RawMotion(
        format="deepmimic",
        joint_names=names,
        parents=parents,
        rest_offset=np.array([offset for _, offset in SKELETON.values()]),
        poses=StoredPoses(pos_w=pos, quat_w=quat),
        fps=_rate(path, rows[:, 0]),
        files=(path,),
        unit="m",
    )


def _rows(path: Path) -> Float[np.ndarray, "t 44"]:
    text = "\n".join(read_lines(path))
    try:
        value = json.loads(text, object_pairs_hook=_without_doubles, parse_int=float)
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
            raise FileError(path, f"frame {index} has {got} numbers, wanted {COLUMNS} (humanoid3d).")
        if not all(isinstance(entry, (int, float)) and not isinstance(entry, bool) for entry in frame):
            raise FileError(path, f"frame {index} holds something that is not a number.")
    rows = np.array(frames, dtype=float)
    return known_numbers(rows)


def _without_doubles(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    """An object whose keys are all different. Raises ValueError."""
    found = dict(pairs)
    if len(found) < len(pairs):
        raise ValueError("a key is there twice")
    return found


def _rate(path: Path, durations_s: Float[np.ndarray, " t"]) -> float:
    """Frames per second [Hz]; every frame lasts the same but the last, whose duration is not used."""
    used = durations_s[:-1] if len(durations_s) > 1 else durations_s
    typical = float(np.median(used))
    if not 1e-4 <= typical <= 1.0:
        raise FileError(path, f"a frame lasts {typical:g} s, wanted 0.0001 to 1.", "State `fps:` for it.")
    if np.max(np.abs(used - typical)) > 0.02 * typical:
        raise FileError(path, f"frames last from {np.min(used):g} to {np.max(used):g} s; one rate is wanted.")
    return 1.0 / typical
