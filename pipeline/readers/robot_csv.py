"""Robot trajectories as CSV: root xyz, root quaternion, then the joints [rad].

With a header (as `booster-lab retarget` writes) or without (as booster_assets and the retargeted LAFAN1 set publish,
quaternion xyzw; wxyz is inferred from the kinematics). The rate is
stated by a first line `# fps: 50`, a column `time_s`, or in data/sources.yaml.
"""

from __future__ import annotations

import itertools
import re
from collections.abc import Iterator
from pathlib import Path

import numpy as np
from jaxtyping import Float

from pipeline.errors import FileError
from pipeline.files import page_memory
from pipeline.files.array_file import ROWS_AT_ONCE, known_numbers
from pipeline.readers.robot_motion import RobotMotion
from pipeline.readers.text_file import MAX_FRAMES, open_text, to_float

ROOT = 7
MOST_COMMENTS = 1000
"""Lines of comments that are read."""
MAX_RATE_ERROR = 0.02
"""Largest deviation of the stated rate from that of the times, as a share of it."""


def read_robot_csv(path: Path) -> RobotMotion:
    """A robot's motion. Raises FileError with the line."""
    text = open_text(path)
    comments: list[str] = []
    rows = _rows(text.lines(), comments)
    first = next(rows, None)
    header = first[1] if first is not None and not _is_number(first[1][0]) else None
    if header is not None:
        first = next(rows, None)
    if first is None:
        raise FileError(path, "the file has no frames.")
    width = len(header or first[1])
    if width <= ROOT:
        raise FileError(path, f"a row has {width} columns, wanted root xyz, quaternion xyzw and the joints.", line=1)
    values = _values(path, itertools.chain([first], rows), width, text.line_count)
    fps = _commented_fps(comments)
    if header is not None and "time_s" in header:
        time_s = values[:, header.index("time_s")]
        fps = _one_rate(path, fps, _rate(path, time_s))
        values = np.delete(values, header.index("time_s"), axis=1)
        header = [name for name in header if name != "time_s"]
    columns = [3, 4, 5, 6] if header is None else _quaternion_columns(path, header)
    return RobotMotion(
        format="robot_csv",
        path=path,
        root_pos_w=values[:, :3],
        root_quat=values[:, columns],
        quat_order="xyzw" if header is None else "wxyz",
        order_is_certain=header is not None,
        joint_pos=values[:, ROOT:],
        joint_names=tuple(header[ROOT:]) if header is not None else None,
        fps=fps,
    )


def _rows(lines: Iterator[str], comments: list[str]) -> Iterator[tuple[int, list[str]]]:
    """Number and cells of each line that holds any; comments are put into a list."""
    for number, line in enumerate(lines, start=1):
        if line.lstrip().startswith("#"):
            if len(comments) < MOST_COMMENTS:
                comments.append(line)
        elif line.strip():
            yield number, _cells(line)


def _values(path: Path, rows: Iterator[tuple[int, list[str]]], width: int, lines: int) -> Float[np.ndarray, "t c"]:
    """The numbers of all rows. Raises FileError with the line."""
    values = page_memory.empty((min(lines, path.stat().st_size // (2 * width) + 1, MAX_FRAMES), width))
    count = 0
    for number, cells in rows:
        if count == MAX_FRAMES:
            raise FileError(path, f"it has more than the {MAX_FRAMES} frames allowed.")
        values[count] = _numbers(path, number, cells, width)
        count += 1
    for start in range(0, count, ROWS_AT_ONCE):
        values[start : start + ROWS_AT_ONCE] = known_numbers(values[start : start + ROWS_AT_ONCE])
    return values[:count]


def _cells(line: str) -> list[str]:
    return [cell.strip() for cell in line.split(",")]


def _is_number(cell: str) -> bool:
    try:
        to_float(cell)
    except ValueError:
        return False
    return True


def _numbers(path: Path, line: int, cells: list[str], width: int) -> list[float]:
    if len(cells) != width:
        raise FileError(path, f"the row has {len(cells)} numbers, wanted {width}.", line=line)
    try:
        values = [to_float(cell) for cell in cells]
    except ValueError as error:
        raise FileError(path, f"{error}.", line=line) from error
    return values


def _commented_fps(comments: list[str]) -> float | None:
    for comment in comments:
        found = re.fullmatch(r"\s*#\s*fps\s*[:=]\s*([0-9.eE+-]+)\s*", comment)
        if found and _is_number(found.group(1)):
            return float(found.group(1))
    return None


def _rate(path: Path, time_s: np.ndarray) -> float:
    step_s = np.diff(time_s)
    if not len(step_s) or not np.isfinite(step_s).all() or np.ptp(step_s) > 0.02 * np.median(step_s):
        raise FileError(path, "the times in 'time_s' are not evenly spaced.")
    return float(1.0 / np.mean(step_s))


def _one_rate(path: Path, commented: float | None, timed: float) -> float:
    """The rate [Hz] of the comment, which that of the times must be. Raises FileError."""
    if commented is not None and abs(commented - timed) > MAX_RATE_ERROR * timed:
        problem = f"its comment states {commented:g} Hz, and its times 'time_s' are {timed:g} Hz apart."
        raise FileError(path, problem, "Remove or correct one of them.")
    return commented or timed


def _quaternion_columns(path: Path, header: list[str]) -> list[int]:
    """Columns of the root's quaternion in the order wxyz, by name."""
    letters = [name[-1:].lower() for name in header[:ROOT]]
    if letters[:3] != ["x", "y", "z"] or sorted(letters[3:]) != ["w", "x", "y", "z"]:
        got = ", ".join(header[:ROOT])[:120]
        do = "Name them root_x, root_y, root_z, quat_x, quat_y, quat_z, quat_w."
        raise FileError(path, f"the first seven columns are {got}.", do, line=1)
    return [3 + letters[3:].index(letter) for letter in "wxyz"]
