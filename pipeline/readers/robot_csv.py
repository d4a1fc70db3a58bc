"""Robot trajectories as CSV: root xyz, root quaternion and joints [rad].

With a header (as `booster-lab retarget` writes) columns are found by name; without one (as booster_assets and the
retargeted LAFAN1 set publish) the root is first, its quaternion xyzw (wxyz is inferred from the kinematics). The rate
is stated by a first line `# fps: 50`, a column `time_s`, or in data/sources.yaml.
"""

import itertools
import re
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from pipeline.errors import FileError
from pipeline.readers.robot_motion import RobotMotion
from pipeline.readers.text_file import open_text, read_table, to_float
from pipeline.readers.velocity_rate import STATE_RATE

ROOT = 7
"""Columns of the root, the first ones where the file has no header."""
POSITION = ("root_x", "root_y", "root_z")
QUATERNION = ("quat_w", "quat_x", "quat_y", "quat_z")
MOST_COMMENTS = 1000
"""Lines of comments that are searched for the rate."""
MAX_RATE_ERROR = 0.02
"""Largest deviation of the stated rate from that of the times, as a share of it."""


def read_robot_csv(path: Path) -> RobotMotion:
    """A robot's motion. Raises FileError with the line."""
    text = open_text(path)
    comments: list[str] = []
    lines = enumerate(_without_comments(text.lines(), comments), start=1)
    filled = ((number, line) for number, line in lines if line.strip())
    top, line = next(filled, (1, ""))
    cells = [cell.strip() for cell in line.split(",")]
    header = None if _is_number(cells[0]) else cells
    for name in header or ():
        if cells.count(name) > 1:
            raise FileError(path, f"the header has the column '{name}' twice.", "Remove or rename one.", top)
    first = (top, line) if header is None else next(filled, None)
    if first is None:
        raise FileError(path, "the file has no frames.")
    width = len(cells)
    if width <= ROOT:
        raise FileError(path, f"a row has {width} columns, wanted root xyz, quaternion xyzw and the joints.", line=top)
    values = read_table(path, itertools.chain([first], lines), text.line_count, width, comma=True)
    rates = (re.fullmatch(r"\s*#\s*fps\s*[:=]\s*([0-9.eE+-]+)\s*", comment) for comment in comments)
    fps = next((float(rate.group(1)) for rate in rates if rate and _is_number(rate.group(1))), None)
    rate_fault = None
    if header is not None and "time_s" in header:
        fps, rate_fault = _rate(path, values[:, header.index("time_s")], fps)
        values = np.delete(values, header.index("time_s"), axis=1)
        header = [name for name in header if name != "time_s"]
    root = list(range(ROOT)) if header is None else _root_columns(path, header, top)
    joints = [column for column in range(values.shape[1]) if column not in root]
    return RobotMotion(
        format="robot_csv",
        path=path,
        root_pos_w=values[:, root[:3]],
        root_quat=values[:, root[3:]],
        quat_order="xyzw" if header is None else "wxyz",
        order_is_certain=header is not None,
        joint_pos=values[:, joints],
        joint_names=tuple(header[column] for column in joints) if header is not None else None,
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
        return None, FileError(path, "the times in 'time_s' do not increase in even steps.", STATE_RATE)
    timed = float(1.0 / np.mean(step_s))
    if commented is not None and abs(commented - timed) > MAX_RATE_ERROR * timed:
        problem = f"its comment states {commented:g} Hz, and its times 'time_s' are {timed:g} Hz apart."
        return None, FileError(path, problem, f"Remove or correct one of them. {STATE_RATE}")
    return commented or timed, None


def _root_columns(path: Path, header: list[str], line: int) -> list[int]:
    """Columns of the root's position and of its quaternion wxyz. Raises FileError with the names that are missing."""
    columns = {**_columns(header, POSITION, range(3)), **_columns(header, QUATERNION, range(3, ROOT))}
    missing = [name for name in (*POSITION, *QUATERNION) if name not in columns]
    if missing:
        do = f"Name the root's columns {', '.join((*POSITION, *QUATERNION))}, in any order."
        raise FileError(path, f"the header has no column {', '.join(missing)}.", do, line)
    return [columns[name] for name in (*POSITION, *QUATERNION)]


def _columns(header: list[str], names: tuple[str, ...], usual: range) -> dict[str, int]:
    """Columns of the names in a header. Where it lacks one, the usual columns may have other names with the same last
    letters, such as `qw` or `root_rot_w`, but not that of a joint's yaw."""
    found = [name.lower() for name in header]
    columns = {name: found.index(name) for name in names if name in found}
    letters = {found[column][-1:]: column for column in usual if not found[column].endswith("yaw")}
    usable = len(columns) < len(names) and set(letters) == {name[-1] for name in names}
    return {name: letters[name[-1]] for name in names} if usable else columns
