"""Skeleton maps: the shipped ones are whole and tell each other apart, and a template works."""

import re
from pathlib import Path

import numpy as np
import pytest

from pipeline.clips.human_clip import BODIES
from pipeline.errors import AmbiguousFileError, FileError, SettingsError
from pipeline.readers import Statement, match_skeleton, read_motion
from pipeline.readers.skeleton_map import read_map, shipped_maps
from tests.factories import motion_files as files


@pytest.mark.parametrize("name", sorted(shipped_maps()))
def test_a_shipped_map_names_all_bodies_and_no_other_map_fits_its_joints(name):
    skeleton = shipped_maps()[name]
    assert set(skeleton.bodies) == set(BODIES)
    others = [
        other.name for other in shipped_maps().values() if other.joints <= skeleton.joints and other is not skeleton
    ]
    assert others == (["cmu"] if name == "pfnn" else ["pfnn"] if name == "cmu" else [])


@pytest.mark.parametrize("name", sorted(shipped_maps()))
def test_the_sides_of_a_shipped_map_are_alike(name):
    bodies = shipped_maps()[name].bodies
    for body in BODIES:
        if body.startswith("left_"):
            left, right = bodies[body], bodies[body.replace("left_", "right_")]
            assert left.pitch_deg == right.pitch_deg
            assert set(left.directions()) == set(right.directions())
            assert left.offset == right.offset


NAMES = {"Spine2": "Chest"}
FIGURE = re.compile("|".join(NAMES))
"""Names of the template's joints -> those of the figure in `tests/factories/motion_files.py`."""


TEMPLATE = """title: What this skeleton is
also: [Spine1]                # joints that distinguish it from others and are not used below
bodies:
  pelvis: {joint: Hips, up: y, left: x}
  spine: {joint: Spine, up: y, left: x}
  chest: {joint: Spine2, up: y, left: x, pitch_deg: -4}
  neck: {joint: Neck, up: y, left: x}
  head: {joint: Head, up: y, left: x}
  left_hip: {joint: LeftUpLeg, down: LeftLeg, left: x}
  left_knee: {joint: LeftLeg, down: LeftFoot, left: x}
  left_ankle: {joint: LeftFoot, ahead: z, left: x}
  left_toe: {joint: LeftToe, ahead: z, left: x}
  right_hip: {joint: RightUpLeg, down: RightLeg, left: x}
  right_knee: {joint: RightLeg, down: RightFoot, left: x}
  right_ankle: {joint: RightFoot, ahead: z, left: x}
  right_toe: {joint: RightToe, ahead: z, left: x}
  left_shoulder: {joint: LeftArm, down: LeftForeArm, left: y}
  left_elbow: {joint: LeftForeArm, down: LeftHand, left: y}
  left_wrist: {joint: LeftHand, down: x, left: y}
  right_shoulder: {joint: RightArm, down: RightForeArm, left: -y}
  right_elbow: {joint: RightForeArm, down: RightHand, left: -y}
  right_wrist: {joint: RightHand, down: -x, left: -y}
"""
"""A map by hand; docs/sources.md shows some of its lines."""


def test_the_lines_in_the_docs_are_those_of_the_template(root: Path):
    block = re.search(r"\n    title: What this skeleton is\n(?:    .*\n)+", (root / "docs" / "sources.md").read_text())
    assert block is not None
    shown = [line[4:] for line in block.group().splitlines() if line and "…" not in line]
    assert len(shown) == 6
    assert set(shown) <= set(TEMPLATE.splitlines())


def test_the_template_is_a_map_that_reads_a_figure_it_names(tmp_path):
    (tmp_path / "mine.yaml").write_text(TEMPLATE)
    text = files.bvh(files.upright(5)).replace("Spine", "Spine1").replace("Chest", "Spine2")
    text = text.replace("JOINT Spine1", "JOINT Spine", 1)
    text = text.replace("JOINT LeftShoulder", "JOINT Spine1", 1)
    (tmp_path / "clip.bvh").write_text(text)
    read = read_motion(tmp_path / "clip.bvh", "clip", Statement(skeleton=str(tmp_path / "mine.yaml")))
    assert read.skeleton == "mine"
    for body in ("pelvis", "left_hip", "right_ankle", "head"):
        np.testing.assert_allclose(np.abs(read.clip.quat(body)[:, 0]), 1.0, atol=1e-9)


@pytest.mark.parametrize(
    ("old", "new", "match"),
    [
        ("  head: ", "  crown: ", "body 'head' is missing; unknown body 'crown'"),
        (
            "pelvis: {joint: Hips, up: y, left: x}",
            "pelvis: {joint: Hips, up: y}",
            "'pelvis' names 1 of ahead, left, up, down",
        ),
        (
            "pelvis: {joint: Hips, up: y, left: x}",
            "pelvis: {joint: Hips, up: y, left: -y}",
            "'pelvis' uses one axis twice",
        ),
        ("pelvis: {joint: Hips, up: y, left: x}", "pelvis: {joint: Hips, up: y, down: x}", "expected two that differ"),
        ("joint: Hips", "joints: Hips", "unknown key 'bodies.pelvis.joints'"),
    ],
)
def test_faults_of_a_map_are_named(tmp_path, old, new, match):
    path = tmp_path / "mine.yaml"
    path.write_text(TEMPLATE.replace(old, new, 1))
    with pytest.raises(SettingsError, match=match):
        read_map(path)


def test_two_maps_that_fit_alike_are_ambiguous(tmp_path, monkeypatch):
    maps = shipped_maps()
    monkeypatch.setattr(match_skeleton, "shipped_maps", lambda: {**maps, "twin": maps["booster_lab"]})
    (tmp_path / "clip.bvh").write_text(files.bvh(files.upright(5)))
    with pytest.raises(AmbiguousFileError, match=r"several skeletons fit: booster_lab, booster_lab. State `skeleton:`"):
        read_motion(tmp_path / "clip.bvh", "clip")


def test_joints_whose_axes_are_not_the_maps_are_refused(tmp_path):
    path = tmp_path / "mine.yaml"
    path.write_text(FIGURE.sub(lambda found: NAMES[found.group()], TEMPLATE).replace("also: [Spine1]", ""))
    (tmp_path / "clip.bvh").write_text(files.bvh(files.upright(5)))
    assert read_motion(tmp_path / "clip.bvh", "clip", Statement(skeleton=str(path))).skeleton == "mine"
    path.write_text(path.read_text().replace("joint: Chest, up: y, left: x", "joint: Chest, up: x, left: y"))
    with pytest.raises(FileError, match=r"but their axes differ: the chest's left axis is 90 degrees off"):
        read_motion(tmp_path / "clip.bvh", "clip", Statement(skeleton=str(path)))
