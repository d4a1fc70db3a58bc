"""Rollouts on a CPU: reproducible, cut where tracking fails, with forces that obey Newton's second law."""

import csv
import dataclasses
import json
import shutil
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from pipeline.clips import codec
from pipeline.clips.outcome import Outcome
from pipeline.clips.robot_clip import RobotClip
from pipeline.errors import FileError
from pipeline.feasibility.torque_criteria import centre_of_mass
from pipeline.physics import GRAVITY
from pipeline.robot import Robot, load_robot
from pipeline.simulation.torque_envelope import TorqueEnvelope
from pipeline.tracking.bundle import CONFIG, read_tracking_bundle
from pipeline.tracking.disturbance import draw
from pipeline.tracking.process import (
    NOT_TRACKED,
    Setup,
    _figures,
    disturbed_count,
    disturbed_motion,
    motion_to_failure,
    process,
)
from pipeline.tracking.rollout import TrackedStretch
from pipeline.tracking.settings import TrackingSettings
from pipeline.tracking.tracker import load_tracker
from pipeline.tracking.tracker_folder import CARD, CURVES, NETWORK, read_card, write_tracker_folder
from tests.factories.robot_clips import standing
from tests.factories.tracking_bundle import tracker_file, tracking_bundle


def rolled(
    clip: RobotClip,
    robot: Robot,
    values: TrackingSettings,
    tracker: Path,
    variant: str = "original",
    function: Callable[..., Outcome] = process,
    **further: float,
) -> Outcome:
    setup = Setup(settings=values, robot=robot, envelope=TorqueEnvelope(limit=robot.torque_limit), tracker=tracker)
    return function(clip, {"variant": variant}, setup=setup, **further)


def hovering(robot: Robot) -> RobotClip:
    """A robot that rises into the air after a second, which no tracker follows."""
    clip = standing(robot, seconds=3.0)
    root = clip.root_pos_w.copy()
    root[50:, 2] += np.linspace(0.0, 0.8, 100)
    return dataclasses.replace(clip, root_pos_w=root)


def test_the_shipped_tracker_stands(robot: Robot, values: TrackingSettings, shipped: Path):
    outcome = rolled(standing(robot, seconds=3.0), robot, values, shipped)
    assert outcome.numbers["survived"] and not outcome.reasons
    assert outcome.numbers["body_error_m"] < 0.02
    assert [piece.clip.name for piece in outcome.pieces][:2] == ["test/stand~rollout", "test/stand~rollout1"]
    assert outcome.pieces[0].numbers["reference"] == "test/stand"


def test_contact_forces_explain_the_motion(robot: Robot, values: TrackingSettings, shipped: Path):
    """Momentum theorem over the whole rollout, against masses and kinematics that the simulation does not share."""
    clip = rolled(standing(robot, seconds=4.0), robot, values, shipped).pieces[0].clip
    assert isinstance(clip, RobotClip) and clip.forces is not None and clip.contacts is not None
    com = centre_of_mass(robot, clip.root_pos_w, clip.root_quat_w, clip.joint_pos)
    velocity = np.diff(com, axis=0) * clip.fps  # mean over each control step
    force = clip.forces.foot_wrench_w[..., :3].sum(axis=1) + clip.forces.other_force_w
    force[:, 2] -= robot.total_mass * GRAVITY
    first, last = 5, len(velocity) - 6
    impulse = (force[first : last + 1].sum(axis=0) - (force[first] + force[last]) / 2.0) / clip.fps
    np.testing.assert_allclose(robot.total_mass * (velocity[last] - velocity[first]), impulse, atol=0.6)
    assert abs(clip.forces.foot_wrench_w[50:, :, 2].sum(axis=1).mean() / (robot.total_mass * GRAVITY) - 1.0) < 0.02
    assert clip.contacts[20:].all()


def test_equal_inputs_give_equal_bytes(robot: Robot, values: TrackingSettings, shipped: Path):
    clip = standing(robot, seconds=1.5)
    first, second = (rolled(clip, robot, values, shipped) for _ in range(2))
    assert [codec.encode(piece.clip) for piece in first.pieces] == [codec.encode(piece.clip) for piece in second.pieces]
    renamed = rolled(standing(robot, seconds=1.5, name="other/name"), robot, values, shipped)
    assert codec.encode(renamed.pieces[1].clip) == codec.encode(first.pieces[1].clip), "seeds come from the content"
    assert codec.encode(first.pieces[1].clip) != codec.encode(first.pieces[2].clip), "disturbances differ"


def test_forces_survive_the_codec(robot: Robot, values: TrackingSettings, shipped: Path):
    clip = rolled(standing(robot, seconds=1.0), robot, values.nominal(), shipped).pieces[0].clip
    again = codec.decode(codec.encode(clip), clip.name)
    assert isinstance(again, RobotClip) and isinstance(clip, RobotClip)
    assert again.forces is not None and clip.forces is not None
    np.testing.assert_array_equal(again.forces.foot_wrench_w, clip.forces.foot_wrench_w)
    cut = again.cut(3, 7, "cut")
    assert cut.forces is not None
    np.testing.assert_array_equal(cut.forces.joint_torque, clip.forces.joint_torque[3:7])


def test_a_reference_that_cannot_be_followed_has_a_reason(robot: Robot, values: TrackingSettings, shipped: Path):
    outcome = rolled(hovering(robot), robot, values, shipped)
    assert not outcome.numbers["survived"]
    assert [reason.code for reason in outcome.reasons][:1] == [NOT_TRACKED]
    assert "off in height" in outcome.reasons[0].text
    nominal = [piece for piece in outcome.pieces if piece.numbers["rollout"] == 0]
    assert all(piece.numbers["followed_share"] < 1.0 for piece in nominal)


def test_disturbances_stay_in_their_ranges(values: TrackingSettings):
    ranges = values.disturbance
    for seed in range(50):
        found = draw(ranges, 10.0, np.random.default_rng(seed))
        assert ranges.friction[0] <= found.friction <= ranges.friction[1]
        assert ranges.action_noise[0] <= found.action_noise <= ranges.action_noise[1]
        impulses = [np.hypot(*push.force_w[:2]) * push.duration_s for push in found.pushes]
        assert all(ranges.push_impulse[0] <= impulse <= ranges.push_impulse[1] + 1e-9 for impulse in impulses)


def test_variants_have_fewer_disturbed_rollouts(robot: Robot, values: TrackingSettings, shipped: Path):
    outcome = rolled(standing(robot, seconds=1.0), robot, values, shipped, variant="x0.9")
    assert outcome.numbers["rollouts"] == 1 + values.disturbed_variants


@pytest.mark.parametrize(("seconds", "count"), [(0.5, 16), (1.0, 8), (2.0, 4), (3.0, 4)])
def test_short_motions_have_more_disturbed_rollouts(robot: Robot, values: TrackingSettings, seconds, count):
    values = dataclasses.replace(values, disturbed=4, disturbed_s=8.0)
    assert disturbed_count(standing(robot, seconds=seconds), {"variant": "mirror"}, values) == count
    assert disturbed_count(standing(robot, seconds=seconds), {"variant": "x0.9"}, values) == values.disturbed_variants
    assert disturbed_count(standing(robot, seconds=seconds), {"variant": "mirror"}, values.nominal()) == 0


def test_the_first_disturbed_rollout_alone_is_the_same_motion(robot: Robot, values: TrackingSettings, shipped: Path):
    clip = standing(robot, seconds=2.0)
    (alone,) = rolled(clip, robot, values, shipped, function=disturbed_motion, longest_s=6.0).pieces
    piece = next(piece for piece in rolled(clip, robot, values, shipped).pieces if piece.numbers["rollout"] == 1)
    assert alone.numbers == piece.numbers
    assert isinstance(piece.clip, RobotClip)
    assert codec.encode(alone.clip) == codec.encode(dataclasses.replace(piece.clip, forces=None))
    (cut,) = rolled(clip, robot, values, shipped, function=disturbed_motion, longest_s=1.0).pieces
    assert cut.clip.frame_count == 50


def test_the_motion_to_a_failure_ends_with_it(robot: Robot, values: TrackingSettings, shipped: Path):
    (piece,) = rolled(hovering(robot), robot, values, shipped, function=motion_to_failure).pieces
    (reason, *_) = rolled(hovering(robot), robot, values.nominal(), shipped).reasons
    assert (piece.clip.frame_count - 1) / piece.clip.fps == pytest.approx(reason.stop_s)
    assert isinstance(piece.clip, RobotClip)
    off = hovering(robot).root_pos_w[: piece.clip.frame_count, 2] - piece.clip.root_pos_w[:, 2]
    assert off[-1] > values.failure.root_height > off[-2], "the last frame is the first beyond the limit"


@pytest.mark.parametrize(
    ("changed", "message"),
    [
        ({"robot": np.array("k1")}, "is for another robot than 't1': 'k1'"),
        ({"joint_names": np.array(["knee"] * 23)}, "is for another robot than 't1'"),
        ({"controlled": np.array(["Head_pitch"])}, "observes or moves other links or joints"),
        ({"L1_w": np.zeros((7, 8)), "L1_b": np.zeros(7)}, "gives 7"),
        ({"kp": np.full(23, 1.0)}, "was trained with kp 1"),
        ({"action_scale": np.array(1.0)}, "another observation or action scale"),
    ],
)
def test_a_tracker_that_does_not_fit_is_refused(tmp_path: Path, robot: Robot, changed, message):
    path = tracker_file(tmp_path / "tracker.npz", robot, **changed)
    with pytest.raises(FileError, match=message):
        load_tracker(path, robot)


def test_what_is_no_tracker_is_refused(tmp_path: Path, robot: Robot):
    (tmp_path / "tracker.npz").write_bytes(b"no archive")
    with pytest.raises(FileError, match="is not an npz of numbers"):
        load_tracker(tmp_path / "tracker.npz", robot)


@pytest.mark.parametrize(("name", "joint_error_deg"), [("t1", 3.5), ("k1", 5.5)])
def test_a_shipped_tracker_fits_its_robot_and_its_card(root: Path, name: str, joint_error_deg: float):
    folder = root / "robots" / name / "policies" / "tracker"
    card = read_card(folder)
    assert card.robot == name and load_tracker(folder / NETWORK, load_robot(name)).robot == name
    assert card.figures["survived"] >= 0.99 and card.figures["body_error_cm"] <= 2.0
    assert card.figures["joint_error_deg"] <= joint_error_deg
    assert len(card.clips) == card.figures["clips"] and set(card.licences) == {"CC0-1.0"}
    assert card.training["minutes"] <= 30.0 and card.training["command"] and card.training["commit"]
    assert set(card.files) == {NETWORK, CURVES}
    *_, last = csv.DictReader((folder / CURVES).read_text().splitlines())
    assert int(last["iteration"]) == card.training["iterations"]


def test_a_changed_file_of_a_tracker_is_refused(root: Path, tmp_path: Path):
    for name in (NETWORK, CURVES, CARD):
        (tmp_path / name).write_bytes((root / "robots" / "t1" / "policies" / "tracker" / name).read_bytes())
    (tmp_path / CURVES).write_text("iteration\n")
    with pytest.raises(FileError, match=r"curves\.csv: is missing or not the file of its card"):
        read_card(tmp_path)


def test_the_worst_moment_is_a_time_of_the_reference_though_a_failure_lies_before_it(robot: Robot):
    clip = standing(robot, seconds=4.0)
    first, second = clip.cut(0, 50, "a"), clip.cut(100, 200, "a")
    second.root_pos_w[30] += 0.2  # at 2.6 s
    stretches = (
        TrackedStretch(start=0, stop=50, clip=first, failed="it fell"),
        TrackedStretch(start=100, stop=200, clip=second, failed=""),
    )
    assert _figures(clip, stretches, robot)["worst_at_s"] == pytest.approx(2.6)


def test_a_tracker_folder_is_replaced_as_a_whole(
    root: Path, tmp_path: Path, robot: Robot, monkeypatch: pytest.MonkeyPatch
):
    shipped, folder, run = root / "robots" / "t1" / "policies" / "tracker", tmp_path / "tracker", tmp_path / "run"
    shutil.copytree(shipped, folder)
    run.mkdir()
    (run / NETWORK).write_bytes(b"another network")
    (run / CURVES).write_text("iteration,seconds\n1,60.0\n")
    facts = {"seed": 1, "num_envs": 8, "processes": 1, "device": "cpu", "versions": {}, "bundle_digest": "d"}
    (run / CONFIG).write_text(json.dumps(facts))
    bundle = read_tracking_bundle(tracking_bundle(tmp_path, root, robot))
    before = read_card(folder)
    with monkeypatch.context() as patch:
        patch.setattr(json, "dumps", lambda *_, **__: 1 / 0)
        with pytest.raises(ZeroDivisionError):
            write_tracker_folder(folder, run, 1, bundle, {}, {})
    assert read_card(folder) == before, "a writer that dies leaves the folder as it was"
    (folder / NETWORK).write_bytes(b"damaged")
    write_tracker_folder(folder, run, 1, bundle, {}, {})
    assert read_card(folder).clips == ("test/a", "test/b")
    with pytest.raises(FileError, match="it holds other files than a tracker's"):
        write_tracker_folder(run, run, 1, bundle, {}, {})
    assert (run / CONFIG).is_file()


def test_a_rollout_begins_in_its_recording_where_its_reference_does(
    robot: Robot, values: TrackingSettings, shipped: Path
):
    limits = TorqueEnvelope(limit=robot.torque_limit)
    setup = Setup(settings=values.nominal(), robot=robot, envelope=limits, tracker=shipped)
    numbers = {"variant": "original", "stretch_start_s": 3.0, "stretch_stop_s": 4.0}
    (piece,) = process(standing(robot, seconds=1.0), numbers, setup=setup).pieces
    assert piece.numbers["stretch_start_s"] == 3.0
    assert piece.numbers["stretch_stop_s"] == pytest.approx(4.0, abs=0.021)
