"""Every defect that the index of the real recordings notes is found by catalogue and repair, which don't read notes."""

from __future__ import annotations

import csv
import dataclasses

import pytest

from pipeline.catalog import CatalogSettings, correct
from pipeline.clips.human_clip import HumanClip
from pipeline.clips.outcome import Reason
from pipeline.feasibility import FeasibilitySettings, assess
from pipeline.feasibility.motion import motion_of
from pipeline.files import settings as settings_files
from pipeline.readers import Statement, read_motion
from pipeline.repair import RepairSettings, process
from pipeline.robot import Robot

pytestmark = pytest.mark.shared

EXPECTED: dict[str, set[str]] = {
    "cmu_asfamc/02_01.amc": {"foot_skate"},
    "cmu_bvh/02_03.bvh": {"time_base", "opening_pose"},
    "cmu_bvh/cmu_12_01_walk.bvh": {"opening_pose"},
    "isaaclab_amp/humanoid_walk.npz": {"doubled_frames"},
    "misc_bvh/wspr_walk.bvh": {"opening_pose"},
    "pfnn/LocomotionFlat04_000.bvh": {"frozen"},
    "t1_arenax/running.npz": {"joint_jump"},
    "t1_arenax/walking2.npz": {"joint_limit"},
}
"""File -> what has to be said of it."""
NO_DEFECT = {
    "asap_smpl/video_walk_level1_filter_amass.npz",  # where it comes from
    "bandai_namco/dataset-1_call_normal_001.bvh",  # what is done
    "bandai_namco/dataset-1_walk-left_tired_001.bvh",  # its name: labels are measured
    "lafan1_30fps_orig/walk1_subject1_stop.bvh",  # what of the recording it is
    "t1_holosoma/walking.npz",  # where it starts, as every piece is placed; how fast its feet leave the ground
}
"""Files whose notes tell something else."""


@pytest.fixture(scope="module")
def said(root, mocap, robot):
    """File -> reasons of catalogue and repair together, as they are given on the way through the graph."""
    catalog = settings_files.read(root / "data" / "catalog.yaml", CatalogSettings)
    repair = settings_files.read(root / "data" / "repair.yaml", RepairSettings)
    return {file: _said(mocap / file, robot, catalog, repair) for file in EXPECTED}


def _said(path, robot: Robot, catalog: CatalogSettings, repair: RepairSettings) -> dict[str, list[Reason]]:
    read = read_motion(path, path.stem, Statement(fps=120.0 if path.suffix == ".amc" else None))
    corrected = correct(dataclasses.replace(read, notes=()), settings=catalog)
    skill = "run" if isinstance(corrected.clip, HumanClip) and path.stem == "02_03" else "walk"
    on_robot = None if isinstance(corrected.clip, HumanClip) else robot
    outcome = process(corrected.clip, {"skill": skill}, settings=repair, robot=on_robot)
    told: dict[str, list[Reason]] = {}
    for reason in (*corrected.reasons, *outcome.reasons):
        told.setdefault(reason.code, []).append(reason)
    return told


def test_every_note_of_the_index_is_accounted_for(mocap):
    with (mocap / "index.csv").open() as stream:
        noted = {row["file"] for row in csv.DictReader(stream) if row["notes"].strip()}
    assert noted == set(EXPECTED) | NO_DEFECT


def test_feet_that_dip_into_the_ground_are_said_by_what_judges(root, mocap, robot):
    """The note of running.npz: 4.5 cm by the file, 3.3 on the floor that repair finds."""
    path = mocap / "t1_arenax/running.npz"
    catalog = settings_files.read(root / "data" / "catalog.yaml", CatalogSettings)
    clip = correct(read_motion(path, path.stem, Statement(fps=None)), settings=catalog).clip
    repair = settings_files.read(root / "data" / "repair.yaml", RepairSettings)
    limits = settings_files.read(root / "data" / "feasibility.yaml", FeasibilitySettings)
    (piece,) = process(clip, {"skill": "run"}, settings=repair, robot=robot).pieces
    broken = {verdict.code: verdict for verdict in assess(motion_of(piece.clip, robot, limits), limits).broken}
    assert broken["penetration_max"].value == pytest.approx(0.033, abs=0.003)


@pytest.mark.parametrize("file", EXPECTED)
def test_what_the_index_notes_is_said(file, said):
    assert EXPECTED[file] <= set(said[file]), {code: one[0].text for code, one in said[file].items()}


def test_it_is_said_where_the_index_has_it(said):
    assert [one.start_s for one in said["cmu_bvh/cmu_12_01_walk.bvh"]["opening_pose"]] == [0.0]
    assert said["isaaclab_amp/humanoid_walk.npz"]["doubled_frames"][0].value == 2.0
    assert "made at 120 Hz" in said["cmu_bvh/02_03.bvh"]["time_base"][0].text
    lost = said["pfnn/LocomotionFlat04_000.bvh"]["frozen"][-1]
    assert lost.start_s is not None
    assert lost.start_s * 120.0 == pytest.approx(2332, abs=2)
    passed = [one.value for one in said["t1_arenax/walking2.npz"]["joint_limit"] if "Right_Knee_Pitch" in one.text]
    assert passed == [pytest.approx(0.03, abs=0.01)]
