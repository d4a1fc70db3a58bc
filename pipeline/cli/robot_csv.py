"""A robot clip as CSV, in the form that `pipeline.readers` reads back.

# robot: t1
# fps: 50
root_x,root_y,root_z,quat_x,quat_y,quat_z,quat_w,<joint>,...
0.00000000,...
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from pipeline.clips.robot_clip import RobotClip

ROOT_COLUMNS = ("root_x", "root_y", "root_z", "quat_x", "quat_y", "quat_z", "quat_w")
"""Position of the root link [m] and its quaternion xyzw, world frame."""

DECIMALS = 8
"""10 nm, 10 nrad."""


def encode_csv(clip: RobotClip, comments: Mapping[str, str]) -> str:
    """The clip's text: robot, rate and `comments` a line each, the header, a row a frame."""
    head = {"robot": clip.robot, "fps": f"{clip.fps:.10g}", **comments}
    lines = [f"# {name}: {' '.join(value.split())}" for name, value in head.items()]
    lines.append(",".join((*ROOT_COLUMNS, *clip.joint_names)))
    quat_xyzw = np.roll(clip.root_quat_w, -1, axis=1)
    values = np.concatenate([clip.root_pos_w, quat_xyzw, clip.joint_pos], axis=1)
    values = np.round(values, DECIMALS) + 0.0  # no negative zero
    row_format = ",".join([f"%.{DECIMALS}f"] * values.shape[1])
    lines += [row_format % tuple(row) for row in values.tolist()]
    return "\n".join(lines) + "\n"
