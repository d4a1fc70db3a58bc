"""Robot trajectories as CSV: root xyz, root quaternion and joints [rad].

With a header (`booster-lab retarget`) columns are found by name; without one (booster_assets, the retargeted LAFAN1
set) the root is first, its quaternion xyzw (wxyz is inferred from the kinematics). The rate
is stated by a first line `# fps: 50`, a column `time_s`, or in data/sources.yaml. `# robot: k1` decides between robots
with the same joints.
"""

import itertools
import re
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from pipeline.errors import FileError
from pipeline.readers.robot_motion import RobotMotion
from pipeline.readers.text_file import open_text, read_table, to_float
from pipeline.readers.velocity_rate import STANDARD_HZ, STATE_RATE

ROOT = 7
"""Number of root columns, which are the first ones in a file without header."""
POSITION = ("root_x", "root_y", "root_z")
QUATERNION = ("quat_w", "quat_x", "quat_y", "quat_z")
TIME = "time_s"
"""Column of times, relative to the first frame or since 1970."""
MOST_COMMENTS = 1000
"""Most comment lines that are searched for the rate."""
MAX_RATE_ERROR = 0.02
"""Largest deviation of the stated rate from that of the times, as a share of it."""


def read_robot_csv(path: Path) -> RobotMotion:
    """Read a robot's motion. Raises FileError with the line."""
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
        raise FileError(
            path, f"a row has {width} columns, expected root xyz, quaternion xyzw and the joints.", line=top
        )
    time = header.index(TIME) if header is not None and TIME in header else None
    rows = itertools.chain([first], lines)
    values = read_table(path, rows, text.line_count, width, comma=True, any_size=time)
    stated = (re.fullmatch(r"\s*#\s*robot\s*[:=]\s*(\S+)\s*", comment) for comment in comments)
    robot = next((found.group(1) for found in stated if found), "")
    rates = (re.fullmatch(r"\s*#\s*fps\s*[:=]\s*([0-9.eE+-]+)\s*", comment) for comment in comments)
    fps = next((float(rate.group(1)) for rate in rates if rate and _is_number(rate.group(1))), None)
    rate_fault = None
    if header is not None and time is not None:
        fps, rate_fault = _rate(path, values[:, time], fps)
        values = np.delete(values, time, axis=1)
        header = [name for name in header if name != TIME]
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
        robot=robot,
        fps=fps,
        rate_fault=rate_fault,
    )


def _without_comments(lines: Iterator[str], comments: list[str]) -> Iterator[str]:
    """Replace comments by blank lines and collect them in `comments`."""
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
    """The rate [Hz] from a comment or the times, which must agree; or the error."""
    timed = _timed_rate(time_s)
    if timed is None:
        return None, FileError(path, f"the times in '{TIME}' do not increase in even steps.", STATE_RATE)
    if commented is not None and abs(commented - timed) > MAX_RATE_ERROR * timed:
        problem = f"its comment states {commented:g} Hz, and its times 'time_s' give {timed:g} Hz."
        return None, FileError(path, problem, f"Remove or correct one of them. {STATE_RATE}")
    return commented or timed, None


def _timed_rate(time_s: np.ndarray) -> float | None:
    """The rate [Hz] of evenly spaced times, corrected for rounding of printed times; None if the steps are uneven."""
    step_s = np.diff(time_s)
    if not len(step_s) or not np.isfinite(step_s).all() or step_s.min() <= 0.0:
        return None
    duration_s, mean_s = float(time_s[-1] - time_s[0]), float(np.mean(step_s))
    if np.ptp(step_s) <= MAX_UNEVEN * np.median(step_s):
        return 1.0 / mean_s
    digit_s = next((unit for unit in PRINTED_S if _are_multiples(time_s, unit)), None)
    if digit_s is None or digit_s > 0.5 * mean_s:
        return None
    away_s = np.abs(time_s - (time_s[0] + mean_s * np.arange(len(time_s))))
    if max(away_s.max(), np.abs(step_s - mean_s).max()) > 1.01 * digit_s:
        return None
    usual = [rate for rate in STANDARD_HZ if abs(rate * mean_s - 1.0) <= digit_s / duration_s]
    return float(usual[0]) if len(usual) == 1 else 1.0 / mean_s


MAX_UNEVEN = 0.02
"""Largest difference of two steps of time, as a share of a step."""
PRINTED_S = (0.1, 0.01, 0.001, 0.0001)
"""Last digit of times that are printed rounded [s]."""


def _are_multiples(time_s: np.ndarray, unit: float) -> bool:
    digits = time_s / unit
    return bool(np.abs(digits - np.round(digits)).max() < 0.01)


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
