"""Perturbed walks: standing feet stay where they are, the stated amount is reached, nothing jumps."""

import dataclasses
import functools

import numpy as np
import pytest

from pipeline import rotation, time_series
from pipeline.augment import AugmentSettings, process
from pipeline.augment.perturb import _along, _steady, gait_of, perturb
from pipeline.augment.process import KINDS, Strengths
from pipeline.clips.outcome import Reason
from pipeline.clips.robot_clip import RobotClip
from pipeline.errors import SettingsError
from pipeline.feasibility import FeasibilitySettings
from pipeline.feasibility import process as judge
from pipeline.files import settings
from pipeline.quality.planar_motion import command_velocity
from pipeline.quality.sole import sole_motion
from pipeline.retarget import RetargetSettings
from pipeline.retarget import process as retarget
from pipeline.robot import Kinematics, load_robot
from pipeline.robot.mirror_image import mirror_clip
from tests.conftest import ROOT
from tests.factories.human_clips import Gait, walker
from tests.factories.robot_clips import standing

ROBOT = load_robot("t1")
CONTACT = settings.read(ROOT / "data/augment.yaml", AugmentSettings).contact
RETARGET = settings.read(ROOT / "data/retarget.yaml", RetargetSettings)
SPEEDS_M_S = (1.1, -0.8)
"""Of the person; the robot's are about .55 of it."""
PLANNED = [
    ("step_length", 0.9),
    ("step_length", 1.02),
    ("step_width", 0.02),
    ("foot_lift", 0.02),
    ("trunk_lean", 2.0),
    ("trunk_lean", -2.0),
]


@functools.cache
def walking(speed_m_s: float) -> RobotClip:
    """A person's walk on the robot."""
    human = walker(seconds=4.0, gait=Gait(speed_m_s=speed_m_s))
    (piece,) = retarget(human, {}, settings=RETARGET, robot=ROBOT).pieces
    assert isinstance(piece.clip, RobotClip)
    return piece.clip


@functools.cache
def variant(speed_m_s: float, kind: str, strength: float) -> RobotClip:
    return made(walking(speed_m_s), kind, strength)


def made(clip: RobotClip, kind: str, strength: float) -> RobotClip:
    found = perturb(clip, ROBOT, kind, strength, f"{clip.name}~{kind}", CONTACT)
    assert isinstance(found, RobotClip), found
    return found


def feet_w(clip: RobotClip) -> np.ndarray:
    """Corners of both soles (t, 2, 4, 3)."""
    return sole_motion(clip, ROBOT).corner_pos_w


def stances(clip: RobotClip, side: int) -> list[slice]:
    assert clip.contacts is not None
    found = [slice(start, stop) for start, stop in time_series.runs(clip.contacts[:, side])]
    assert len(found) > 2
    return found


@pytest.mark.parametrize("speed_m_s", SPEEDS_M_S)
@pytest.mark.parametrize(("kind", "strength"), PLANNED)
def test_a_standing_foot_stands_as_it_did_elsewhere(kind: str, strength: float, speed_m_s: float):
    clip, new = walking(speed_m_s), variant(speed_m_s, kind, strength)
    moved = feet_w(new) - feet_w(clip)
    for side in range(2):
        for stance in stances(clip, side):
            first = np.broadcast_to(moved[stance.start, side], moved[stance, side].shape)
            np.testing.assert_allclose(moved[stance, side], first, atol=1e-6)
            assert np.abs(moved[stance, side, :, 2]).max() < 1e-6, "its height stays"


@pytest.mark.parametrize("speed_m_s", SPEEDS_M_S)
@pytest.mark.parametrize("factor", [0.9, 1.02])
def test_speed_goes_with_the_length_of_steps(factor: float, speed_m_s: float):
    clip, new = walking(speed_m_s), variant(speed_m_s, "step_length", factor)
    before, after = (command_velocity(each.root_pos_w, each.root_quat_w, each.fps) for each in (clip, new))
    assert after.forward_m_s == pytest.approx(factor * before.forward_m_s, rel=1e-9)
    np.testing.assert_array_equal(clip.contacts, new.contacts)
    for side in range(2):
        starts = [stance.start for stance in stances(clip, side)]
        before_m, after_m = (feet_w(each)[starts, side].mean(axis=1)[:, 0] for each in (clip, new))
        np.testing.assert_allclose(np.diff(after_m)[1:-1], factor * np.diff(before_m)[1:-1], atol=2e-3)
        ahead, shorter = before_m - clip.root_pos_w[starts, 0], after_m - new.root_pos_w[starts, 0]
        np.testing.assert_allclose(shorter[1:-1], factor * ahead[1:-1], atol=2e-3)


def test_feet_are_further_apart_by_the_stated_width():
    clip, new = walking(1.1), variant(1.1, "step_width", 0.02)
    apart = (feet_w(new) - feet_w(clip)).mean(axis=2)
    np.testing.assert_allclose(apart[:, 0, 1] - apart[:, 1, 1], 0.02, atol=2e-4)
    np.testing.assert_allclose(apart[:, :, 0], 0.0, atol=2e-3)
    np.testing.assert_array_equal(new.root_quat_w, clip.root_quat_w)


def test_each_swing_is_higher_by_the_stated_lift_where_the_foot_is_highest():
    clip, new = walking(1.1), variant(1.1, "foot_lift", 0.02)
    feet = [int(ROBOT.tree.site_link[ROBOT.site(foot)]) for foot in ROBOT.feet]
    kinematics = Kinematics(ROBOT)
    before, after = (
        kinematics.forward(each.root_pos_w, each.root_quat_w, each.joint_pos).pos_w[:, feet, 2] for each in (clip, new)
    )
    assert clip.contacts is not None
    height = sole_motion(clip, ROBOT).height
    for side in range(2):
        for start, stop in time_series.runs(~clip.contacts[:, side])[1:-1]:
            raised = after[start:stop, side] - before[start:stop, side]
            assert raised.max() == pytest.approx(0.02, abs=1e-4)
            assert raised[np.argmax(height[start:stop, side])] == pytest.approx(0.02, abs=1e-4)
            assert raised.min() > -1e-4


@pytest.mark.parametrize("lean_deg", [2.0, -2.0])
def test_the_trunk_leans_and_hips_and_feet_stay(lean_deg: float):
    clip, new = walking(1.1), variant(1.1, "trunk_lean", lean_deg)
    turned = rotation.multiply(new.root_quat_w, rotation.conjugate(clip.root_quat_w))
    np.testing.assert_allclose(np.degrees(rotation.to_rotvec(turned)) @ [0.0, 1.0, 0.0], lean_deg, atol=0.02)
    hips = [ROBOT.human[f"{side}_hip"] for side in ("left", "right")]
    kinematics = Kinematics(ROBOT)
    middle = [
        kinematics.site_pos_w(kinematics.forward(each.root_pos_w, each.root_quat_w, each.joint_pos), hips).mean(axis=1)
        for each in (clip, new)
    ]
    assert np.abs(middle[1] - middle[0]).max() < 2e-3
    head = ROBOT.link("H2")
    poses = [kinematics.forward(each.root_pos_w, each.root_quat_w, each.joint_pos) for each in (clip, new)]
    assert np.all(np.sign(lean_deg) * (poses[1].pos_w[:, head, 0] - poses[0].pos_w[:, head, 0]) > 0.01)


@pytest.mark.parametrize("speed_m_s", SPEEDS_M_S)
@pytest.mark.parametrize(("kind", "strength"), PLANNED)
def test_nothing_jumps_where_a_foot_is_put_down_or_taken_up(kind: str, strength: float, speed_m_s: float):
    clip, new = walking(speed_m_s), variant(speed_m_s, kind, strength)

    def peak(values: np.ndarray) -> float:
        return float(np.abs(np.diff(values, n=2, axis=0)).max() * clip.fps**2)

    assert peak(new.joint_pos) < 1.1 * peak(clip.joint_pos)
    assert peak(new.root_pos_w) < 1.05 * peak(clip.root_pos_w)
    changed = np.abs(np.diff(new.joint_pos - clip.joint_pos, n=2, axis=0)).max(axis=1) * clip.fps**2
    for side in range(2):
        for stance in stances(clip, side):
            edges = [frame for frame in (stance.start, stance.stop - 1) if 2 < frame < clip.frame_count - 3]
            assert changed[[frame - 1 for frame in edges]].max(initial=0.0) < 0.15 * peak(clip.joint_pos)


@pytest.mark.parametrize(("kind", "strength"), PLANNED)
def test_the_mirror_of_a_variant_is_the_variant_of_the_mirror(kind: str, strength: float):
    clip = walking(1.1)
    one = mirror_clip(variant(1.1, kind, strength), ROBOT, "one")
    other = made(mirror_clip(clip, ROBOT, "mirror"), kind, strength)
    np.testing.assert_allclose(other.joint_pos, one.joint_pos, atol=2e-3)
    np.testing.assert_allclose(other.root_pos_w, one.root_pos_w, atol=1e-3)
    assert rotation.angle_between(other.root_quat_w, one.root_quat_w).max() < 1e-6


@pytest.mark.parametrize("yaw", [1.3, -2.6])
@pytest.mark.parametrize(("kind", "strength"), PLANNED)
def test_the_variant_of_a_turned_walk_is_the_turned_variant(kind: str, strength: float, yaw: float):
    def turned(clip: RobotClip) -> RobotClip:
        turn = rotation.about_z(yaw)
        root_pos_w = rotation.rotate(turn, clip.root_pos_w) + np.array([3.0, -2.0, 0.0])
        return dataclasses.replace(clip, root_pos_w=root_pos_w, root_quat_w=rotation.multiply(turn, clip.root_quat_w))

    one, other = turned(variant(1.1, kind, strength)), made(turned(walking(1.1)), kind, strength)
    np.testing.assert_allclose(other.joint_pos, one.joint_pos, atol=1e-6)
    np.testing.assert_allclose(other.root_pos_w, one.root_pos_w, atol=1e-7)
    assert rotation.angle_between(other.root_quat_w, one.root_quat_w).max() < 1e-6


@pytest.mark.parametrize(("kind", "strength"), [("step_length", 1.02), ("step_width", 0.02)])
def test_the_root_is_lowered_until_no_leg_is_stretched_further(kind: str, strength: float):
    clip, new = walking(1.1), variant(1.1, kind, strength)

    def longest(some: RobotClip) -> float:
        pos_w = Kinematics(ROBOT).forward(some.root_pos_w, some.root_quat_w, some.joint_pos).pos_w
        ends = [("Hip_Pitch_Left", "left_foot_link"), ("Hip_Pitch_Right", "right_foot_link")]
        return max(rotation.length(pos_w[:, ROBOT.link(a)] - pos_w[:, ROBOT.link(b)]).max() for a, b in ends)

    lowered = clip.root_pos_w[:, 2] - new.root_pos_w[:, 2]
    assert longest(new) <= longest(clip) + 1e-6
    assert np.ptp(lowered) < 1e-12 and 0.0 < lowered[0] < 0.03


def test_a_robot_that_turns_steadily_has_its_heading_to_the_last_frame():
    turning = np.linspace(0.3, 4.3, 200)
    np.testing.assert_allclose(_steady(turning, 50.0), turning, atol=1e-12)
    swaying = turning + 0.1 * np.sin(2.0 * np.pi * np.arange(200) / 51.0)
    assert np.abs(_steady(swaying, 50.0) - turning)[30:-30].max() < 1e-3


@pytest.mark.parametrize("yaw", [0.0, 2.2])
def test_from_a_slow_walk_on_the_steps_are_scaled_along_the_path(yaw: float):
    """At 0.3 m/s the path has a direction: nearly all of what is along it counts, and nothing of what is beside it."""
    clip = standing(ROBOT, seconds=4.0)
    along, beside = np.array([np.cos(yaw), np.sin(yaw), 0.0]), np.array([-np.sin(yaw), np.cos(yaw), 0.0])
    way = 0.3 * np.arange(clip.frame_count)[:, None] / clip.fps * along
    gait = gait_of(dataclasses.replace(clip, root_pos_w=clip.root_pos_w + way), ROBOT, CONTACT)
    for frame in (0, 100, clip.frame_count - 1):
        found = _along(gait, frame, 0.2 * along + 0.1 * beside)
        assert found @ along == pytest.approx(0.2, rel=0.05)
        assert found @ beside == pytest.approx(0.0, abs=1e-9)


def test_an_ankle_at_its_limit_lets_the_foot_turn_in_the_air_and_never_on_the_ground():
    clip = walking(1.1)
    lower = ROBOT.joint_lower.copy()
    ankle = ROBOT.joint("Left_Ankle_Pitch")
    lower[ankle] = clip.joint_pos[:, ankle].min()
    robot = dataclasses.replace(ROBOT, joint_lower=lower)
    new = perturb(clip, robot, "foot_lift", 0.02, "lifted", CONTACT)
    assert isinstance(new, RobotClip)
    assert new.joint_pos[:, ankle].min() >= lower[ankle] - 1e-6
    feet = [Kinematics(ROBOT).forward(each.root_pos_w, each.root_quat_w, each.joint_pos).quat_w for each in (clip, new)]
    foot = int(ROBOT.tree.site_link[ROBOT.site(ROBOT.feet[0])])
    turned = rotation.angle_between(feet[0][:, foot], feet[1][:, foot])
    assert clip.contacts is not None
    assert turned[clip.contacts[:, 0]].max() < 1e-6
    assert 0.02 < turned.max() < 0.15


@pytest.mark.parametrize(("kind", "strength"), PLANNED)
def test_arms_head_and_waist_are_the_originals(kind: str, strength: float):
    clip, new = walking(1.1), variant(1.1, kind, strength)
    upper = [index for index, name in enumerate(ROBOT.joint_names) if not any(leg in name for leg in LEGS)]
    np.testing.assert_array_equal(new.joint_pos[:, upper], clip.joint_pos[:, upper])
    assert np.all(new.joint_pos >= ROBOT.joint_lower - 1e-6) and np.all(new.joint_pos <= ROBOT.joint_upper + 1e-6)


LEGS = ("Hip", "Knee", "Ankle")


def test_what_a_leg_cannot_do_is_a_reason_with_the_frame():
    found = perturb(walking(-0.8), ROBOT, "step_length", 1.3, "test~big", CONTACT)
    assert isinstance(found, Reason) and found.effect == "rejected"
    assert "is not made: frame" in found.text and found.start_s is not None


def test_a_stand_has_no_longer_steps_and_no_swings_but_may_stand_wider():
    clip = standing(ROBOT)
    for kind, strength in (("step_length", 0.9), ("foot_lift", 0.02)):
        found = perturb(clip, ROBOT, kind, strength, "test~none", CONTACT)
        assert isinstance(found, Reason) and (found.code, found.effect) == ("nothing_to_perturb", "noted")
    wider = (feet_w(made(clip, "step_width", 0.03)) - feet_w(clip)).mean(axis=2)
    np.testing.assert_allclose(wider[:, :, 1], [[0.015, -0.015]] * clip.frame_count, atol=1e-6)


def test_a_clip_that_says_nothing_of_its_contacts_is_looked_at():
    clip = dataclasses.replace(walking(1.1), contacts=None)
    new = made(clip, "step_length", 0.9)
    assert new.contacts is None
    slip = np.linalg.norm(np.diff(feet_w(new).mean(axis=2)[..., :2], axis=0), axis=-1).min(axis=1)
    before = np.linalg.norm(np.diff(feet_w(clip).mean(axis=2)[..., :2], axis=0), axis=-1).min(axis=1)
    assert np.percentile(slip, 90) < np.percentile(before, 90) + 1e-3


@pytest.mark.parametrize(("kind", "strength"), PLANNED)
def test_kp5_lets_a_walk_with_it_pass(kind: str, strength: float):
    limits = settings.read(ROOT / "data/feasibility.yaml", FeasibilitySettings)
    outcome = judge(variant(1.1, kind, strength), {}, settings=limits, robot=ROBOT)
    assert [piece.clip.frame_count for piece in outcome.pieces] == [walking(1.1).frame_count], outcome.reasons


def test_variants_say_what_they_are_and_their_numbers_hold():
    planned = Strengths(step_length=(0.9,), foot_lift=(0.02,))
    asked = AugmentSettings(mirror=True, time_scales=(1.1,), unscaled_skills=(), perturbations=planned, contact=CONTACT)
    said = {"skill": "turn_left", "forward_m_s": 0.6, "yaw_rate_rad_s": 0.4, "trunk_error_deg": 2.0}
    outcome = process(walking(1.1), said, settings=asked, robot=ROBOT)
    pieces = {str(piece.numbers["variant"]): piece for piece in outcome.pieces}
    assert list(pieces) == [
        *("original", "mirror", "x1.1", "mirror~x1.1"),
        *("step_length0.9", "mirror~step_length0.9", "foot_lift0.02", "mirror~foot_lift0.02"),
    ]
    short = pieces["mirror~step_length0.9"]
    assert short.clip.name == "walker~mirror~step_length0.9"
    wanted = {"skill": "turn_right", "yaw_rate_rad_s": -0.4, "mirrored": True, "time_scale": 1.0, "parent": "walker"}
    strengths = {"step_length": 0.9, "step_width_m": 0.0, "foot_lift_m": 0.0, "trunk_lean_deg": 0.0}
    assert {**wanted, **strengths, "forward_m_s": 0.54, "trunk_error_deg": 2.0}.items() <= short.numbers.items()
    assert "foot_lift_m" not in pieces["mirror"].numbers, "what is not perturbed says nothing of it"


def test_variants_that_are_not_made_are_reasons_and_the_others_go_on():
    planned = Strengths(step_length=(1.3, 0.95))
    asked = AugmentSettings(mirror=False, time_scales=(), unscaled_skills=(), perturbations=planned, contact=CONTACT)
    outcome = process(walking(-0.8), {}, settings=asked, robot=ROBOT)
    assert [piece.numbers["variant"] for piece in outcome.pieces] == ["original", "step_length0.95"]
    assert len(outcome.reasons) == 1 and outcome.reasons[0].text.startswith("step_length1.3 is not made: frame")


@pytest.mark.parametrize("kind", KINDS)
def test_strengths_that_are_none_or_too_much_are_refused_by_name(kind: str):
    for strength in (KINDS[kind].neutral, 50.0):
        with pytest.raises(SettingsError, match=rf"'{kind}\[0\]' is .*(the original|allowed is)"):
            settings.parse(Strengths, {kind: [strength]}, ROOT / "data/augment.yaml")
