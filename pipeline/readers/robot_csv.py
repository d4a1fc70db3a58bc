"""Robot trajectories as CSV: root xyz, root quaternion, then the joints [rad].

With a header (as `booster-lab retarget` writes) or without (as booster_assets and the retargeted LAFAN1 set publish,
quaternion xyzw; wxyz is inferred from the kinematics). The rate is stated by a first line `# fps: 50`, a column
`time_s`, or in data/sources.yaml.
"""

import itertools
import re
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from pipeline.errors import FileError
from pipeline.readers.robot_motion import RobotMotion
from pipeline.readers.text_file import open_text, read_table, to_float

ROOT = 7
MOST_COMMENTS = 1000
"""Lines of comments that are searched for the rate."""
MAX_RATE_ERROR = 0.02
"""Largest deviation of the stated rate from that of the times, as a share of it."""


def read_robot_csv(path: Path) -> RobotMotion:
    """A robot's motion. Raises FileError with the line."""
    text = open_text(path)
    comments: list[str] = []
    lines = enumerate(_without_comments(text.lines(), comments), start=1)
    first = next(((number, line) for number, line in lines if line.strip()), None)
    cells = [] if first is None else [cell.strip() for cell in first[1].split(",")]
    header = cells if first is not None and not _is_number(cells[0]) else None
    if header is not None:
        first = next(((number, line) for number, line in lines if line.strip()), None)
    if first is None:
        raise FileError(path, "the file has no frames.")
    width = len(cells)
    if width <= ROOT:
        raise FileError(path, f"a row has {width} columns, wanted root xyz, quaternion xyzw and the joints.", line=1)
    values = read_table(path, itertools.chain([first], lines), text.line_count, width, comma=True)
    rates = (re.fullmatch(r"\s*#\s*fps\s*[:=]\s*([0-9.eE+-]+)\s*", comment) for comment in comments)
    fps = next((float(rate.group(1)) for rate in rates if rate and _is_number(rate.group(1))), None)
    rate_fault = None
    if header is not None and "time_s" in header:
        fps, rate_fault = _rate(path, values[:, header.index("time_s")], fps)
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
        rate_fault=rate_fault,
    )


def _without_comments(lines: Iterator[str], comments: list[str]) -> Iterator[str]:
    """The lines, blank ones in place of comments, which are put into a list."""
    for line in lines:
        is_comment = line.lstrip().startswith("#")
        if is_comment and len(comments) < MOST_COMMENTS:
            comments.append(line)
        yield "" if is_comment else line


def _is_number(cell: str) -> bool:
    try:
        to_float(cell)
    except ValueError:
        return False
    return True


def _rate(path: Path, time_s: np.ndarray, commented: float | None) -> tuple[float | None, FileError | None]:
    """The rate [Hz] of a comment, or that of the times, which have to agree; or why there is none."""
    step_s = np.diff(time_s)
    uneven = not len(step_s) or not np.isfinite(step_s).all() or np.ptp(step_s) > 0.02 * np.median(step_s)
    if uneven or np.median(step_s) <= 0.0:
        do = "State `fps:` for it in data/sources.yaml, or correct the times."
        return None, FileError(path, "the times in 'time_s' do not increase in even steps.", do)
    timed = float(1.0 / np.mean(step_s))
    if commented is not None and abs(commented - timed) > MAX_RATE_ERROR * timed:
        problem = f"its comment states {commented:g} Hz, and its times 'time_s' are {timed:g} Hz apart."
        return None, FileError(path, problem, "Remove or correct one of them, or state `fps:` in data/sources.yaml.")
    return commented or timed, None


def _quaternion_columns(path: Path, header: list[str]) -> list[int]:
    """Columns of the root's quaternion in the order wxyz, by name."""
    letters = [name[-1:].lower() for name in header[:ROOT]]
    if letters[:3] != ["x", "y", "z"] or sorted(letters[3:]) != ["w", "x", "y", "z"]:
        got = ", ".join(header[:ROOT])[:120]
        do = "Name them root_x, root_y, root_z, quat_x, quat_y, quat_z, quat_w."
        raise FileError(path, f"the first seven columns are {got}.", do, line=1)
    return [3 + letters[3:].index(letter) for letter in "wxyz"]
