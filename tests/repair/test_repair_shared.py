"""Real recordings: what is wrong with them is found without being told, and what is sound stays."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from pipeline.readers.read_motion import read_motion
from pipeline.readers.source import Statement
from pipeline.repair import process

pytestmark = pytest.mark.shared

SOUND_SHARE = 0.97


@pytest.fixture(scope="module")
def repaired(mocap, settings):
    def run(file: str, skill: str = "walk", fps: float | None = None):
        clip = read_motion(mocap / file, file, Statement(fps=fps)).clip
        return process(clip, {"skill": skill}, settings=settings)

    return run


def kept(outcome) -> set[int]:
    """Frames of the source that went on."""
    return {
        frame for piece in outcome.pieces for frame in range(piece.numbers["start_frame"], piece.numbers["stop_frame"])
    }


def test_files_without_a_noted_defect_survive_nearly_unflagged(mocap, settings):
    files = sorted((mocap / "lafan1_60fps").glob("*.bvh")) + sorted((mocap / "lafan1_30fps_orig").glob("*.bvh"))
    files += sorted((mocap / "bandai_namco").glob("*.bvh"))
    assert len(files) == 19
    flagged = total = 0
    for path in files:
        clip = read_motion(path, path.stem).clip
        outcome = process(clip, {"skill": "run" if "run" in path.stem else "walk"}, settings=settings)
        assert len(kept(outcome)) >= SOUND_SHARE * clip.frame_count, (path.name, outcome.reasons)
        flagged += outcome.numbers["filled_frames"] + outcome.numbers["cut_frames"]
        total += clip.frame_count
    assert flagged <= 0.005 * total


@pytest.mark.parametrize(("file", "last"), [("cmu_bvh/cmu_12_01_walk.bvh", 0), ("misc_bvh/wspr_walk.bvh", 0)])
def test_opening_bind_pose_does_not_survive(file, last, repaired):
    outcome = repaired(file)
    assert min(kept(outcome)) == last + 1
    assert "opening_pose" in {reason.code for reason in outcome.reasons}


def test_opening_bind_pose_is_found_at_the_true_rate(mocap, settings):
    clip = read_motion(mocap / "cmu_bvh" / "02_03.bvh", "02_03").clip
    outcome = process(dataclasses.replace(clip, fps=120.0), {"skill": "run"}, settings=settings)
    assert "opening_pose" in {reason.code for reason in outcome.reasons}
    assert 0 not in kept(outcome)


def test_tracking_loss_to_the_origin_does_not_survive(repaired):
    outcome = repaired("pfnn/LocomotionFlat04_000.bvh")
    frames = kept(outcome)
    assert not frames & set(range(2332, 2428))
    assert len(frames) >= 0.85 * 2332


def test_feet_of_a_skeleton_of_another_person_are_planted(repaired):
    outcome = repaired("cmu_asfamc/02_01.amc", fps=120.0)
    (piece,) = outcome.pieces
    skate = next(reason for reason in outcome.reasons if reason.code == "foot_skate")
    assert skate.effect == "repaired"
    assert skate.value == pytest.approx(0.134, abs=0.03)
    assert piece.numbers["planted_m_s"] == skate.value
    twin = repaired("misc_bvh/wspr_walk.bvh").pieces[0]
    assert twin.numbers["planted_m_s"] == 0.0
    assert piece.numbers["stance_slip_m_s"] < 1.3 * twin.numbers["stance_slip_m_s"]


def test_frames_that_are_stored_twice_become_one_motion(mocap, settings):
    clip = read_motion(mocap / "isaaclab_amp" / "humanoid_walk.npz", "humanoid_walk").clip
    any_slip = dataclasses.replace(
        settings, contact=dataclasses.replace(settings.contact, slip_limit_m_s=1.0, skate_limit_m_s=1.0)
    )
    outcome = process(clip, {"skill": "walk_fast_jog"}, settings=any_slip)
    assert "repeated_frame" in {reason.code for reason in outcome.reasons if reason.effect == "repaired"}
    steps = np.linalg.norm(np.diff(outcome.pieces[0].clip.pos("pelvis"), axis=0), axis=1)
    assert len(outcome.pieces) == 1
    assert steps.min() > 0.5 * steps.mean()


def test_opening_transient_of_a_robot_clip_is_cut(repaired):
    outcome = repaired("t1_arenax/running.npz")
    frames = kept(outcome)
    assert min(frames) > 0
    assert len(frames) > 400
