"""The T1 imported again from its own model files is the T1 but for what its README calls ours."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import numpy as np
import pytest

from pipeline.robot.load import read_description
from pipeline.robot_import.propose import Proposal, propose
from pipeline.robot_import.read import read_model
from tests.factories.maker_models import T1, t1_mjcf, t1_urdf, without_sites, write


@pytest.fixture(scope="module")
def ours():
    return read_description(T1)


@pytest.fixture(scope="module")
def of_urdf() -> Proposal:
    return propose(read_model(T1 / "t1.urdf"), "t1")


@pytest.fixture(scope="module")
def of_mjcf() -> Proposal:
    return propose(read_model(T1 / "t1.xml"), "t1")


def numbers(row) -> np.ndarray:
    return np.array([value for value in dataclasses.astuple(row)[1:] if isinstance(value, float)])


def texts(row) -> list[str]:
    return [value for value in dataclasses.astuple(row)[1:] if isinstance(value, str)]


def test_links_of_the_urdf_are_those_of_the_table(of_urdf: Proposal, ours):
    assert of_urdf.description.contents["links.csv"] == ours.contents["links.csv"]


def test_links_of_the_mjcf_are_those_of_the_table(of_mjcf: Proposal, ours):
    assert of_mjcf.description.contents["links.csv"] == ours.contents["links.csv"]


def test_limits_of_the_urdf_are_those_of_the_table(of_urdf: Proposal, ours):
    for found, wanted in zip(of_urdf.description.joints, ours.joints, strict=True):
        assert (found.joint, found.controlled) == (wanted.joint, wanted.controlled)
        assert (found.lower, found.upper, found.torque) == (wanted.lower, wanted.upper, wanted.torque)
        assert found.urdf_speed == wanted.speed


def test_limits_and_armatures_of_the_mjcf_are_those_of_the_table(of_mjcf: Proposal, ours):
    for found, wanted in zip(of_mjcf.description.joints, ours.joints, strict=True):
        assert (found.lower, found.upper, found.armature) == (wanted.lower, wanted.upper, wanted.armature)


def test_shapes_of_the_mjcf_are_those_of_the_table_but_for_colours(of_mjcf: Proposal, ours):
    wanted = {row.shape: row for row in ours.shapes}
    assert len(of_mjcf.description.shapes) == len(wanted)
    for found in of_mjcf.description.shapes:
        same = wanted[found.shape]
        assert (found.link, found.kind, found.role) == (same.link, same.kind, same.role)
        np.testing.assert_allclose(numbers(found), numbers(same), atol=1e-9)


def test_the_correspondence_and_the_mirror_map_are_ours(of_urdf: Proposal, ours):
    found, wanted = of_urdf.description.config, ours.config
    for name in ("root_link", "key_links", "hands", "feet", "sole_corners", "contact_excludes", "human_links"):
        assert getattr(found, name) == getattr(wanted, name), name
    assert set(found.mirror_names) == set(wanted.mirror_names)


@pytest.mark.parametrize("kind", ["urdf", "xml"])
def test_sites_are_found_without_those_of_the_file(tmp_path: Path, ours, kind: str):
    if kind == "urdf":
        path = write(tmp_path / "t1.urdf", without_sites(t1_urdf()))
    else:
        root = t1_mjcf()
        for body in root.iter("body"):
            for site in body.findall("site"):
                body.remove(site)
        path = write(tmp_path / "t1.xml", root)
    proposal = propose(read_model(path), "t1")
    found = {row.site: row for row in proposal.description.sites}
    wanted = {row.site: row for row in ours.sites}
    del wanted["pelvis"]
    assert set(found) == set(wanted)
    for name, row in wanted.items():
        assert found[name].link == row.link, name
        np.testing.assert_allclose(numbers(found[name]), numbers(row), atol=1e-7, err_msg=name)
    assert any("left_hand, left_wrist" in text for text in proposal.to_state)


def test_what_a_urdf_does_not_state_is_listed(of_urdf: Proposal):
    columns = {text.split(":")[0] for text in of_urdf.to_state if text.startswith("joints.csv")}
    named = {text.removeprefix("joints.csv, ") for text in columns}
    assert named == {"kp", "kd", "armature", "motor_speed", "default_pos", "controlled"}


def test_what_an_mjcf_does_not_state_is_listed(of_mjcf: Proposal):
    listed = [text for text in of_mjcf.to_state if "torque:" in text]
    assert listed == ["joints.csv, torque: the file has no torque limit; 10 N m is written (all joints)."]


def test_the_readers_agree_on_the_same_robot():
    urdf, mjcf = read_model(T1 / "t1.urdf"), read_model(T1 / "t1.xml")
    assert [each.name for each in urdf.links] == [each.name for each in mjcf.links]
    for first, second in zip(urdf.origins(), mjcf.origins(), strict=True):
        np.testing.assert_allclose(first, second, atol=1e-12)


def test_sites_of_the_file_are_kept(of_urdf: Proposal, ours):
    assert {row.site for row in of_urdf.description.sites} == {row.site for row in ours.sites}
