"""A sample of a robot's trajectory that leaves and comes back is filled, at any amplitude and rate; motion stays."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from pipeline import rotation
from pipeline.clips.robot_clip import RobotClip
from pipeline.files import settings as settings_files
from pipeline.readers import Statement, read_motion
from pipeline.repair import RepairSettings, process
from pipeline.repair.robot_outliers import find_dropouts, without_spikes


def walk(robot, fps=50.0, seconds=3.0, noise=0.0, seed=0):
    """Legs and arms swinging at a step a second, with white noise on all joints [rad]."""
    time_s = np.arange(round(fps * seconds)) / fps
    phase = np.arange(len(robot.joint_names))
    joints = robot.default_joint_pos + 0.4 * np.sin(2 * np.pi * time_s[:, None] + phase)
    joints += noise * np.random.default_rng(seed).normal(size=joints.shape)
    count = len(time_s)
    return RobotClip(
        name="robot/clip",
        fps=fps,
        robot="t1",
        joint_names=robot.joint_names,
        root_pos_w=np.stack([0.6 * time_s, 0.02 * np.sin(6 * time_s), np.full(count, 0.66)], axis=1),
        root_quat_w=rotation.about_z(0.3 * np.sin(time_s)),
        joint_pos=joints,
    )


@pytest.mark.parametrize("fps", [30.0, 50.0, 120.0, 500.0])
@pytest.mark.parametrize("size", [0.15, -0.3, 0.6, 2.0])
@pytest.mark.parametrize("length", [1, 2])
def test_a_spike_of_a_joint_is_filled_and_named(robot, fps, size, length):
    clip = walk(robot, fps)
    joint, frame = robot.joint("Left_Knee_Pitch"), len(clip.joint_pos) // 2
    spoilt = clip.joint_pos.copy()
    spoilt[frame : frame + length, joint] += size
    found, reasons = without_spikes(dataclasses.replace(clip, joint_pos=spoilt))
    (reason,) = reasons
    assert (reason.code, reason.effect, reason.start_s) == ("spike", "repaired", frame / fps)
    assert "Left_Knee_Pitch" in reason.text
    assert reason.value == pytest.approx(abs(size), abs=0.1 * abs(size) + 0.02)
    np.testing.assert_allclose(found.joint_pos, clip.joint_pos, atol=5e-3)


@pytest.mark.parametrize("noise", [0.0, 0.002, 0.01])
@pytest.mark.parametrize("fps", [30.0, 50.0, 500.0])
def test_a_sound_motion_has_no_spikes_and_stays_as_it_is(robot, fps, noise):
    clip = walk(robot, fps, noise=noise)
    found, reasons = without_spikes(clip)
    assert found is clip and reasons == []


def test_a_step_that_stays_is_no_spike(robot):
    clip = walk(robot)
    joints = clip.joint_pos.copy()
    joints[60:, 4] += 0.5
    assert without_spikes(dataclasses.replace(clip, joint_pos=joints))[1] == []


def test_spikes_of_the_root_are_filled(robot):
    clip = walk(robot)
    pos, quat = clip.root_pos_w.copy(), clip.root_quat_w.copy()
    pos[40] += [0.05, 0.0, 0.03]
    quat[90] = rotation.multiply(quat[90], rotation.from_rotvec(np.array([0.2, 0.0, 0.0])))
    found, reasons = without_spikes(dataclasses.replace(clip, root_pos_w=pos, root_quat_w=quat))
    assert [reason.unit for reason in reasons] == ["m", "rad"]
    np.testing.assert_allclose(found.root_pos_w, clip.root_pos_w, atol=2e-3)
    assert rotation.angle_between(found.root_quat_w, clip.root_quat_w).max() < 5e-3


def test_missing_frames_and_short_clips_are_left_alone(robot):
    clip = walk(robot)
    joints = clip.joint_pos.copy()
    joints[50:53] = np.nan
    found, reasons = without_spikes(dataclasses.replace(clip, joint_pos=joints))
    assert reasons == []
    np.testing.assert_array_equal(found.joint_pos, joints)
    assert without_spikes(clip.cut(0, 5, "short"))[1] == []


@pytest.mark.parametrize("fps", [30.0, 50.0, 120.0, 500.0])
@pytest.mark.parametrize("size", [0.3, -0.6])
@pytest.mark.parametrize("frames", [3, 8, 20])
@pytest.mark.parametrize("noise", [0.0, 0.002])
def test_a_joint_that_jumps_and_comes_back_later_is_cut_where_it_is_elsewhere(robot, root, fps, size, frames, noise):
    clip, joint = walk(robot, fps, noise=noise), robot.joint("Left_Knee_Pitch")
    start = len(clip.joint_pos) // 2
    joints = clip.joint_pos.copy()
    joints[start : start + frames, joint] += size
    spoilt = dataclasses.replace(clip, joint_pos=joints)
    settings = settings_files.read(root / "data" / "repair.yaml", RepairSettings)
    outcome = process(spoilt, {}, settings=settings, robot=robot)
    (reason,) = [each for each in outcome.reasons if each.code != "joint_limit"]
    assert (reason.code, reason.effect) == ("dropout", "rejected")
    assert (reason.start_s, reason.stop_s) == (start / fps, (start + frames) / fps)
    assert "Left_Knee_Pitch" in reason.text
    assert reason.value == pytest.approx(abs(size), abs=0.06)
    assert [piece.clip.frame_count for piece in outcome.pieces] == [start, len(joints) - start - frames]


def test_dropouts_of_the_root_are_found(robot):
    clip = walk(robot)
    pos, quat = clip.root_pos_w.copy(), clip.root_quat_w.copy()
    pos[40:52] += [0.1, 0.0, 0.05]
    quat[90:100] = rotation.multiply(rotation.from_rotvec(np.array([0.25, 0.0, 0.0])), quat[90:100])
    found = find_dropouts(dataclasses.replace(clip, root_pos_w=pos, root_quat_w=quat), 1.0)
    assert [(each.start, each.stop, each.unit) for each in found] == [(40, 52, "m"), (90, 100, "rad")]


@pytest.mark.parametrize("noise", [0.0, 0.002, 0.02])
@pytest.mark.parametrize("fps", [30.0, 50.0, 500.0])
def test_a_sound_motion_has_no_dropouts(robot, fps, noise):
    assert find_dropouts(walk(robot, fps, noise=noise), 1.0) == []


@pytest.mark.parametrize("acceleration", [50.0, 150.0, 300.0])
def test_quick_strokes_that_a_motor_can_do_are_no_dropouts(robot, acceleration):
    clip = walk(robot, fps=50.0, seconds=4.0)
    speed = np.clip(acceleration * 0.02 * np.array([1, 2, 3, 2, 1, 0, 0, 0, -1, -2, -3, -2, -1]), -12.0, 12.0)
    stroke = np.zeros(len(clip.joint_pos))
    stroke[60:73] = speed * 0.02
    joints = clip.joint_pos.copy()
    joints[:, 4] += np.cumsum(stroke)
    assert find_dropouts(dataclasses.replace(clip, joint_pos=joints), 1.0) == []


def test_a_step_that_stays_and_an_excursion_beyond_a_second_are_no_dropouts(robot):
    clip = walk(robot)
    joints = clip.joint_pos.copy()
    joints[60:, 4] += 0.5
    joints[20:100, 7] += 0.5
    assert find_dropouts(dataclasses.replace(clip, joint_pos=joints), 1.0) == []


@pytest.mark.shared
def test_the_spike_in_a_table_is_repaired_with_a_reason(cases, root, robot):
    clip = read_motion(cases / "robot_csv_spike" / "spike.csv", "clip", Statement()).clip
    settings = settings_files.read(root / "data" / "repair.yaml", RepairSettings)
    outcome = process(clip, {}, settings=settings, robot=robot)
    assert [(reason.code, reason.effect) for reason in outcome.reasons] == [("spike", "repaired")]
    assert outcome.numbers["filled_frames"] == 1
    assert np.abs(np.diff(outcome.pieces[0].clip.joint_pos, axis=0)).max() * clip.fps < 3.0


@pytest.mark.shared
@pytest.mark.parametrize("file", ["t1_arenax/running.npz", "t1_arenax/walking2.npz", "t1_holosoma/walking.npz"])
def test_recordings_of_a_robot_have_no_spikes(mocap, file):
    clip = read_motion(mocap / file, "clip").clip
    assert without_spikes(clip)[1] == []
    assert find_dropouts(clip, 1.0) == []
