"""Isaac Lab AMP archives: world poses of the bodies of a humanoid, by name.

`body_positions` (t, b, 3) [m], `body_rotations` (t, b, 4) wxyz, `body_names`, `fps`. The archive has no
hierarchy: bones are the offsets of bodies in their parents' frames, which must be constant. This also verifies the
order of the quaternions.
"""

from pathlib import Path

import numpy as np

from pipeline import rotation
from pipeline.errors import FileError
from pipeline.files.array_file import ROWS_AT_ONCE, ArrayFile, finite_rows
from pipeline.readers.raw_motion import RawMotion, RowPoses, check_unit, in_parents, parent_indices
from pipeline.readers.velocity_rate import rate_of_velocities

PARENTS: dict[str, str | None] = {
    "pelvis": None,
    "torso": "pelvis",
    "head": "torso",
    "right_upper_arm": "torso",
    "right_lower_arm": "right_upper_arm",
    "right_hand": "right_lower_arm",
    "left_upper_arm": "torso",
    "left_lower_arm": "left_upper_arm",
    "left_hand": "left_lower_arm",
    "right_thigh": "pelvis",
    "right_shin": "right_thigh",
    "right_foot": "right_shin",
    "left_thigh": "pelvis",
    "left_shin": "left_thigh",
    "left_foot": "left_shin",
}

MAX_BONE_CHANGE = 0.01
"""Largest variation of a body's offset in its parent's frame for a rigid bone [m] (95th percentile)."""

MEASURED_FRAMES = 20_000
"""Number of frames, from the first, in which bones are measured."""


def is_isaac_amp(header: ArrayFile) -> bool:
    """Whether an archive has the format of Isaac Lab's AMP motions."""
    return header.has("body_positions", "body_rotations", "body_names")


def read_isaac_amp(header: ArrayFile) -> RawMotion:
    """Read an AMP motion of Isaac Lab. Raises FileError."""
    path = header.path
    stored = header.texts("body_names")
    missing = [name for name in PARENTS if name not in stored]
    if missing:
        raise FileError(path, f"bodies are missing: {', '.join(missing)}; there are: {', '.join(stored)}.")
    pos = header.stored_numbers("body_positions", None, len(stored), 3)
    quat = header.stored_numbers("body_rotations", len(pos), len(stored), 4)
    if not len(pos):
        raise FileError(path, "the file has no frames.")
    rate = None
    if header.shapes.get("body_linear_velocities") == pos.shape:
        rate = rate_of_velocities(pos, header.stored_numbers("body_linear_velocities", *pos.shape))
    poses = RowPoses(rows=(pos, quat), columns=tuple(stored.index(name) for name in PARENTS))
    for start in range(0, len(pos), ROWS_AT_ONCE):
        rows = finite_rows(quat, start, start + ROWS_AT_ONCE)[:, list(poses.columns)]
        check_unit(path, rows, "a body's quaternion", start)
    names, parents = tuple(PARENTS), parent_indices(PARENTS)
    return RawMotion(
        format="isaac_amp",
        joint_names=names,
        parents=parents,
        rest_offset=_bones(path, names, parents, *poses.world(range(len(names)), 0, MEASURED_FRAMES)),
        poses=poses,
        fps=header.optional_number("fps"),
        rate_by_velocity=rate,
        files=(path,),
        unit="m",
    )


def _bones(
    path: Path, names: tuple[str, ...], parents: tuple[int, ...], pos: np.ndarray, quat: np.ndarray
) -> np.ndarray:
    """Offset of each body in its parent's frame [m] (b, 3), median over time. Raises FileError."""
    places = in_parents(pos, quat, parents)
    offsets = np.nanmedian(places, axis=0)
    change = np.nanpercentile(rotation.length(places - offsets), 95, axis=0)
    if (change > MAX_BONE_CHANGE).any():
        body = int(np.argmax(change > MAX_BONE_CHANGE))
        problem = f"'{names[body]}' moves by {change[body]:.3f} m in the frame of '{names[parents[body]]}'"
        raise FileError(path, f"{problem}, which is no bone.", "Are the quaternions wxyz?")
    return offsets
