"""The rate of a robot file: declared, stated, or that of its own velocities."""

import numpy as np
import pytest

from pipeline.errors import AmbiguousFileError, FileError
from pipeline.readers import Statement, read_motion
from pipeline.robot import Kinematics
from tests.factories.robot_files import (
    FRAMES,
    HEADER,
    ROBOT,
    amp_robot,
    assert_truth,
    csv_rows,
    gmr_npz,
    npz,
    qpos_npz,
    truth,
    write_csv,
)


def test_a_column_of_times_states_the_rate(tmp_path):
    rows = np.concatenate([np.arange(FRAMES)[:, None] / 50.0, csv_rows()], axis=1)
    clip = read_motion(write_csv(tmp_path / "clip.csv", rows, ["time_s", *HEADER]), "clip").clip
    assert clip.fps == 50.0
    assert_truth(clip)


def test_a_csv_without_header_and_rate_is_ambiguous_until_the_rate_is_stated(tmp_path):
    path = write_csv(tmp_path / "clip.csv", csv_rows())
    with pytest.raises(AmbiguousFileError, match=r"State `fps:` for it in data/sources.yaml"):
        read_motion(path, "clip")
    clip = read_motion(path, "clip", Statement(fps=30.0)).clip
    assert clip.fps == 30.0
    assert_truth(clip)


@pytest.mark.parametrize("fps", [25.0, 50.0, 100.0, 500.0])
def test_the_rate_of_a_qpos_archive_is_where_its_velocities_agree(tmp_path, fps):
    read = read_motion(qpos_npz(tmp_path / "clip.npz", fps), "clip")
    assert (read.format, read.clip.fps) == ("robot_qpos", fps)
    assert_truth(read.clip)


def test_a_qpos_archive_may_name_its_rate_and_its_free_joint(tmp_path):
    names = np.array(["root", *ROBOT.joint_names])
    clip = read_motion(qpos_npz(tmp_path / "clip.npz", 80.0, frequency=np.array(80.0), joint_names=names), "clip").clip
    assert clip.fps == 80.0
    assert_truth(clip)


def test_a_rate_that_the_velocities_do_not_tell_is_ambiguous(tmp_path):
    path = qpos_npz(tmp_path / "clip.npz", 77.0)
    with pytest.raises(AmbiguousFileError, match="does not say its frame rate"):
        read_motion(path, "clip")


def test_joint_velocities_correct_the_rate_where_those_of_the_links_say_nothing(tmp_path):
    nothing = np.zeros_like(Kinematics(ROBOT).forward(*truth()).pos_w)
    path = amp_robot(tmp_path / "clip.npz", fps=np.array(25), body_linear_velocities=nothing)
    read = read_motion(path, "clip")
    assert read.clip.fps == 50.0 and [note.code for note in read.notes] == ["time_base"]


@pytest.mark.parametrize("factor", [0.5, 2.0, 0.6])
@pytest.mark.parametrize("kind", ["amp", "qpos", "whole body"])
def test_a_rate_that_the_files_own_velocities_contradict_is_corrected_and_named(tmp_path, kind, factor):
    declared = 50.0 * factor
    if kind == "amp":
        path = amp_robot(tmp_path / "clip.npz", fps=np.array(declared))
    elif kind == "qpos":
        path = qpos_npz(tmp_path / "clip.npz", 50.0, frequency=np.array(declared))
    else:
        velocity = np.gradient(truth()[2], 0.02, axis=0)
        path = npz(tmp_path / "clip.npz", fps=np.array([declared]), joint_vel=velocity)
    read = read_motion(path, "clip")
    assert (read.clip.fps, read.declared_fps) == (50.0, declared)
    (note,) = read.notes
    assert (note.code, note.effect) == ("time_base", "repaired")
    assert f"states {declared:g} Hz" in note.text and "50 Hz is taken" in note.text
    stated = read_motion(path, "clip", Statement(fps=declared))
    assert (stated.clip.fps, stated.notes[0].effect) == (declared, "noted")


@pytest.mark.parametrize("declared", [50.0, 64.0, 100.0])
@pytest.mark.parametrize("kind", ["amp", "qpos", "whole body"])
def test_a_rate_contradicted_by_velocities_of_no_usual_rate_is_rejected_with_both(tmp_path, kind, declared):
    velocity = np.gradient(truth()[2], 1.0 / 80.0, axis=0)
    if kind == "amp":
        bodies = np.gradient(Kinematics(ROBOT).forward(*truth()).pos_w, 1.0 / 80.0, axis=0)
        path = amp_robot(
            tmp_path / "clip.npz",
            fps=np.array(declared),
            dof_velocities=velocity[:, ::-1],
            body_linear_velocities=bodies,
        )
    elif kind == "qpos":
        path = qpos_npz(tmp_path / "clip.npz", 80.0, frequency=np.array(declared))
    else:
        path = npz(tmp_path / "clip.npz", fps=np.array([declared]), joint_vel=velocity)
    read = read_motion(path, "clip")
    (note,) = read.notes
    assert (note.code, note.effect, read.clip.fps) == ("time_base", "rejected", declared)
    assert (
        f"states {declared:g} Hz" in note.text and "those of 80 Hz" in note.text and "State the right one" in note.text
    )
    stated = read_motion(path, "clip", Statement(fps=80.0))
    assert (stated.clip.fps, [note.effect for note in stated.notes]) == (80.0, ["noted"])


@pytest.mark.parametrize("noise", [0.0, 0.02])
def test_a_rate_that_the_velocities_agree_with_is_kept_silently(tmp_path, noise):
    velocity = np.gradient(truth()[2], 0.02, axis=0)
    velocity += noise * np.random.default_rng(1).normal(size=velocity.shape)
    read = read_motion(npz(tmp_path / "clip.npz", joint_vel=velocity), "clip")
    assert (read.clip.fps, read.notes) == (50.0, ())


@pytest.mark.parametrize("lost", ["qpos", "qvel"])
def test_velocities_of_another_length_than_the_positions_are_refused(tmp_path, lost):
    path = qpos_npz(tmp_path / "clip.npz", 50.0)
    with np.load(path) as whole:
        arrays = dict(whole)
    np.savez(path, **{**arrays, lost: arrays[lost][1:]})
    with pytest.raises(FileError, match=r"'qvel' has \d+ rows and 'qpos' has \d+\. Frames were lost"):
        read_motion(path, "clip")


def test_a_comment_whose_rate_is_not_that_of_the_times_is_refused(tmp_path):
    rows = np.concatenate([np.arange(FRAMES)[:, None] / 50.0, csv_rows()], axis=1)
    header = ["time_s", *HEADER]
    assert read_motion(write_csv(tmp_path / "a.csv", rows, header, "# fps: 50"), "clip").clip.fps == 50.0
    with pytest.raises(FileError, match=r"its comment states 30 Hz, and its times 'time_s' give 50 Hz"):
        read_motion(write_csv(tmp_path / "b.csv", rows, header, "# fps: 30"), "clip")


@pytest.mark.parametrize("step_s", [0.0, -0.02, np.nan])
def test_times_that_do_not_increase_are_refused_unless_the_rate_is_stated(tmp_path, step_s):
    times = np.arange(FRAMES)[:, None] * step_s
    path = write_csv(tmp_path / "a.csv", np.concatenate([times, csv_rows()], axis=1), ["time_s", *HEADER])
    with pytest.raises(FileError, match=r"'time_s' do not increase in even steps\. State `fps:`"):
        read_motion(path, "clip")
    assert read_motion(path, "clip", Statement(fps=50.0)).clip.fps == 50.0


@pytest.mark.parametrize("start_s", [0.0, 1.7e9])
@pytest.mark.parametrize("fps", [30.0, 50.0, 60.0, 120.0, 59.94])
def test_times_in_whole_milliseconds_or_since_1970_state_the_rate(tmp_path, start_s, fps):
    times = start_s + np.round(np.arange(FRAMES) / fps, 3)
    path = write_csv(tmp_path / "a.csv", np.column_stack([times, csv_rows()]), ["time_s", *HEADER])
    assert read_motion(path, "clip").clip.fps == pytest.approx(fps, rel=0.0 if fps != 59.94 else 2e-3)


@pytest.mark.parametrize("digits", [2, 3])
@pytest.mark.parametrize("lost", [1, 20, FRAMES - 2])
def test_a_lost_frame_shows_in_rounded_times(tmp_path, digits, lost):
    rows = np.column_stack([np.round(np.arange(FRAMES) / 30.0, digits), csv_rows()])
    path = write_csv(tmp_path / "a.csv", np.delete(rows, lost, axis=0), ["time_s", *HEADER])
    with pytest.raises(FileError, match="do not increase in even steps"):
        read_motion(path, "clip")


def test_a_rate_that_changes_on_the_way_shows_in_rounded_times(tmp_path):
    steps = np.where(np.arange(FRAMES) < FRAMES // 2, 0.016, 0.017)
    path = write_csv(tmp_path / "a.csv", np.column_stack([np.cumsum(steps), csv_rows()]), ["time_s", *HEADER])
    with pytest.raises(FileError, match="do not increase in even steps"):
        read_motion(path, "clip")


def test_joints_in_asaps_shape_are_as_many_as_the_roots_frames(tmp_path):
    joints = truth()[2][:, :, None]
    path = gmr_npz(tmp_path / "a.npz", dof_pos=joints)
    assert_truth(read_motion(path, "clip", Statement(fps=50.0)).clip)
    for lost in (np.concatenate([joints, joints]), joints[1:]):
        gmr_npz(path, dof_pos=lost)
        with pytest.raises(FileError, match=f"'dof_pos' is of float64 with shape {len(lost)}"):
            read_motion(path, "clip", Statement(fps=50.0))
    joints = joints.copy()
    joints[3, 5] = np.inf
    assert np.isnan(read_motion(gmr_npz(path, dof_pos=joints), "clip").clip.joint_pos[3]).sum() == 1
