"""Difficult inputs that were made from files in the wild: each gives the result that its `expected.md` asks for."""

import numpy as np
import pytest

from pipeline import rotation
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


def test_a_t_pose_and_hanging_arms_at_rest_give_the_same_motion(cases):
    t, n = (read(cases, f"xsens_motionbuilder_names/xsens_{pose}.bvh").clip for pose in "tn")
    assert np.abs(t.body_pos_w - n.body_pos_w).max() < 1e-3
    assert np.rad2deg(rotation.angle_between(t.body_quat_w, n.body_quat_w)).max() < 0.1


def test_a_map_for_another_rest_pose_is_refused_in_a_sentence(cases):
    folder = cases / "map_with_arms_down_traceback"
    says = r"left_shoulder 'down' \(to LeftElbow\) and 'left' \(y\), which lie along one line in this file's rest pose"
    with pytest.raises(FileError, match=says):
        read_motion(folder / "suit_arms_down.bvh", "clip", Statement(skeleton=str(folder / "suit_map.yaml")))
