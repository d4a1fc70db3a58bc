"""Difficult inputs that were made from files in the wild: each gives the result that its `expected.md` asks for."""

import json

import numpy as np
import pytest

from pipeline import rotation
from pipeline.cli.main import main
from pipeline.errors import FileError
from pipeline.readers import Statement, read_motion

pytestmark = pytest.mark.shared


def read(cases, name, **stated):
    return read_motion(cases / name, "clip", Statement(**stated))


@pytest.mark.parametrize(
    ("file", "skeleton", "seconds", "speed"),
    [
        ("mixamo_names/mixamo.bvh", "by_structure", 2.5, 0.71),
        ("toebase_instead_of_toe/toebase_plain.bvh", "by_structure", 2.5, 0.71),
        ("xsens_motionbuilder_names/xsens_t.bvh", "by_structure", 2.5, 0.71),
        ("xsens_motionbuilder_names/xsens_n.bvh", "by_structure", 2.5, 0.71),
        ("map_with_arms_down_traceback/suit_arms_down.bvh", "by_structure", 2.5, 0.71),
        ("cmu_subject01_taken_for_pfnn/cmu_subject01.bvh", "cmu", 2.5, 0.71),
        ("namespace_prefix/namespace.bvh", "booster_lab", 5.0, 0.73),
        ("namespace_prefix/character.bvh", "booster_lab", 5.0, 0.73),
        ("frame_count_off_by_one/one_row_more.bvh", "booster_lab", 5.0, 0.73),
        ("frame_count_off_by_one/placeholder.bvh", "booster_lab", 5.0, 0.73),
    ],
)
def test_skeletons_are_read_by_themselves(cases, file, skeleton, seconds, speed):
    found = read(cases, file)
    clip = found.clip
    assert (found.skeleton, found.up_axis) == (skeleton, "y")
    assert clip.duration_s == pytest.approx(seconds)
    way = np.linalg.norm(np.diff(clip.pos("pelvis")[:, :2], axis=0), axis=1).sum()
    assert way / seconds == pytest.approx(speed, abs=0.03)
    codes = [note.code for note in found.notes]
    assert codes == (["frame_count"] if file.startswith("frame_count") else [])


@pytest.mark.parametrize(
    "file",
    [
        *("mixamo_names/mixamo.bvh", "toebase_instead_of_toe/toebase_plain.bvh", "skate_speed_nan/leap.bvh"),
        *("cmu_subject01_taken_for_pfnn/cmu_subject01.bvh", "namespace_prefix/namespace.bvh"),
        *("namespace_prefix/character.bvh", "folder_with_other_formats/motions/good.bvh"),
    ],
)
def test_inspect_finds_nothing_wrong_with_sound_motions(cases, capsys, file):
    assert main(["inspect", str(cases / file)]) == 0
    assert "found: no defects" in capsys.readouterr().out


@pytest.mark.parametrize("pose", "tn")
def test_inspect_finds_only_the_height_of_the_ground_in_the_xsens_files(cases, capsys, pose):
    """Their toes stand 6 cm above z = 0, of which 3.7 cm are more than a ball of a foot has; nothing is lost."""
    assert main(["inspect", "--json", str(cases / f"xsens_motionbuilder_names/xsens_{pose}.bvh")]) == 0
    found = json.loads(capsys.readouterr().out)
    assert [(each["code"], each["effect"]) for each in found["reasons"]] == [("floor_offset", "repaired")]
    assert found["usable_seconds"] == pytest.approx(2.5)


def test_a_t_pose_and_hanging_arms_at_rest_give_the_same_motion(cases):
    t, n = (read(cases, f"xsens_motionbuilder_names/xsens_{pose}.bvh").clip for pose in "tn")
    assert np.abs(t.body_pos_w - n.body_pos_w).max() < 1e-3
    assert np.rad2deg(rotation.angle_between(t.body_quat_w, n.body_quat_w)).max() < 0.1


def test_a_map_for_another_rest_pose_is_refused_in_a_sentence(cases):
    folder = cases / "map_with_arms_down_traceback"
    says = r"left_shoulder 'down' \(to LeftElbow\) and 'left' \(y\), which lie along one line in this file's rest pose"
    with pytest.raises(FileError, match=says):
        read_motion(folder / "suit_arms_down.bvh", "clip", Statement(skeleton=str(folder / "suit_map.yaml")))


def test_smplx_archives_without_poses_are_the_same_motion(cases):
    plain, split = (read(cases, f"smplx_without_poses/{name}.npz").clip for name in ("with_poses", "no_poses"))
    assert plain.fps == split.fps
    np.testing.assert_array_equal(plain.body_pos_w, split.body_pos_w)
    np.testing.assert_array_equal(plain.body_quat_w, split.body_quat_w)


def test_isaacs_joint_order_is_inferred_without_names(cases):
    named, bare = (read(cases, f"isaac_lab_joint_order/t1_breadth_first{end}.npz") for end in ("_names", ""))
    np.testing.assert_array_equal(named.clip.joint_pos, bare.clip.joint_pos)
    assert ([note.code for note in named.notes], [note.code for note in bare.notes]) == ([], ["joint_order"])


def test_another_robots_table_says_so_at_once(cases):
    with pytest.raises(FileError, match=r"29 joints without names; the robots here are k1 \(22\), t1 \(23\)"):
        read(cases, "g1_csv_message/g1_like_29.csv")


@pytest.mark.parametrize("file", ["t1_wxyz_180", "t1_wxyz_140", "t1_xyzw_180"])
def test_a_robot_that_faces_back_walks_forward_whatever_the_quaternions_order(cases, file):
    clip = read(cases, f"robot_csv_wxyz_faces_back/{file}.csv").clip
    ahead = rotation.rotate(clip.root_quat_w, np.array([1.0, 0.0, 0.0]))[:-1]
    velocity = np.diff(clip.root_pos_w, axis=0) * clip.fps
    assert np.mean(np.sum(ahead * velocity, axis=1)) == pytest.approx(0.43, abs=0.02)


def test_a_rate_that_qvel_contradicts_is_named_with_both_rates(cases):
    found = read(cases, "robot_rate_against_qvel/run_250Hz_said_500Hz_true.npz")
    assert found.clip.fps == 500.0
    assert [(note.code, note.effect) for note in found.notes] == [("time_base", "repaired")]
    assert "states 250 Hz" in found.notes[0].text and "500 Hz" in found.notes[0].text
