"""Encoding of motions as thick lines, which the browser draws in thumbnails and playback.

Each shape of a figure becomes one line with round ends: a capsule exactly, a box or ellipsoid along its longest side.
Positions are integer multiples of `STEP_M`, relative to the figure's first position on the ground.

    bytes: length of the head (uint32, little-endian), head (JSON, padded to a multiple of 4), int16 positions
    head:  {"figures": [{name, fps, frames, lines, radius [m], color, foot, heading, contacts}, …], "step_m": …}
    positions of a figure: frames x lines x (start xyz, end xyz); `MISSING` if a part is missing
"""

import json
import struct
from collections.abc import Sequence
from typing import Any

import numpy as np
from jaxtyping import Float

from pipeline import rotation, time_series
from pipeline.viewing.figure import Figure, Shape

STEP_M = 0.002
MISSING = -32768
_LARGEST = 32767

LEAST_HALF_M = 0.002
"""Minimum half length of a line [m]; browsers draw no lines of length zero."""


def encode(figures: Sequence[Figure], frames: Sequence[np.ndarray] | None = None) -> bytes:
    """Encode figures deterministically.

    Args:
        figures: figures to encode
        frames: indices of the frames to keep, for each figure; None: all frames
    """
    heads, parts = [], []
    for place, figure in enumerate(figures):
        kept = np.arange(figure.frame_count) if frames is None else frames[place]
        lines = lines_w(figure, kept)
        heads.append(_head(figure, kept))
        parts.append(_steps(lines, figure, kept).tobytes())
    head = json.dumps({"figures": heads, "step_m": STEP_M}, allow_nan=False, separators=(",", ":")).encode()
    head += b" " * (-len(head) % 4)
    return b"".join([struct.pack("<I", len(head)), head, *parts])


def lines_w(figure: Figure, frames: np.ndarray) -> Float[np.ndarray, "t n 2 3"]:
    """Start and end of the line of each shape in the world frame [m]; NaN if a part is missing."""
    owner = np.repeat(np.arange(len(figure.parts)), [len(part.shapes) for part in figure.parts])
    shapes = [shape for part in figure.parts for shape in part.shapes]
    ends = np.array([_ends(shape) for shape in shapes])  # n 2 3, in the part's frame
    quat, pos = figure.quat_w[frames][:, owner, None], figure.pos_w[frames][:, owner, None]
    both = (*pos.shape[:2], 2)
    return pos + rotation.rotate(np.broadcast_to(quat, (*both, 4)), np.broadcast_to(ends, (*both, 3)))


def _ends(shape: Shape) -> np.ndarray:
    """Ends of a shape's line in the frame of its part [m]. Shape (2, 3)."""
    axis, half, _ = _measures(shape)
    direction = rotation.rotate(np.array(shape.quat), np.eye(3)[axis]) * max(half, LEAST_HALF_M)
    return np.array(shape.pos) + np.stack([-direction, direction])


def _measures(shape: Shape) -> tuple[int, float, float]:
    """Index of the axis of a shape's line, its half length without round ends [m], and its radius [m]."""
    size = shape.size
    if shape.kind in ("capsule", "cylinder"):
        half = size[1] if shape.kind == "capsule" else max(size[1] - size[0], 0.0)
        return 2, half, size[0]
    if shape.kind == "sphere":
        return 2, 0.0, size[0]
    axis = int(np.argmax(size))
    radius = float(np.mean([each for place, each in enumerate(size) if place != axis]))
    return axis, max(size[axis] - radius, 0.0), radius


def _head(figure: Figure, frames: np.ndarray) -> dict[str, Any]:
    shapes = [(part.foot, shape) for part in figure.parts for shape in part.shapes]
    fps = figure.fps if len(frames) < 2 else figure.fps / float(frames[1] - frames[0])
    return {
        "name": figure.name,
        "fps": round(fps, 6),
        "frames": len(frames),
        "lines": len(shapes),
        "radius": [round(_measures(shape)[2], 4) for _, shape in shapes],
        "color": ["#" + "".join(f"{round(255 * value):02x}" for value in shape.color) for _, shape in shapes],
        "foot": [-1 if foot is None else foot for foot, _ in shapes],
        "heading": round(figure.first_heading, 4),
        "contacts": _contacts(figure),
    }


def _contacts(figure: Figure) -> list[list[list[float]]] | None:
    """Contact intervals of each foot as [start, stop] [s]; None if unknown."""
    if figure.contacts is None:
        return None
    feet = (np.asarray(column, dtype=bool) for column in zip(*figure.contacts, strict=True))
    return [
        [[round(start / figure.fps, 4), round(stop / figure.fps, 4)] for start, stop in time_series.runs(foot)]
        for foot in feet
    ]


def _steps(lines: np.ndarray, figure: Figure, frames: np.ndarray) -> np.ndarray:
    """Positions in multiples of `STEP_M` from the first known ground position of the figure, little-endian int16."""
    roots = figure.root_pos_w[frames]
    known = np.flatnonzero(np.isfinite(roots).all(axis=1))
    origin = roots[known[0]] * np.array([1.0, 1.0, 0.0]) if len(known) else np.zeros(3)
    steps = np.clip(np.round((lines - origin) / STEP_M), -_LARGEST, _LARGEST)
    missing = np.logical_not(np.all(np.isfinite(lines), axis=(2, 3), keepdims=True))
    return np.where(missing, MISSING, np.nan_to_num(steps)).astype("<i2")
