"""Recordings with many short gaps are measured and labelled as what they show."""

import dataclasses
import functools

import numpy as np
import pytest

from pipeline.catalog import CatalogSettings, catalogue, catalogue_file
from pipeline.catalog.catalogue import times_stored
from pipeline.clips.robot_clip import RobotClip
from pipeline.files import settings as settings_file
from pipeline.quality.planar_motion import bridge, short_gaps
from pipeline.readers import ReadMotion, Source, read_motion
from pipeline.robot import Kinematics
from pipeline.selection import TRANSITION, Curation, find_windows, process
from tests.conftest import ROOT
from tests.factories import motion_files
from tests.factories.gliding import gliding_person, gliding_robot
from tests.factories.runner import runner

CATALOG = settings_file.read(ROOT / "data" / "catalog.yaml", CatalogSettings)
CURATION = settings_file.read(ROOT / "data" / "curation.yaml", Curation)


@functools.cache
def shipped(name: str) -> ReadMotion:
    return read_motion(ROOT / "data" / "motions" / f"{name}.bvh", name)


def lost(clip, frames):
    """The clip without what was recorded in these frames."""
    if isinstance(clip, RobotClip):
        pos, quat = clip.root_pos_w.copy(), clip.root_quat_w.copy()
        pos[frames], quat[frames] = np.nan, np.nan
        return dataclasses.replace(clip, root_pos_w=pos, root_quat_w=quat)
    pos, quat = clip.body_pos_w.copy(), clip.body_quat_w.copy()
    pos[frames], quat[frames] = np.nan, np.nan
    return dataclasses.replace(clip, body_pos_w=pos, body_quat_w=quat)


@pytest.mark.parametrize("every", [7, 3])
@pytest.mark.parametrize("name", ["walk_slow", "back", "run_fast"])
def test_a_shipped_motion_with_one_frame_in_a_few_lost_keeps_its_labels_and_speed(name, every):
    whole = shipped(name)
    holed = dataclasses.replace(whole, clip=lost(whole.clip, slice(3, None, every)))
    clean, torn = (catalogue(each, settings=CATALOG) for each in (whole, holed))
    assert torn.reasons == clean.reasons
    for number in ("fps", "speed_mean", "speed_max", "cadence_per_min", "stance_foot_speed", "flight_share"):
        assert torn.numbers[number] == pytest.approx(clean.numbers[number], rel=0.03, abs=0.03), number
    assert torn.numbers["recorded_share"] == pytest.approx(1.0 - 1.0 / every, abs=0.01)
    wanted, found = (find_windows(each.pieces[0].clip, settings=CURATION.windows) for each in (clean, torn))
    assert [window.skill for window in found] == [window.skill for window in wanted]
    for one, two in zip(wanted, found, strict=True):
        assert (two.start, two.stop) == pytest.approx((one.start, one.stop), abs=6)
        assert two.forward_m_s == pytest.approx(one.forward_m_s, abs=0.02)


@pytest.mark.parametrize("glide", [gliding_person, gliding_robot])
def test_gaps_at_random_do_not_change_a_label(glide):
    legs = [(2.0, 0.0, 0.0, 0.0), (3.0, 1.0, 0.0, 0.4), (2.0, 0.0, 0.0, 1.5), (3.0, 0.4, 0.0, 0.0)]
    clip = glide(legs)
    missing = np.random.default_rng(5).random(clip.frame_count) < 0.3
    wanted, found = (find_windows(each, settings=CURATION.windows) for each in (clip, lost(clip, missing)))
    assert (
        [each.skill for each in found] == [each.skill for each in wanted] == ["stand", "walk", "turn_left", "walk_slow"]
    )
    assert [each.start for each in found] == pytest.approx([each.start for each in wanted], abs=6)


def test_a_run_with_a_wrong_rate_and_gaps_is_still_put_right():
    clip = dataclasses.replace(runner(120.0), fps=25.0)
    read = dataclasses.replace(shipped("walk_slow"), clip=lost(clip, slice(2, None, 7)))
    (piece,) = catalogue(read, settings=CATALOG).pieces
    assert piece.clip.fps == 120.0
    assert np.isnan(piece.clip.body_pos_w).any(), "what goes on is as it was recorded"


def test_two_frames_in_three_lost_are_no_frames_stored_three_times():
    clip = gliding_person([(4.0, 1.0, 0.0, 0.0)])
    gone = np.arange(clip.frame_count) % 3 == 0
    assert times_stored(lost(clip, gone), CATALOG.repeated_share) == (1, 0)


def test_a_file_of_which_too_little_was_recorded_is_rejected_with_the_share():
    whole = shipped("walk_slow")
    gone = np.arange(whole.clip.frame_count) % 5 != 0
    outcome = catalogue(dataclasses.replace(whole, clip=lost(whole.clip, gone)), settings=CATALOG)
    assert outcome.pieces == ()
    (reason,) = [each for each in outcome.reasons if each.effect == "rejected"]
    assert reason.code == "too_little_recorded"
    assert "20% of the frames were recorded, at least 50% are needed" in reason.text
    assert (reason.value, reason.limit) == (pytest.approx(0.2, abs=0.01), CATALOG.least_recorded_share)


def test_a_root_in_centimetres_is_rejected_for_its_speed():
    whole = shipped("walk")
    clip = dataclasses.replace(whole.clip, body_pos_w=100.0 * whole.clip.body_pos_w)
    outcome = catalogue(dataclasses.replace(whole, clip=clip), settings=CATALOG)
    (reason,) = [each for each in outcome.reasons if each.code == "too_little_recorded"]
    assert reason.text.endswith("the root is faster than 15 m/s: its unit or the rate is wrong")


def test_a_file_without_any_stretch_that_tells_a_speed_is_rejected():
    whole = shipped("walk_slow")
    gone = np.arange(whole.clip.frame_count) % 60 != 0
    outcome = catalogue(dataclasses.replace(whole, clip=lost(whole.clip, gone)), settings=CATALOG)
    assert outcome.pieces == ()
    assert "none is in a stretch of 0.2 s, which a speed needs" in outcome.reasons[-1].text


def test_a_long_loss_alone_rejects_no_file():
    clip = shipped("walk_slow").clip
    read = dataclasses.replace(shipped("walk_slow"), clip=lost(clip, slice(clip.frame_count // 4, None)))
    (piece,) = catalogue(read, settings=CATALOG).pieces
    first = find_windows(piece.clip, settings=CURATION.windows)[0]
    assert (first.skill, first.recorded_share) == ("stand", 1.0), "it stands before it walks"


def test_the_pieces_of_the_stage_tell_the_share_of_the_frames_recorded():
    clip = lost(gliding_person([(4.0, 0.45, 0.0, 0.0)]), slice(1, None, 4))
    (piece,) = process(clip, {}, settings=CURATION).pieces
    assert piece.numbers["skill"] == "walk_slow"
    assert piece.numbers["recorded_share"] == pytest.approx(0.75)


def test_a_parabola_is_bridged_to_the_last_digit_and_what_is_long_or_at_an_end_is_not():
    times_s = np.arange(120) / 60.0
    path = np.stack([1.0 + 2.0 * times_s, 3.0 * times_s - 4.905 * times_s**2], axis=1)
    recorded = np.ones(120, dtype=bool)
    for start, stop in ((0, 2), (20, 25), (40, 75), (90, 91), (118, 120)):
        recorded[start:stop] = False
    torn = np.where(recorded[:, None], path, np.nan)
    found = bridge(torn, recorded, 60.0, 0.5)
    short = np.r_[20:25, 90]
    np.testing.assert_allclose(found[short], path[short], atol=1e-9)
    assert np.flatnonzero(short_gaps(recorded, 60.0, 0.5)).tolist() == short.tolist()
    assert np.isnan(found[[0, 1, 118, 119]]).all() and np.isnan(found[40:75]).all()


def test_a_gap_too_long_for_a_spline_is_a_straight_line():
    values = np.sin(np.arange(60) / 5.0)[:, None]
    recorded = np.ones(60, dtype=bool)
    recorded[20:40] = False
    found = bridge(np.where(recorded[:, None], values, np.nan), recorded, 60.0, 0.5)
    np.testing.assert_allclose(np.diff(found[19:41, 0]), (values[40, 0] - values[19, 0]) / 21.0, atol=1e-12)


def written_npz(path, clip, robot):
    poses = Kinematics(robot).forward(clip.root_pos_w, clip.root_quat_w, clip.joint_pos)
    pos, quat = poses.pos_w.copy(), np.repeat(clip.root_quat_w[:, None], poses.pos_w.shape[1], axis=1)
    arrays = {"joint_pos": clip.joint_pos.copy(), "body_pos_w": pos, "body_quat_w": quat}
    for each in arrays.values():
        each[3::7] = np.nan
    names = {"joint_names": np.array(robot.joint_names), "body_names": np.array(robot.link_names)}
    np.savez(path, fps=clip.fps, **arrays, **names)
    return path


def written_csv(path, clip, robot):
    rows = np.column_stack([clip.root_pos_w, clip.root_quat_w[:, [1, 2, 3, 0]], clip.joint_pos])
    rows[3::7] = np.nan
    head = ["root_x", "root_y", "root_z", "quat_x", "quat_y", "quat_z", "quat_w", *robot.joint_names]
    np.savetxt(path, rows, delimiter=",", header=f"# fps: {clip.fps:g}\n{','.join(head)}", comments="")
    return path


@pytest.mark.parametrize(("write", "file"), [(written_npz, "walk.npz"), (written_csv, "walk.csv")])
def test_a_robots_file_with_one_frame_in_seven_lost_is_read_and_labelled(tmp_path, robot, write, file):
    clip = gliding_robot([(4.0, 0.45, 0.0, 0.2)])
    joints = np.tile(robot.default_joint_pos, (clip.frame_count, 1))
    whole = dataclasses.replace(clip, joint_names=robot.joint_names, joint_pos=joints)
    path = write(tmp_path / file, whole, robot)
    (piece,) = catalogue_file(path, "walk", Source(name="mine", folder=tmp_path), file, settings=CATALOG).pieces
    assert piece.numbers["speed_mean"] == pytest.approx(0.45, abs=0.01)
    assert [each.skill for each in find_windows(piece.clip, settings=CURATION.windows)] == ["walk_slow"]


def test_an_smpl_file_with_one_frame_in_seven_lost_is_read_and_labelled(tmp_path):
    frames = 240
    path = motion_files.smpl_npz(tmp_path / "walk.npz", frames=frames)
    with np.load(path) as archive:
        arrays = dict(archive)
    arrays["trans"][:, 1] = -0.45 * np.arange(frames) / 30.0
    arrays["poses"][3::7], arrays["trans"][5::7] = np.nan, np.nan
    np.savez(path, **arrays)
    outcome = catalogue_file(path, "walk", Source(name="mine", folder=tmp_path), "walk.npz", settings=CATALOG)
    (piece,) = outcome.pieces
    assert piece.numbers["speed_mean"] == pytest.approx(0.45, abs=0.01)
    (window,) = find_windows(piece.clip, settings=CURATION.windows)
    assert np.hypot(window.forward_m_s, window.lateral_m_s) == pytest.approx(0.45, abs=0.01)
    assert window.skill != TRANSITION
