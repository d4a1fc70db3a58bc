"""C3D: points of a motion capture system, from which a person's joints are computed (`plug_in_gait`).

The bytes are read by the library `c3d`, frame by frame. (ezc3d needs eleven times the file's size, and
crashed on some damaged test files.) Analog channels, angles, forces and unnamed points are ignored.
"""

import warnings
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import c3d
import numpy as np
from jaxtyping import Float

from pipeline.clips.human_clip import BODIES, PARENT
from pipeline.clips.outcome import Reason
from pipeline.errors import FileError
from pipeline.files import page_memory
from pipeline.files.npz import reported_damage
from pipeline.readers.human_motion import METRES, STATED_LEG_MAX, STATED_LEG_MIN
from pipeline.readers.plug_in_gait import WANTED, body_poses, missing_points
from pipeline.readers.raw_motion import Poses, RawMotion, World, in_parents, refuse_pose
from pipeline.readers.text_file import MAX_FRAMES, MAX_NUMBERS, check_size

FARTHEST = 1e7
"""Largest valid coordinate in the file's unit: 10 km in millimetres."""
FRAMES_AT_ONCE = 512
"""Frames whose bodies are computed together."""
MEASURED_FRAMES = 4096
"""Number of frames used for the bone lengths."""


@dataclass(frozen=True, kw_only=True)
class PointPoses(Poses):
    """World poses of the canonical bodies from points, computed for the requested frames.

    A row has the concatenated positions of the named points in the file's unit; NaN where a point is missing.
    """

    names: tuple[str, ...]

    def world(self, joints: Sequence[int], start: int, stop: int) -> World:
        stop = min(stop, self.frame_count)
        pos, quat = np.empty((stop - start, len(joints), 3)), np.empty((stop - start, len(joints), 4))
        for first in range(start, stop, FRAMES_AT_ONCE):
            part = self.rows[0][first : min(first + FRAMES_AT_ONCE, stop)]
            points = {name: part[:, 3 * column : 3 * column + 3] for column, name in enumerate(self.names)}
            place, turn = body_poses(points)
            rows = slice(first - start, first - start + len(part))
            pos[rows], quat[rows] = place[:, list(joints)], turn[:, list(joints)]
        return pos, quat


def read_c3d(path: Path) -> RawMotion:
    """Read the person in a C3D file. Raises FileError, or OSError on disk errors."""
    check_size(path)
    with path.open("rb") as stream, warnings.catch_warnings(action="ignore"), reported_damage(path, "a C3D file"):
        reader = c3d.Reader(stream)
        columns = _columns(path, _labels(reader))
        frames, rate = _frame_count(path, reader), _rate(path, reader)
        values = page_memory.empty((frames, 3 * len(columns)))
        _read_points(path, reader, tuple(columns.values()), values)
        units = reader.get("POINT:UNITS")
        declared = "" if units is None else str(units.string_value).strip(" \0")
    poses = PointPoses(names=tuple(columns), rows=(values,))
    offsets = _rest_offsets(path, poses)
    unit, notes = _unit(declared, offsets)
    return RawMotion(
        format="c3d",
        joint_names=BODIES,
        parents=PARENT,
        rest_offset=offsets,
        poses=poses,
        fps=rate,
        files=(path,),
        unit=unit,
        notes=notes,
    )


def _labels(reader: c3d.Reader) -> list[str]:
    """Names of the points; lists of more than 255 continue in LABELS2, LABELS3, …"""
    group = reader.get("POINT")
    if group is None:
        return []
    names: list[str] = []
    for number in range(1, 1 + reader.point_used // 255 + 1):
        listed = group.get("LABELS" if number == 1 else f"LABELS{number}")
        names += [] if listed is None else [str(each).strip(" \0") for each in np.ravel(listed.string_array)]
    return names[: reader.point_used]


def _columns(path: Path, labels: list[str]) -> dict[str, int]:
    """Column of each point that is used, by its name without the subject's. Raises FileError."""
    by_subject: dict[str, dict[str, int]] = {}
    for column, label in enumerate(labels):
        subject, _, name = label.rpartition(":")
        if name.upper() in WANTED:
            by_subject.setdefault(subject, {}).setdefault(name.upper(), column)
    whole = [subject for subject, found in by_subject.items() if not missing_points(frozenset(found))]
    if len(whole) > 1:
        listed = ", ".join(f"'{subject[:40]}'" for subject in whole[:5])
        raise FileError(path, f"it holds {len(whole)} people ({listed}).", "Export a file for each of them.")
    if whole:
        return by_subject[whole[0]]
    best = max(by_subject.values(), key=len, default={})
    missing = missing_points(frozenset(best))
    held = ", ".join(label[:20] for label in labels[:12]) or "no named points"
    raise FileError(
        path,
        f"its points are not those of Plug-in Gait (CGM): {', '.join(missing[:12])} {_are(missing)} missing; it holds "
        f"{held}.",
        "Rename them, run the model in the capture program so that its bones (PELO, LFEO, ...) are in the file, or "
        "solve a skeleton there and export BVH.",
    )


def _are(missing: tuple[str, ...]) -> str:
    return "is" if len(missing) == 1 else f"and {len(missing) - 12} more are" if len(missing) > 12 else "are"


def _rate(path: Path, reader: c3d.Reader) -> float:
    """Frames per second [Hz]. Raises FileError if there is none, since the number of analog samples per frame depends
    on it."""
    rate = float(reader.point_rate)
    if not 0.0 < rate < np.inf:
        raise FileError(path, f"POINT:RATE is {rate:g} Hz.", "Export it again with its rate.")
    return rate


def _frame_count(path: Path, reader: c3d.Reader) -> int:
    """Frames of the file, checked against its size before memory is allocated. Raises FileError."""
    frames, points = int(reader.last_frame) - int(reader.first_frame) + 1, int(reader.point_used)
    word = 4 if reader.point_scale < 0 else 2
    refuse_pose(path, max(frames, 0))
    if frames > MAX_FRAMES or 3 * frames * points > 10 * MAX_NUMBERS:
        raise FileError(path, f"{frames} frames of {points} points are more than are allowed.", "Split it.")
    if frames * points * 4 * word > path.stat().st_size:
        problem = f"the header declares {frames} frames of {points} points, more than its bytes hold."
        raise FileError(path, problem, "It was cut off; export it again.")
    return frames


def _read_points(path: Path, reader: c3d.Reader, columns: tuple[int, ...], values: Float[np.ndarray, "t c"]) -> None:
    """Read all frames. An unobserved point has a negative residual, or is at zero or far away."""
    count = 0
    for count, (_, points, _) in enumerate(reader.read_frames(copy=False, analog_transform=False), start=1):
        place = points[list(columns)]
        size = np.abs(place[:, :3]).max(axis=1)
        gone = (place[:, 3] < 0.0) | (size == 0.0) | (size > FARTHEST)
        values[count - 1] = np.where(gone[:, None], np.nan, place[:, :3]).reshape(-1)
    if count < len(values):
        problem = f"the header declares {len(values)} frames, the file holds {count}."
        raise FileError(path, problem, "It was cut off; export it again.")


def _rest_offsets(path: Path, poses: PointPoses) -> Float[np.ndarray, "19 3"]:
    """Offset of each body in its parent's frame, median over frames. Raises FileError if a body is in no frame."""
    pos, quat = poses.world(range(len(BODIES)), 0, min(poses.frame_count, MEASURED_FRAMES))
    places = in_parents(pos, quat, PARENT)
    unknown = np.asarray(~np.isfinite(places).all(axis=2).any(axis=0))
    if unknown[1:].any():
        body = BODIES[1 + int(np.argmax(unknown[1:]))].replace("_", " ")
        problem = f"no frame has all points from which the {body} is worked out."
        raise FileError(path, problem, "Fill the gaps in the capture program.")
    return np.nanmedian(places, axis=0)


def _unit(declared: str, offsets: Float[np.ndarray, "19 3"]) -> tuple[str | None, tuple[Reason, ...]]:
    """The declared unit; None, with a note, if the legs are then not human: the unit is then inferred."""
    leg = sum(float(np.linalg.norm(offsets[BODIES.index(name)])) for name in ("left_knee", "left_ankle"))
    unit = declared.strip().lower()
    if unit not in METRES:
        return None, ()
    if STATED_LEG_MIN <= leg * METRES[unit] <= STATED_LEG_MAX:
        return unit, ()
    text = (
        f"POINT:UNITS is '{unit}', in which a leg is {leg * METRES[unit]:.3g} m long; the unit is inferred from the leg"
    )
    return None, (Reason(code="unit", text=text, effect="noted", value=leg * METRES[unit], unit="m"),)
