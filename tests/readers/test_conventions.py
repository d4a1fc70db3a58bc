"""One motion under many programs' names, rest poses, units and axes is one clip, read without a map of one's own."""

import itertools
import re

import numpy as np
import pytest

from pipeline import rotation
from pipeline.clips.human_clip import BODIES
from pipeline.errors import FileError
from pipeline.readers import Statement, read_motion, written_map
from pipeline.readers.roles import NAME, shared_prefix, side_and_part, without_prefix
from tests.factories import motion_files as files
from tests.factories.conventions import CONVENTIONS, DROP_DEG, Convention, write_bvh

UNITS = {"cm": 0.01, "m": 1.0, "inch": 0.0254}
Z_UP = np.array([[0.0, 0, 1], [1, 0, 0], [0, 1, 0]])
AXES = {"y up": {}, "world z up": {"world_turn": Z_UP}, "frames z up": {"frame_turn": Z_UP}}
POSES = files.upright(8, seed=21)


@pytest.fixture(scope="module")
def truth(tmp_path_factory):
    """The clip of the project's own names."""
    path = tmp_path_factory.mktemp("truth") / "clip.bvh"
    path.write_text(files.bvh(POSES))
    return read_motion(path, "clip").clip


def read(tmp_path, convention, statement=None, **style):
    path = tmp_path / "clip.bvh"
    path.write_text(write_bvh(POSES, convention, **style))
    return read_motion(path, "clip", statement or Statement())


@pytest.mark.parametrize("rest", DROP_DEG)
@pytest.mark.parametrize("name", CONVENTIONS)
def test_a_motion_is_the_same_under_every_convention(tmp_path, truth, name, rest):
    for (unit, metres), axes in itertools.product(UNITS.items(), AXES):
        found = read(tmp_path, CONVENTIONS[name], rest=rest, metres_per_unit=metres, **AXES[axes])
        assert found.unit == unit
        error = np.linalg.norm(found.clip.body_pos_w - truth.body_pos_w, axis=2).max(axis=0)
        assert error.max() < 5e-4, f"{name} {rest} {unit} {axes}: {BODIES[int(error.argmax())]} {error.max():.4f} m"
        if found.skeleton == NAME:
            known = [index for index, each in enumerate(BODIES) if not each.endswith("toe")]
            turned = rotation.angle_between(found.clip.body_quat_w[:, known], truth.body_quat_w[:, known])
            assert turned.max() < 1e-3, f"{name} {rest} {unit} {axes}: {BODIES[known[int(turned.max(0).argmax())]]}"


@pytest.mark.parametrize("prefix", ["Take_01:", "Character1_", "a:b:", "Bone.", "Subject 3 ", "J_Bip_"])
def test_what_all_names_begin_with_is_left_out(tmp_path, truth, prefix):
    found = read(tmp_path, Convention(prefix=prefix))
    assert found.skeleton == "booster_lab"
    np.testing.assert_allclose(found.clip.body_pos_w, truth.body_pos_w, atol=1e-6)


def test_prefixes_end_at_a_separator_and_leave_names():
    assert shared_prefix(("mixamorig:Hips", "mixamorig:Spine", "mixamorig:Head")) == "mixamorig:"
    assert shared_prefix(("Armature", "rig:Hips", "rig:Spine", "rig:Head")) == "rig:"
    assert shared_prefix(("LeftArm", "LeftHand", "LeftLeg")) == ""
    assert without_prefix(("a:x", "b:x", "a:y")) == ("a:x", "b:x", "a:y")


@pytest.mark.parametrize(
    ("name", "side", "part"),
    [
        ("LeftUpLeg", "left", "upleg"),
        ("RThigh", "right", "thigh"),
        ("LUArm", "left", "uarm"),
        ("upper_arm.L", "left", "upperarm"),
        ("L_Hip", "left", "hip"),
        ("Hand_R", "right", "hand"),
        ("lfemur", "left", "femur"),
        ("Leg", "", "leg"),
        ("Hips", "", "hips"),
        ("LowerBack", "", "lowerback"),
    ],
)
def test_names_are_a_side_and_a_part(name, side, part):
    assert side_and_part(name) == (side, part)


def test_arms_raised_ahead_at_rest_are_measured_too(tmp_path, truth, monkeypatch):
    from tests.factories import conventions

    def ahead(pose):
        turns = {name: np.eye(3) for name in files.NAMES}
        for side, sign in (("Left", -1.0), ("Right", 1.0)):
            turn = conventions.Rotation.from_euler("y", sign * 90.0, degrees=True).as_matrix()
            turns |= {f"{side}{part}": turn for part in ("Arm", "ForeArm", "Hand")}
        return turns

    monkeypatch.setattr(conventions, "rest_turns", ahead)
    found = read(tmp_path, CONVENTIONS["mixamo"])
    np.testing.assert_allclose(found.clip.body_pos_w, truth.body_pos_w, atol=1e-6)
    down = rotation.rotate(found.clip.quat("left_shoulder"), np.array([0.0, 0.0, -1.0]))
    bone = rotation.normalize(found.clip.pos("left_elbow") - found.clip.pos("left_shoulder"))
    np.testing.assert_allclose(down, bone, atol=1e-4)


def test_left_and_right_that_are_exchanged_are_refused_under_any_names(tmp_path):
    text = write_bvh(POSES, CONVENTIONS["xsens"])
    text = re.sub(r"(JOINT) (Left|Right)", lambda m: f"{m[1]} {'Right' if m[2] == 'Left' else 'Left'}", text)
    (tmp_path / "clip.bvh").write_text(text)
    with pytest.raises(FileError, match=r"left and right are swapped|unknown skeleton"):
        read_motion(tmp_path / "clip.bvh", "clip")


def test_a_joint_that_names_and_tree_give_two_places_is_refused(tmp_path):
    names = {**CONVENTIONS["mixamo"].names, "LeftLeg": "LeftFoot", "LeftFoot": "LeftLeg"}
    with pytest.raises(FileError, match="'LeftFoot' does not descend from 'LeftLeg'"):
        read(tmp_path, Convention(names=names, prefix="x:"))


def test_an_unknown_skeleton_names_the_joints_that_are_not_known_and_the_closest_map(tmp_path):
    with pytest.raises(FileError, match=r"no joint is known as left_hip.*Closest is 'lafan1'.*--write-map") as caught:
        read(tmp_path, Convention(names={"Chest": "Spine2", "LeftUpLeg": "Oberschenkel"}, prefix="mixamorig:"))
    assert "missing: LeftUpLeg, Spine1" in str(caught.value)
    assert "Oberschenkel" in str(caught.value)


def test_a_stated_map_may_leave_the_prefix_out(tmp_path, truth):
    found = read(tmp_path, Convention(prefix="Take_01:"), Statement(skeleton="booster_lab"))
    np.testing.assert_allclose(found.clip.body_pos_w, truth.body_pos_w, atol=1e-6)


def test_the_map_of_an_unknown_skeleton_is_written_with_what_is_known(tmp_path, truth):
    path, names = tmp_path / "clip.bvh", {"Chest": "Spine2", "LeftUpLeg": "Oberschenkel"}
    path.write_text(write_bvh(POSES, Convention(names=names, prefix="mixamorig:")))
    text = written_map(path)
    assert "left_hip: {joint: FILL_IN" in text
    assert "right_hip: {joint: RightUpLeg, left: x, down: RightLeg}" in text
    filled = {"left_hip": "Oberschenkel", "left_knee": "LeftLeg", "pelvis": "Hips", "spine": "Spine", "neck": "Neck"}
    for body, joint in filled.items():
        text = text.replace(f"  {body}: {{joint: FILL_IN", f"  {body}: {{joint: {joint}").replace(
            "down: FILL_IN", "down: LeftLeg", 1
        )
    (tmp_path / "mine.yaml").write_text(text)
    found = read_motion(path, "clip", Statement(skeleton=str(tmp_path / "mine.yaml")))
    np.testing.assert_allclose(found.clip.body_pos_w, truth.body_pos_w, atol=1e-5)


def test_a_written_map_keeps_joint_names_in_their_own_script(tmp_path, truth):
    path, mine = tmp_path / "clip.bvh", tmp_path / "mine.yaml"
    plain = write_bvh(POSES, CONVENTIONS["xsens"])
    path.write_text(plain)
    mine.write_text(written_map(path).replace("LeftAnkle", "左足"), encoding="utf-8")
    path.write_text(plain.replace("LeftAnkle", "左足"), encoding="utf-8")
    text = written_map(path, str(mine))
    assert "left_ankle: {joint: 左足," in text and "down: 左足" in text
    mine.write_text(text, encoding="utf-8")
    found = read_motion(path, "clip", Statement(skeleton=str(mine)))
    np.testing.assert_allclose(found.clip.body_pos_w, truth.body_pos_w, atol=1e-5)


@pytest.mark.parametrize("rest", DROP_DEG)
def test_the_written_map_of_a_known_skeleton_reads_the_file_as_it_was_read(tmp_path, rest):
    path = tmp_path / "clip.bvh"
    path.write_text(write_bvh(POSES, CONVENTIONS["xsens"], rest=rest))
    (tmp_path / "mine.yaml").write_text(written_map(path))
    plain = read_motion(path, "clip").clip
    stated = read_motion(path, "clip", Statement(skeleton=str(tmp_path / "mine.yaml"))).clip
    np.testing.assert_allclose(stated.body_quat_w, plain.body_quat_w, atol=1e-12)


@pytest.mark.parametrize(
    ("body", "joint", "child"),
    [("left_shoulder", "LeftShoulder", "LeftElbow"), ("right_elbow", "RightElbow", "RightWrist")],
)
@pytest.mark.parametrize("axes", [{}, {"world_turn": Z_UP}])
def test_a_map_whose_two_axes_are_parallel_at_rest_is_refused_with_both(tmp_path, body, joint, child, axes):
    path = tmp_path / "clip.bvh"
    path.write_text(write_bvh(POSES, CONVENTIONS["xsens"], rest="hanging", **axes))
    text = re.sub(rf"  {body}: .*", f"  {body}: {{joint: {joint}, down: {child}, left: y}}", written_map(path))
    (tmp_path / "mine.yaml").write_text(text)
    says = rf"{body} 'down' \(to {child}\) and 'left' \(y\), which lie along one line in this file's rest pose"
    with pytest.raises(FileError, match=says):
        read_motion(path, "clip", Statement(skeleton=str(tmp_path / "mine.yaml")))
