"""A simulated robot against the motion that it tracked: what it is held to, and divergence that is planted or real."""

import dataclasses
import logging
from functools import partial

import mujoco
import numpy as np
import pytest

from pipeline import rotation
from pipeline.augment import AugmentSettings
from pipeline.augment import process as augment
from pipeline.batch import ClipPool, Entry, Manifest, Stage, Store, run_stage
from pipeline.catalog import CatalogSettings, catalogue_file
from pipeline.cli.retarget_command import encode_csv
from pipeline.clips.outcome import Outcome, Piece
from pipeline.clips.robot_clip import RobotClip
from pipeline.errors import PipelineError
from pipeline.feasibility import FeasibilitySettings, assess, process
from pipeline.feasibility.judgement import NUMBER, from_text
from pipeline.feasibility.motion import motion_of
from pipeline.feasibility.over_time import windowed_mean
from pipeline.feasibility.reference import CONTENT, ReferenceGoneError, StoredReferences, reference_of
from pipeline.feasibility.tracking_criteria import CRITERIA, tracking, tracking_error
from pipeline.files import settings
from pipeline.readers import FileStatement, Source
from pipeline.repair import RepairSettings
from pipeline.repair import process as repair
from pipeline.retarget import RetargetSettings
from pipeline.retarget.process import onto_robot
from pipeline.robot import Robot, mujoco_model
from pipeline.simulation.record import Rollout
from tests.factories.robot_clips import standing
from tests.factories.tracked_motion import tracked, waving

FOLLOWED = "tracking_followed"
CODES = tuple(each.code for each in CRITERIA)
"""What is asked of every tracked rollout; how much was followed, only of those that KP4 made."""


@pytest.fixture(scope="module")
def reference(robot: Robot) -> RobotClip:
    return waving(robot, 6.0)


@pytest.fixture(scope="module")
def simulated(robot: Robot, reference: RobotClip) -> Rollout:
    """Physics under PD control."""
    return tracked(robot, reference)


@pytest.fixture(scope="module")
def rollout(simulated: Rollout) -> RobotClip:
    """It at 50 Hz."""
    return simulated.clip("rollout")


@pytest.fixture(scope="module")
def fallen(robot: Robot, reference: RobotClip) -> RobotClip:
    """The same with ankles as soft as the robot's own, until it lies."""
    return tracked(robot, reference, ankles=1.0).clip("rollout")


def _verdicts(clip: RobotClip, reference: RobotClip, robot: Robot, limits: FeasibilitySettings):
    return {each.code: each for each in tracking(motion_of(clip, robot, limits, reference), limits.tracking)}


def _off(clip: RobotClip, robot: Robot, joint: str, by: np.ndarray) -> RobotClip:
    joints = clip.joint_pos.copy()
    joints[:, robot.joint(joint)] += by
    return dataclasses.replace(clip, joint_pos=joints)


def _outcome(clip: RobotClip, reference: RobotClip, robot: Robot, limits: FeasibilitySettings, **numbers) -> Outcome:
    about = {CONTENT: "a", "fps": 50.0, **numbers}
    return process(clip, about, settings=limits, robot=robot, references={"a": reference}.__getitem__)


def test_a_motion_is_at_no_distance_from_itself_wherever_it_is(robot, limits, reference):
    turn = rotation.about_z(2.0)
    there = dataclasses.replace(
        reference,
        root_pos_w=rotation.rotate(turn, reference.root_pos_w) + np.array([3.0, -2.0, 0.0]),
        root_quat_w=rotation.multiply(turn, reference.root_quat_w),
    )
    found = _verdicts(there, reference, robot, limits)
    assert tuple(found) == CODES
    assert all(each.value == pytest.approx(0.0, abs=1e-9) for each in found.values())


def test_errors_are_those_that_were_planted(robot, reference):
    lifted = dataclasses.replace(reference, root_pos_w=reference.root_pos_w + np.array([0.0, 0.0, 0.1]))
    error = tracking_error(lifted, reference, robot)
    np.testing.assert_allclose(error.root_height, 0.1)
    np.testing.assert_allclose(error.end_height, 0.1)
    np.testing.assert_allclose(error.body, 0.0, atol=1e-12)
    tilt = rotation.from_axis_angle(np.array([0.0, 1.0, 0.0]), np.full(reference.frame_count, 0.5))
    tilted = dataclasses.replace(reference, root_quat_w=tilt)
    error = tracking_error(tilted, reference, robot)
    np.testing.assert_allclose(error.gravity, 1.0 - np.cos(0.5), atol=1e-12)
    np.testing.assert_allclose(error.joint, 0.0)
    slow = np.stack([np.linspace(0.0, 2.0, reference.frame_count), *np.zeros((2, reference.frame_count))], axis=1)
    short = dataclasses.replace(reference, root_pos_w=slow * 0.5)
    error = tracking_error(short, dataclasses.replace(reference, root_pos_w=slow), robot)
    assert error.path.max() == pytest.approx(0.5)  # half of 1 m less, as the fit is in the middle
    elbow = _off(reference, robot, "Left_Elbow_Pitch", np.full(reference.frame_count, 0.3))
    error = tracking_error(elbow, reference, robot)
    np.testing.assert_allclose(error.joint, 0.3 / np.sqrt(len(robot.controlled)))


def test_the_error_of_a_hand_is_the_arc_it_is_turned_by(robot, reference):
    """An arm stretched out and turned about the shoulder by a small angle moves the hand by angle times length."""
    error = tracking_error(
        _off(reference, robot, "Left_Shoulder_Pitch", np.full(reference.frame_count, 0.01)), reference, robot
    )
    assert 0.01 * 0.2 < error.body.max() < 0.01 * 0.6
    twice = tracking_error(
        _off(reference, robot, "Left_Shoulder_Pitch", np.full(reference.frame_count, 0.02)), reference, robot
    )
    np.testing.assert_allclose(twice.body, 2.0 * error.body, rtol=1e-3)


@pytest.mark.parametrize(("joint", "site"), [("Left_Shoulder_Roll", 0), ("Right_Hip_Pitch", 3)])
def test_a_hand_or_sole_that_is_raised_is_off_by_the_height_that_mujoco_gives(robot, reference, joint, site):
    raised = _off(reference, robot, joint, np.full(reference.frame_count, -0.8))
    error, model = tracking_error(raised, reference, robot), mujoco_model(robot)
    data, name = mujoco.MjData(model), (*robot.hands, *robot.feet)[site]
    for frame in (0, 100, 250):
        height = []
        for clip in (raised, reference):
            data.qpos[:] = [*clip.root_pos_w[frame], *clip.root_quat_w[frame], *clip.joint_pos[frame]]
            mujoco.mj_kinematics(model, data)
            height.append(data.site(name).xpos[2])
        assert abs(height[0] - height[1]) > 0.01
        assert error.end_height[frame] == pytest.approx(abs(height[0] - height[1]), abs=1e-9)


def test_windows_lie_inside_the_clip():
    values = np.array([9.0, 0.0, 0.0, 3.0, 0.0, 0.0, 0.0])
    np.testing.assert_allclose(windowed_mean(values, 3), [3.0, 3.0, 1.0, 1.0, 1.0, 0.0, 0.0])
    np.testing.assert_allclose(windowed_mean(values[:2], 3), [4.5, 4.5])


def test_a_robot_that_tracks_its_motion_goes_on_whole(robot, limits, reference, rollout):
    outcome = _outcome(rollout, reference, robot, limits)
    assert [piece.clip.name for piece in outcome.pieces] == ["rollout"], [reason.text for reason in outcome.reasons]
    assert 0.0 < outcome.numbers["tracking_body_p95"] < limits.tracking.body_p95
    (judgement,) = from_text(str(outcome.numbers[NUMBER]))
    assert all(judgement.found[code].value is not None and not judgement.found[code].broken for code in CODES)


def test_without_a_reference_tracking_is_not_judged_and_does_not_hold(robot, limits, rollout):
    outcome = process(rollout, {}, settings=limits, robot=robot)
    (judgement,) = from_text(str(outcome.numbers[NUMBER]))
    assert {judgement.found[code].not_applicable for code in CODES} == {"no tracked rollout"}
    assert not any(code in outcome.numbers for code in CODES)


def test_a_robot_that_falls_leaves_its_motion_for_good(robot, limits, reference, fallen):
    broken = {code for code, each in _verdicts(fallen, reference, robot, limits).items() if not each.holds}
    assert {"tracking_body_worst", "tracking_away_s", "tracking_root_height", "tracking_gravity"} <= broken
    reasons = {reason.code: reason for reason in _outcome(fallen, reference, robot, limits).reasons}
    assert "m off the motion that was tracked for" in reasons["tracking_away_s"].text


def test_an_arm_that_drifts_away_diverges_although_it_never_is_far(robot, limits, reference, rollout):
    drift = np.interp(np.arange(300), [0, 150, 299], [0.0, 0.0, 0.55])
    drifting = _off(_off(rollout, robot, "Left_Shoulder_Roll", -drift), robot, "Left_Elbow_Pitch", 0.5 * drift)
    found = _verdicts(drifting, reference, robot, limits)
    assert found["tracking_body_worst"].holds
    assert found["tracking_gravity"].holds
    assert not found["tracking_growth"].holds
    bad = found["tracking_growth"].bad
    assert bad is not None and bad[-1] and not bad[:150].any()
    outcome = _outcome(drifting, reference, robot, limits)
    assert "tracking_growth" in {reason.code for reason in outcome.reasons}
    assert outcome.pieces and outcome.pieces[0].clip.frame_count >= 150, "what it tracked goes on"


def test_an_arm_that_stays_away_is_told_by_how_long(robot, limits, reference, rollout):
    away = np.zeros(300)
    away[100:150] = 0.9
    found = _verdicts(_off(rollout, robot, "Left_Shoulder_Roll", -away), reference, robot, limits)
    assert found["tracking_away_s"].value == pytest.approx(1.0, abs=0.1)
    assert not found["tracking_away_s"].holds
    assert found["tracking_growth"].holds, "it came back"


def test_the_frames_in_which_an_arm_stays_away_too_long_are_blamed(robot, limits, reference):
    too_long, short_enough = (round(share * limits.tracking.away_s * 50.0) for share in (1.4, 0.7))
    away = np.zeros(300)
    away[50 : 50 + short_enough] = away[150 : 150 + too_long] = 1.2
    found = _verdicts(_off(reference, robot, "Left_Shoulder_Roll", away), reference, robot, limits)["tracking_away_s"]
    assert not found.holds and found.bad is not None
    assert np.flatnonzero(found.bad).tolist() == list(range(150, 150 + too_long))


@pytest.mark.parametrize(
    ("variant", "of_reference"),
    [
        ({"start_frame": 60}, (60, 300)),
        ({"stretch_start_s": 1.0}, (50, 300)),
        ({"start_frame": 50, "stretch_start_s": 1.0}, (100, 300)),
    ],
)
def test_a_window_is_held_against_the_same_times_of_the_reference(robot, reference, variant, of_reference):
    window = reference.cut(*of_reference, "window")
    numbers = {CONTENT: "a", "fps": 50.0, **variant}
    found = reference_of(window, numbers, robot, {"a": reference}.__getitem__)
    np.testing.assert_allclose(found.joint_pos, window.joint_pos, atol=1e-12)


@pytest.mark.parametrize(
    ("place", "of_reference"),
    [
        ({}, (0, 200)),
        ({"reference_frame": 60}, (60, 300)),
        ({"reference_frame": 50, "stretch_start_s": 1.0}, (50, 300)),  # the reference is a stretch of its variant
    ],
)
def test_a_rollout_of_kp4_is_held_against_the_frames_that_it_names(robot, reference, place, of_reference):
    rollout = reference.cut(*of_reference, "walk+rollout")
    found = reference_of(rollout, {"reference": "walk", **place}, robot, {"walk": reference}.__getitem__)
    assert found is not None
    assert found.name == "walk+rollout"
    np.testing.assert_array_equal(found.joint_pos, rollout.joint_pos)
    np.testing.assert_array_equal(found.root_pos_w, rollout.root_pos_w)


def test_a_piece_of_a_rollout_has_its_place_in_the_reference_and_holds_when_it_is_judged_again(
    robot, limits, reference
):
    bent = np.interp(np.arange(240), [40, 50, 60, 70], [0.0, 1.0, 1.0, 0.0])
    rollout = _off(reference.cut(60, 300, "walk+1~rollout"), robot, "AAHead_yaw", 2.0 * bent)
    numbers = {"reference": "walk+1", "reference_frame": 60, "stretch_start_s": 1.0}
    references = {"walk+1": reference}.__getitem__
    *_, last = process(rollout, numbers, settings=limits, robot=robot, references=references).pieces
    start = 240 - last.clip.frame_count
    assert start > 60
    assert last.numbers["reference_frame"] == 60 + start
    assert last.numbers["stretch_start_s"] == pytest.approx(1.0 + start / 50.0)
    assert not process(last.clip, last.numbers, settings=limits, robot=robot, references=references).reasons


@pytest.mark.parametrize("share", [0.4, 0.6])
def test_a_rollout_that_loses_most_of_its_reference_does_not_go_on(robot, limits, reference, share):
    numbers = {"reference": "walk", "reference_frame": 0, "followed_share": share}
    references = {"walk": reference}.__getitem__
    outcome = process(reference, numbers, settings=limits, robot=robot, references=references)
    (judgement,) = from_text(str(outcome.numbers[NUMBER]))
    found = judgement.found[FOLLOWED]
    assert (found.value, found.limit, found.lower) == (share, limits.tracking.followed, True)
    holds = share >= limits.tracking.followed
    assert bool(outcome.pieces) == holds
    assert (found.broken == "") == holds
    if not holds:
        assert [reason.code for reason in outcome.reasons] == [FOLLOWED]
        assert "the tracker follows 40 % of the reference; at least 0.5" in outcome.reasons[0].text


def test_how_much_was_followed_is_not_asked_of_a_recording(robot, limits, reference, rollout):
    (judgement,) = from_text(str(_outcome(rollout, reference, robot, limits).numbers[NUMBER]))
    assert judgement.found[FOLLOWED].not_applicable == "no rollout of KP4"


def test_variants_are_held_against_the_same_variant_of_the_reference(robot, root, reference, rollout):
    values = settings.read(root / "data" / "augment.yaml", AugmentSettings)
    numbers = {CONTENT: "a", "fps": 50.0, "skill": "walk"}
    error = tracking_error(rollout, reference, robot)
    pieces = augment(rollout, numbers, settings=values, robot=robot).pieces
    assert {piece.numbers["variant"] for piece in pieces} >= {"original", "mirror"}
    for piece in pieces:
        clip = piece.clip
        assert isinstance(clip, RobotClip)
        found = reference_of(clip, piece.numbers, robot, {"a": reference}.__getitem__)
        own = tracking_error(clip, found, robot)
        assert own.body.max() == pytest.approx(error.body.max(), rel=0.02), piece.numbers["variant"]
        assert own.joint.max() == pytest.approx(error.joint.max(), rel=0.02), piece.numbers["variant"]


def test_a_variant_that_was_changed_on_purpose_is_no_tracked_rollout(robot, limits, reference, rollout):
    longer = _off(rollout, robot, "Left_Shoulder_Roll", np.full(300, -0.3))
    outcome = _outcome(longer, reference, robot, limits, variant="mirror~step_length1.2")
    said = {each.found[code].not_applicable for each in from_text(str(outcome.numbers[NUMBER])) for code in CODES}
    assert said == {"a rollout that was changed on purpose"}


def test_a_reference_that_is_gone_is_a_fault_that_is_tried_again(robot, limits, rollout):
    with pytest.raises(ReferenceGoneError, match="materialize motion_catalog again") as raised:
        process(rollout, {CONTENT: "a"}, settings=limits, robot=robot)
    assert isinstance(raised.value, PipelineError)


def test_a_damaged_reference_in_the_store_rejects_no_clip_for_good(robot, limits, reference, rollout, tmp_path):
    store = Store(root=tmp_path)
    blob = store.put_clip(reference)
    function = partial(
        process, settings=limits, robot=robot, references=StoredReferences(store=store, blobs={"a": blob})
    )
    stage = Stage(name="kp5", version="1", function=function)
    numbers = {CONTENT: "a", "fps": 50.0}
    clips = Manifest(
        stage="before", entries=(Entry(clip="rollout", blob=store.put_clip(rollout), numbers=numbers),), judged=()
    )
    here, log = ClipPool(backend="sequential"), logging.getLogger("test")
    store.own_blobs.path(blob).write_bytes(b"torn")
    (row,) = run_stage(stage, clips, store, here, log).judged
    assert [reason["code"] for reason in row.reasons] == ["failed"]
    assert "does not match its name. Materialize again" in row.reasons[0]["text"]
    store.put_clip(reference)
    found = run_stage(stage, clips, store, here, log)
    assert found.recomputed == 1 and [entry.clip for entry in found.entries] == ["rollout"]


def test_from_two_files_to_a_verdict_through_every_stage(robot, root, limits, reference, rollout, simulated, tmp_path):
    """A rollout sampled at another rate and turned, named in the sources file, cut into a window on its way."""
    fast, turn = simulated.clip("rollout", 100.0), rotation.about_z(1.0)
    turned = dataclasses.replace(
        fast,
        root_pos_w=rotation.rotate(turn, fast.root_pos_w),
        root_quat_w=rotation.multiply(turn, fast.root_quat_w),
    )
    (tmp_path / "rollout.csv").write_text(encode_csv(turned, {}))
    (tmp_path / "reference.csv").write_text(encode_csv(reference, {}))
    source = Source(
        name="mine",
        folder=tmp_path,
        licence="MIT",
        files=(FileStatement(files="rollout*", tracks="reference.csv"),),
    )

    def read(name: str, kind: type):
        return settings.read(root / "data" / f"{name}.yaml", kind)

    (whole,) = catalogue_file(
        tmp_path / "rollout.csv", "mine/rollout", source, "rollout.csv", settings=read("catalog", CatalogSettings)
    ).pieces
    window = {**whole.numbers, "skill": "stand", "start_frame": 200, "stop_frame": 500}
    (piece,) = repair(whole.clip, window, settings=read("repair", RepairSettings)).pieces
    made = _next(piece, window)
    (piece,) = onto_robot(made.clip, made.numbers, settings=read("retarget", RetargetSettings), robot=robot).pieces
    made = _next(piece, made.numbers)
    pieces = augment(made.clip, made.numbers, settings=read("augment", AugmentSettings), robot=robot).pieces
    content = str(whole.numbers[CONTENT])
    for variant in pieces:
        numbers = {**made.numbers, **variant.numbers}
        outcome = process(
            variant.clip, numbers, settings=limits, robot=robot, references={content: reference}.__getitem__
        )
        assert outcome.pieces, [reason.text for reason in outcome.reasons]
        expected = tracking_error(rollout.cut(100, 250, "w"), reference.cut(100, 250, "w"), robot)
        assert outcome.numbers["tracking_root_height"] == pytest.approx(expected.root_height.max(), abs=1e-3)
        assert outcome.numbers["tracking_body_worst"] == pytest.approx(windowed_mean(expected.body, 25).max(), rel=0.02)
        again = process(
            outcome.pieces[0].clip,
            {**numbers, **outcome.pieces[0].numbers},
            settings=limits,
            robot=robot,
            references={content: reference}.__getitem__,
        )
        assert again.pieces and not again.reasons


def _next(piece: Piece, numbers) -> Piece:
    return Piece(clip=piece.clip, numbers={**numbers, **piece.numbers})


def test_the_robots_stand_is_judged_as_before_where_nothing_was_tracked(robot, limits):
    codes = {verdict.code for verdict in assess(motion_of(standing(robot), robot, limits), limits).verdicts}
    assert not codes & set(CODES)
