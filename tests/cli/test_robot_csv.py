"""The CSV of a robot clip, read back by the project's own reader and by plain Python."""

import csv

import numpy as np
import pytest

from pipeline import rotation
from pipeline.cli.retarget_command import ROOT_COLUMNS, encode_csv
from pipeline.readers import read_motion
from tests.factories.figures import standing_robot, tumbling_robot


def test_the_reader_reads_back_what_was_written(robot, tmp_path):
    clip = standing_robot(robot).resampled(30.0)
    path = tmp_path / "nod.csv"
    path.write_text(encode_csv(clip, {"source": "made, by: hand\nin two lines"}))
    back = read_motion(path, "nod").clip
    assert back.fps == 30.0 and back.robot == "t1" and back.joint_names == clip.joint_names
    assert np.abs(back.root_pos_w - clip.root_pos_w).max() < 1e-8
    assert np.abs(back.joint_pos - clip.joint_pos).max() < 1e-8
    assert rotation.angle_between(back.root_quat_w, clip.root_quat_w).max() < 1e-7


def test_the_quaternion_is_xyzw_under_its_names(robot):
    clip = tumbling_robot(robot, frame_count=3)
    lines = [line for line in encode_csv(clip, {}).splitlines() if not line.startswith("#")]
    rows = list(csv.DictReader(lines))
    assert tuple(rows[0])[:7] == ROOT_COLUMNS and tuple(rows[0])[7:] == robot.joint_names
    for frame, row in enumerate(rows):
        for part, value in zip("wxyz", clip.root_quat_w[frame], strict=True):
            assert float(row[f"quat_{part}"]) == pytest.approx(value, abs=1e-8)
        for joint, value in zip(robot.joint_names, clip.joint_pos[frame], strict=True):
            assert float(row[joint]) == pytest.approx(value, abs=1e-8)


def test_robot_and_rate_stand_at_the_top_a_line_each(robot):
    lines = encode_csv(standing_robot(robot, fps=29.97), {"frame": "world"}).splitlines()
    assert lines[:3] == ["# robot: t1", "# fps: 29.97", "# frame: world"]
    assert "-0.00000000" not in "".join(lines)
