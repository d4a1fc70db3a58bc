"""The real recordings: each is read the right way up, in metres, facing where it walks."""

import csv
import functools
from pathlib import Path

import numpy as np
import pytest

from pipeline import rotation
from pipeline.clips.human_clip import HumanClip
from pipeline.readers import list_motion_files, read_motion, sources_of_environment

pytestmark = pytest.mark.shared

WRONG_RATE = ("cmu_bvh/02_03.bvh",)
"""Files whose frames the index measures at a rate that is wrong."""

UPRIGHT_SKILLS = ("walk", "walk_slow")


@functools.cache
def read_all(folder: Path):
    (source,) = sources_of_environment(str(folder))
    return {path.relative_to(folder).as_posix(): read_motion(path, path.stem) for path in list_motion_files(source)}


@pytest.fixture(scope="module")
def recordings(mocap: Path):
    return read_all(mocap.resolve())


@pytest.fixture(scope="module")
def humans(recordings):
    return {name: read for name, read in recordings.items() if isinstance(read.clip, HumanClip)}


@pytest.fixture(scope="module")
def index(mocap: Path):
    with (mocap / "index.csv").open() as stream:
        return {row["file"]: row for row in csv.DictReader(stream)}


@pytest.fixture(scope="module")
def upright(mocap: Path, humans):
    """Frames of the labelled windows in which a person is upright, by file."""
    masks = {name: np.zeros(read.clip.frame_count, bool) for name, read in humans.items()}
    with (mocap / "segments.csv").open() as stream:
        for row in csv.DictReader(stream):
            if row["file"] in masks and row["skill"] in UPRIGHT_SKILLS:
                masks[row["file"]][int(row["first_frame"]) : int(row["last_frame"]) + 1] = True
    return {name: mask for name, mask in masks.items() if mask.sum() > 10}


def along(clip, body, axis):
    return rotation.rotate(clip.quat(body), np.array(axis, dtype=float))


def test_every_file_is_read(recordings, index):
    assert set(recordings) == set(index)


def test_frames_rates_and_units_are_those_of_the_index(recordings, index):
    for name, read in recordings.items():
        row = index[name]
        assert read.clip.frame_count == int(row["frames"]), name
        assert read.clip.fps == float(row["fps"]), name
        assert read.up_axis.upper() == row["up"], name
        expected = "cmu" if row["units"].startswith(("CMU", "ASF")) else row["units"].split("/")[0]
        assert read.unit == expected, name


def test_legs_are_human(humans):
    for name, read in humans.items():
        for side in ("left", "right"):
            hip, knee, ankle = (read.clip.pos(f"{side}_{part}") for part in ("hip", "knee", "ankle"))
            leg = np.linalg.norm(hip - knee, axis=1) + np.linalg.norm(knee - ankle, axis=1)
            assert 0.7 < np.median(leg) < 0.95, name


def test_the_pelvis_moves_at_the_speed_of_the_index(recordings, index):
    for name, read in recordings.items():
        clip = read.clip
        pos = clip.pos("pelvis") if isinstance(clip, HumanClip) else clip.root_pos_w
        velocity = np.gradient(pos[:, :2], 1.0 / clip.fps, axis=0)
        width = max(1, round(0.2 * clip.fps))
        smooth = np.stack([np.convolve(one, np.ones(width) / width, mode="valid") for one in velocity.T], axis=1)
        speed = float(np.linalg.norm(smooth, axis=1).mean())
        expected = float(index[name]["speed_mean"])
        assert abs(speed - expected) <= 0.05 * expected + 0.02, f"{name}: {speed:.3f}, index {expected}"


def test_pelvis_chest_and_head_are_upright_while_walking(humans, upright):
    for name, mask in upright.items():
        if "tired" in name or name in WRONG_RATE:  # an actor who stoops, and a run
            continue
        for body in ("pelvis", "chest", "head"):
            up = along(humans[name].clip, body, [0, 0, 1])[mask].mean(axis=0)
            tilt_deg = np.rad2deg(np.arccos(up[2] / np.linalg.norm(up)))
            limit_deg = 25.0 if body == "head" else 15.0  # people look down
            assert tilt_deg < limit_deg, f"{name}: {body} {tilt_deg:.0f}"


def test_the_chest_leans_ahead_by_a_few_degrees_over_all_walking(humans, upright):
    pitch_deg = [
        np.rad2deg(-np.arcsin(along(humans[name].clip, "chest", [1, 0, 0])[mask, 2])).mean()
        for name, mask in upright.items()
        if name.startswith(("lafan1", "cmu", "misc", "pfnn", "deepmimic", "asap")) and name not in WRONG_RATE
    ]
    assert 0.0 < np.mean(pitch_deg) < 6.0


def test_feet_and_pelvis_look_where_toes_and_hips_point(humans):
    for name, read in humans.items():
        clip = read.clip
        hips = rotation.normalize(clip.pos("left_hip") - clip.pos("right_hip"))
        assert np.mean(np.sum(along(clip, "pelvis", [0, 1, 0]) * hips, axis=1)) > 0.95, name
        facing = along(clip, "pelvis", [1, 0, 0])
        for side in ("left", "right"):
            foot = clip.pos(f"{side}_toe") - clip.pos(f"{side}_ankle")
            assert np.mean(np.sum(foot * facing, axis=1)) > 0.03, name
            ahead = along(clip, f"{side}_ankle", [1, 0, 0])
            assert np.mean(np.sum(rotation.normalize(foot) * ahead, axis=1)) > 0.7, name


def test_feet_are_level_when_they_stand(humans):
    for name, read in humans.items():
        clip = read.clip
        for side in ("left", "right"):
            ankle, toe = clip.pos(f"{side}_ankle"), clip.pos(f"{side}_toe")
            still = np.ones(clip.frame_count, bool)
            for pos in (ankle, toe):  # a foot that does not move at all is a frozen recording
                speed = np.linalg.norm(np.gradient(pos, 1.0 / clip.fps, axis=0), axis=1)
                still &= (speed < 0.08) & (speed > 1e-4)
            still &= ankle[:, 2] < np.median(ankle[:, 2])
            if still.sum() < 10:
                continue
            up = np.median(along(clip, f"{side}_ankle", [0, 0, 1])[still], axis=0)
            assert np.rad2deg(np.arccos(up[2] / np.linalg.norm(up))) < 10.0, f"{name} {side}"


def test_limbs_point_along_their_bones(humans):
    bones = [("hip", "knee"), ("knee", "ankle"), ("shoulder", "elbow"), ("elbow", "wrist")]
    for name, read in humans.items():
        for side in ("left", "right"):
            for upper, lower in bones:
                bone = read.clip.pos(f"{side}_{lower}") - read.clip.pos(f"{side}_{upper}")
                down = along(read.clip, f"{side}_{upper}", [0, 0, -1])
                assert np.median(np.sum(rotation.normalize(bone) * down, axis=1)) > 0.995, f"{name} {side} {upper}"


def test_knees_bend_back_about_their_left_axis(humans):
    for name, read in humans.items():
        for side in ("left", "right"):
            thigh, shank = read.clip.quat(f"{side}_hip"), read.clip.quat(f"{side}_knee")
            bend = rotation.to_rotvec(rotation.multiply(rotation.conjugate(thigh), shank))
            bent = bend[np.linalg.norm(bend, axis=1) > 0.5]
            if len(bent) > 10:
                assert np.mean(bent[:, 1] / np.linalg.norm(bent, axis=1)) > 0.8, f"{name} {side}"


def test_one_walk_has_the_same_path_as_bvh_and_as_amc(humans):
    bvh, amc = humans["misc_bvh/wspr_walk.bvh"].clip, humans["cmu_asfamc/02_01.amc"].clip
    np.testing.assert_allclose(bvh.pos("pelvis")[1:], amc.pos("pelvis"), atol=5e-6)
    for body in ("pelvis", "chest", "left_hip", "right_knee", "left_shoulder", "left_elbow"):
        angle = rotation.angle_between(bvh.quat(body)[1:], amc.quat(body))
        assert np.rad2deg(np.median(angle)) < 6.0, body


def test_the_amc_beside_another_persons_skeleton_is_marked(humans):
    notes = humans["cmu_asfamc/02_01.amc"].notes
    assert [note.code for note in notes if note.effect == "rejected"] == ["skeleton_mismatch"]
