"""`booster-lab score`: motions that the project made itself, and such that are known to be worse."""

import json

import numpy as np
import pytest

from pipeline.cli.main import main
from pipeline.cli.retarget_command import encode_csv
from pipeline.readers import read_motion
from pipeline.scoring import FIGURES


@pytest.fixture(scope="module")
def walk(root, tmp_path_factory):
    """Three seconds of the shipped walk."""
    lines = (root / "data/motions/walk.bvh").read_text().splitlines()
    start = next(index for index, line in enumerate(lines) if line.startswith("Frame Time")) + 1
    head = ["Frames: 180" if line.startswith("Frames:") else line for line in lines[:start]]
    short = tmp_path_factory.mktemp("human") / "walk3.bvh"
    short.write_text("\n".join([*head, *lines[start : start + 180]]) + "\n")
    return short


@pytest.fixture(scope="module")
def csv(walk):
    out = walk.with_name("robot.csv")
    assert main(["retarget", str(walk), "--fps", "30", "--out", str(out)]) == 0
    return out


def _figures(csv, walk, capsys, *more) -> dict:
    assert main(["score", str(csv), "--human", str(walk), "--json", *more]) == 0
    return json.loads(capsys.readouterr().out)


def test_a_retargeted_motion_is_within_the_limits_and_like_the_person(csv, walk, capsys):
    found = _figures(csv, walk, capsys)
    assert found["robot"] == "t1" and found["fps"] == 30.0 and 88 <= found["frames"] <= 91
    figures = found["figures"]
    assert set(figures) == {figure.key for figure in FIGURES}
    assert figures["position_limit_percent"] == figures["speed_limit_percent"] == 0.0
    assert figures["slip_middle_m_s"] < 0.02 and figures["limb_error_deg"] < 4.0
    assert figures["height_shift_mm"] < 5.0


def test_the_table_has_a_line_a_figure(csv, walk, capsys):
    assert main(["score", str(csv), "--human", str(walk)]) == 0
    said = capsys.readouterr().out
    assert all(figure.title in said for figure in FIGURES)


def test_a_bent_knee_and_a_raised_robot_show_in_their_figures_alone(csv, walk, tmp_path, capsys):
    clip = read_motion(csv, "clip").clip
    before = _figures(csv, walk, capsys)["figures"]
    joints, root = clip.joint_pos.copy(), clip.root_pos_w.copy()
    joints[:, clip.joint_names.index("Left_Elbow_Yaw")] -= 0.3
    root[:, 2] += 0.05
    changed = type(clip)(
        name="changed",
        fps=clip.fps,
        robot=clip.robot,
        joint_names=clip.joint_names,
        root_pos_w=root,
        root_quat_w=clip.root_quat_w,
        joint_pos=joints,
    )
    (tmp_path / "changed.csv").write_text(encode_csv(changed, {}))
    after = _figures(tmp_path / "changed.csv", walk, capsys)["figures"]
    # one of eight limbs is off by up to .3 rad = 17 degrees, which is 2 degrees of their mean
    assert 1.0 < after["limb_error_deg"] - before["limb_error_deg"] < 2.3
    assert after["height_shift_mm"] == pytest.approx(50.0 + before["height_shift_mm"], abs=3.0)
    for same in ("thigh_error_deg", "shank_error_deg", "trunk_error_deg", "slip_middle_m_s", "penetration_max_cm"):
        assert after[same] == pytest.approx(before[same], abs=1e-6)


def test_a_csv_without_a_rate_needs_it_stated(csv, walk, tmp_path, capsys):
    bare = tmp_path / "bare.csv"
    bare.write_text("\n".join(line for line in csv.read_text().splitlines() if not line.startswith("# fps")))
    found = _figures(bare, walk, capsys, "--fps", "30")
    assert found["figures"] == _figures(csv, walk, capsys)["figures"]


@pytest.mark.parametrize(
    ("change", "sentence"),
    [
        (lambda clip: clip.cut(0, 45, "half"), "after repair it is 3.0"),
        (lambda clip: clip, "is a human motion"),
    ],
)
def test_what_can_not_be_compared_is_one_sentence(csv, walk, tmp_path, capsys, change, sentence):
    if "human" in sentence:
        first = walk
    else:
        first = tmp_path / "other.csv"
        first.write_text(encode_csv(change(read_motion(csv, "clip").clip), {}))
    assert main(["score", str(first), "--human", str(walk)]) == 1
    said = capsys.readouterr()
    assert said.out == "" and sentence in said.err and said.err.count("\n") == 1


def test_a_robot_in_another_world_than_the_humans_is_refused(csv, walk, tmp_path, capsys):
    clip = read_motion(csv, "clip").clip
    turned = np.array([np.cos(1.0), 0.0, 0.0, np.sin(1.0)])
    from pipeline import rotation

    away = type(clip)(
        name="away",
        fps=clip.fps,
        robot=clip.robot,
        joint_names=clip.joint_names,
        root_pos_w=rotation.rotate(turned, clip.root_pos_w),
        root_quat_w=rotation.multiply(turned, clip.root_quat_w),
        joint_pos=clip.joint_pos,
    )
    (tmp_path / "away.csv").write_text(encode_csv(away, {}))
    assert main(["score", str(tmp_path / "away.csv"), "--human", str(walk)]) == 1
    assert "the robot faces 115 degrees away" in capsys.readouterr().err


def test_a_motion_with_a_number_that_is_missing_is_refused_with_its_frame(csv, walk, tmp_path, capsys):
    rows = csv.read_text().splitlines()
    rows[6] = ",".join([*rows[6].split(",")[:-1], "nan"])
    broken = tmp_path / "broken.csv"
    broken.write_text("\n".join(rows) + "\n")
    assert main(["score", str(broken), "--human", str(walk)]) == 1
    said = capsys.readouterr().err
    assert "broken.csv: it can't be scored: frame 0: joint_pos is not finite" in said
