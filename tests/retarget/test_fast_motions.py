"""Lean, side steps and the pelvis's path: the plan departs from the human only where the robot must."""

import dataclasses
from pathlib import Path

import numpy as np
import pytest

from pipeline import rotation
from pipeline.clips.human_clip import HumanClip, body
from pipeline.clips.robot_clip import RobotClip
from pipeline.files import settings as settings_file
from pipeline.retarget import RetargetSettings, process
from pipeline.retarget.clearance import _sideways_or_shortest, shank_overlap, through_stances
from pipeline.retarget.foot_plan import contacts_of
from pipeline.retarget.foot_reach import Hips, lacking
from pipeline.retarget.narrowing import lateral_share, narrowed
from pipeline.retarget.pelvis_path import fading_grip, held_share, smoothed_path, smoothed_share
from pipeline.retarget.robot_body import ankle_pitch
from pipeline.retarget.solver import Solver, solver_for
from pipeline.retarget.solver_urdf import FRAME
from pipeline.retarget.trunk_lean import limited_lean
from pipeline.robot import Kinematics, load_robot
from pipeline.scoring import score
from pipeline.simulation.mujoco_plant import self_collision
from tests.factories.human_clips import Gait, standing, walker

ROBOT = load_robot("t1")
SETTINGS = settings_file.read(Path(__file__).resolve().parents[2] / "data/retarget.yaml", RetargetSettings)
FPS = 50.0
UP = np.array([0.0, 0.0, 1.0])
LEFT_W = np.tile([0.0, 1.0, 0.0], (100, 1))


def leaning(angle: np.ndarray) -> np.ndarray:
    return rotation.multiply(
        rotation.about_z(np.full(len(angle), 0.3)), rotation.from_axis_angle(np.array([0.0, 1.0, 0.0]), angle)
    )


def lean_of(quat_w: np.ndarray) -> np.ndarray:
    return np.arccos(np.clip(rotation.rotate(quat_w, UP)[:, 2], -1.0, 1.0))


def test_a_bent_back_is_followed_up_to_the_limit_in_its_direction():
    angle = np.linspace(0.0, 1.2, 100)
    chest, pelvis = leaning(angle), leaning(0.4 * angle)
    trunk, taken_off = limited_lean(chest, pelvis, SETTINGS.trunk)
    lean, free = lean_of(trunk), angle < SETTINGS.trunk.free_lean
    np.testing.assert_array_equal(trunk[free], chest[free])
    assert np.all(np.diff(lean) > -1e-9), "more lean of the person never is less of the robot"
    assert lean.max() < np.deg2rad(45.0)
    assert taken_off == pytest.approx(1.2 - lean[-1])
    np.testing.assert_allclose(rotation.yaw_of(trunk), 0.3, atol=1e-9)


def test_a_person_who_lies_is_followed():
    lying = leaning(np.full(50, 1.5))
    trunk, taken_off = limited_lean(lying, lying, SETTINGS.trunk)
    np.testing.assert_array_equal(trunk, lying)
    assert taken_off == 0.0


def test_a_foot_lacks_what_the_adducted_leg_can_not_reach():
    hips = Hips(pos_w=np.zeros((1, 2, 3)), left_w=LEFT_W[:1], sin_adduction=np.sin([0.2, 0.2]))
    for inward in (0.1, 0.2, 0.3):
        ankle = 0.5 * np.array([0.0, -np.sin(inward), -np.cos(inward)])
        left = np.concatenate([ankle, [0.0, 0.0]])[None]
        feet = np.stack([left, left * [1.0, -1.0, 1.0, 1.0, 1.0]])
        expected = max(0.5 * (np.sin(inward) - np.sin(0.2)), 0.0)
        np.testing.assert_allclose(lacking(feet, hips), expected, atol=1e-12)


def test_narrowing_keeps_standing_feet_and_scales_the_way_sideways():
    person = standing(seconds=100 / 60.0)
    pos_w = person.body_pos_w.copy()
    feet = [body(f"{side}_{part}") for side in ("left", "right") for part in ("ankle", "toe")]
    others = [index for index in range(pos_w.shape[1]) if index not in feet]
    pos_w[:, others, 1] += 0.2 * np.sin(np.linspace(0.0, 3.0, len(pos_w)))[:, None]
    clip = dataclasses.replace(person, body_pos_w=pos_w)
    thin = narrowed(clip, LEFT_W, np.full(100, 0.6))
    for side in ("left", "right"):
        assert np.abs(np.diff(thin.pos(f"{side}_toe")[:, 1])).max() < 2e-4
        np.testing.assert_array_equal(thin.pos(f"{side}_toe")[:, [0, 2]], clip.pos(f"{side}_toe")[:, [0, 2]])
    way, full = (np.ptp(each.pos("pelvis")[:, 1]) for each in (thin, clip))
    assert way == pytest.approx(0.6 * full, rel=0.01)


def test_a_clip_whose_feet_reach_is_not_narrowed():
    clip = walker(seconds=2.0)
    share = lateral_share(np.full(clip.frame_count, SETTINGS.narrowing.free), SETTINGS.narrowing, clip.fps)
    assert (share == 1.0).all()
    lateral_w = np.tile([0.0, 1.0, 0.0], (clip.frame_count, 1))
    assert narrowed(clip, lateral_w, share) is clip


def crossing(speed_m_s: float = 0.6, way: float = 0.15) -> HumanClip:
    """A person who walks with the feet across each other: the left by `way` [m] on the right side, and vice versa."""
    clip = walker(seconds=4.0, gait=Gait(speed_m_s=speed_m_s, stride_s=1.0, stance_share=0.6))
    pos_w = clip.body_pos_w.copy()
    for side, inward in (("left", -way), ("right", way)):
        for part, share in (("knee", 0.5), ("ankle", 1.0), ("toe", 1.0)):
            middle = clip.pos("pelvis")[:, 1].mean()
            offset = pos_w[:, body(f"{side}_{part}"), 1] - middle
            pos_w[:, body(f"{side}_{part}"), 1] = middle + offset + share * (inward - offset)
    return dataclasses.replace(clip, body_pos_w=pos_w)


def test_crossed_steps_are_narrowed_recorded_and_the_pelvis_stays_on_its_path():
    human = crossing()
    piece = process(human, {}, settings=SETTINGS, robot=ROBOT).pieces[0]
    assert piece.numbers["lateral_share"] < 0.95
    figures = score(human, piece.clip, ROBOT).figures()
    assert figures["position_limit_percent"] == 0.0
    assert figures["self_collision_percent"] == 0.0
    assert figures["pelvis_velocity_error_m_s"] < 0.15
    assert figures["pelvis_acceleration_ratio"] < 2.0


def test_a_walk_that_the_robot_can_do_changes_nothing():
    numbers = process(walker(seconds=4.0), {}, settings=SETTINGS, robot=ROBOT).pieces[0].numbers
    assert (numbers["lateral_share"], numbers["foothold_moved_m"]) == (1.0, 0.0)
    assert (numbers["lean_taken_off_deg"], numbers["pelvis_held_share"]) == (0.0, 0.0)
    assert numbers["pelvis_smoothed_share"] == 0.0


@pytest.mark.parametrize(("error_m_s", "share"), [(0.1, 0.0), (0.15, 0.0), (0.3, 1.0)])
def test_the_pelvis_is_held_where_its_velocity_goes_astray(error_m_s, share):
    times_s = np.arange(400) / FPS
    planned_w = np.zeros((400, 3))
    hz = 1.5
    reached_w = planned_w.copy()
    reached_w[:, 1] = np.sqrt(2.0) * error_m_s / (2 * np.pi * hz) * np.sin(2 * np.pi * hz * times_s)
    held = held_share(planned_w, reached_w, SETTINGS.pelvis, FPS)
    assert held[100:300].mean() == pytest.approx(share, abs=0.05)


def jerked(acceleration_m_s2: float) -> tuple[np.ndarray, np.ndarray]:
    """A straight path, and one that is pushed off it by a smooth bump with such a peak acceleration at 4 s."""
    times_s = np.arange(400) / FPS
    planned_w = np.column_stack([times_s, 0.0 * times_s, 0.5 + 0.0 * times_s])
    width_s = 0.1
    bump = acceleration_m_s2 * width_s**2 * np.exp(-0.5 * ((times_s - 4.0) / width_s) ** 2)
    return planned_w, planned_w + bump[:, None] * np.array([0.0, 0.6, 0.8])


def test_a_calm_path_is_not_smoothed():
    planned_w, reached_w = jerked(0.9 * SETTINGS.pelvis.jerky_ratio * SETTINGS.pelvis.least_peak_m_s2)
    assert not smoothed_share(planned_w, reached_w, SETTINGS.pelvis, FPS).any()


def test_a_jerked_path_is_smoothed_around_the_jerk_alone():
    planned_w, reached_w = jerked(20.0)
    share = smoothed_share(planned_w, reached_w, SETTINGS.pelvis, FPS)
    assert share[195:206].min() > 0.99
    assert not share[:150].any()
    assert not share[250:].any()
    path_w = smoothed_path(planned_w, reached_w, share, SETTINGS.pelvis, FPS)
    np.testing.assert_array_equal(path_w[share == 0.0], planned_w[share == 0.0])
    peak, before = (np.abs(np.diff(each[:, 1], n=2)).max() * FPS**2 for each in (path_w, reached_w))
    assert peak < 0.6 * before
    assert (path_w[195:206, 2] >= reached_w[195:206, 2] - 0.01).all(), "legs at their limits need the height"


@pytest.mark.parametrize(("speed_m_s", "way"), [(1.5, 0.15), (1.0, 0.3)])
def test_steps_that_the_legs_barely_reach_do_not_jerk_the_pelvis(speed_m_s, way):
    human = crossing(speed_m_s, way)
    off = dataclasses.replace(SETTINGS, pelvis=dataclasses.replace(SETTINGS.pelvis, jerky_ratio=99.0))
    with_it, without = (process(human, {}, settings=each, robot=ROBOT).pieces[0].numbers for each in (SETTINGS, off))
    assert without["pelvis_smoothed_share"] == 0.0 < with_it["pelvis_smoothed_share"]
    assert with_it["pelvis_acceleration_ratio"] < 1.5 < 2.0 < without["pelvis_acceleration_ratio"]
    assert with_it["pelvis_velocity_error_m_s"] < without["pelvis_velocity_error_m_s"]
    assert with_it["slip_m_s"] < 1.05 * without["slip_m_s"]


def test_shanks_are_too_close_where_mujoco_finds_them_in_a_thigh():
    rng, frames = np.random.default_rng(3), 3000
    joint_pos = np.tile(ROBOT.default_joint_pos, (frames, 1))
    for side, inward in (("Left", -0.2), ("Right", 0.2)):
        joint_pos[:, ROBOT.joint(f"{side}_Hip_Pitch")] = rng.uniform(-1.2, 0.6, frames)
        joint_pos[:, ROBOT.joint(f"{side}_Hip_Roll")] = inward
        joint_pos[:, ROBOT.joint(f"{side}_Hip_Yaw")] = rng.uniform(-0.8, 0.8, frames)
        joint_pos[:, ROBOT.joint(f"{side}_Knee_Pitch")] = rng.uniform(0.3, 2.0, frames)
    origin, upright = np.zeros((frames, 3)), np.tile(rotation.IDENTITY, (frames, 1))
    clip = RobotClip(
        name="legs",
        fps=FPS,
        robot=ROBOT.name,
        joint_names=ROBOT.joint_names,
        root_pos_w=origin,
        root_quat_w=upright,
        joint_pos=joint_pos,
    )
    kinematics = Kinematics(ROBOT)
    poses = kinematics.forward(origin, upright, joint_pos)
    found = shank_overlap(kinematics, poses, ROBOT, SETTINGS.clearance)
    pairs = self_collision(clip, ROBOT).pairs
    touching = np.array(
        [pair is not None and {part.split("_")[1] for part in pair} == {"thigh", "shank"} for pair in pairs]
    )
    assert touching.sum() > 20
    assert (found[touching] > 0.0).all()
    assert not shank_overlap(kinematics, kinematics.forward(*still()), ROBOT, SETTINGS.clearance).any()


def still() -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Root position, orientation and joints of the default pose, one frame."""
    return np.zeros((1, 3)), rotation.IDENTITY[None], ROBOT.default_joint_pos[None]


def test_a_way_outward_is_one_in_each_stance_and_has_no_step():
    contact = np.zeros(60, dtype=bool)
    contact[:20] = contact[40:] = True
    way = np.zeros(60)
    way[19], way[50] = 0.01, 0.03
    held = through_stances(way, contact, 2)
    assert (held[:20] == 0.01).all()
    assert (held[40:] == 0.03).all()
    assert (np.diff(held[19:41]) > 0.0).all()
    assert np.diff(held).max() < 0.002
    assert (through_stances(way, ~contact, 2)[20:40] == 0.01).all(), "close by a stance counts for it"


def test_legs_that_cross_meet_less_where_feet_are_sent_outward():
    human = crossing(1.2, 0.35)
    off = dataclasses.replace(SETTINGS, clearance=dataclasses.replace(SETTINGS.clearance, leg_distance=0.0))
    clips = [process(human, {}, settings=each, robot=ROBOT).pieces[0].clip for each in (SETTINGS, off)]
    deepest, without = (self_collision(clip, ROBOT).depth.max() for clip in clips if isinstance(clip, RobotClip))
    assert without > 0.01
    assert deepest < 0.7 * without


def test_a_hand_over_the_thigh_goes_up_and_one_beside_it_outward():
    outward_w = np.tile([0.0, 1.0, 0.0], (3, 1))
    away_w = np.array([[0.0, 0.08, 0.05], [0.0, -0.03, 0.09], [0.0, 0.03, 0.09]])
    direction_w = _sideways_or_shortest(away_w, outward_w, 0.06)
    np.testing.assert_array_equal(direction_w[0], outward_w[0])
    np.testing.assert_allclose(direction_w[1], away_w[1] / np.linalg.norm(away_w[1]))
    assert 0.0 < direction_w[2, 2] < away_w[2, 2] / np.linalg.norm(away_w[2])
    np.testing.assert_allclose(np.linalg.norm(direction_w, axis=1), 1.0)


def test_the_grip_of_a_foot_is_full_in_stances_and_fades_outside():
    firm = np.zeros((60, 2), dtype=bool)
    firm[20:40, 0] = True
    held = np.ones(60)
    held[:15] = 0.0
    grip = fading_grip(firm, held, SETTINGS.pelvis, FPS)
    assert (grip[20:40, 0] == 1.0).all()
    assert (np.diff(grip[:21, 0]) >= 0.0).all()
    assert (np.diff(grip[39:, 0]) <= 0.0).all()
    assert 0.0 < grip[19, 0] < 1.0
    assert grip[10, 0] == grip[50, 0] == 0.0
    assert not grip[:, 1].any()
    held[:] = 0.0
    assert (fading_grip(firm, held, SETTINGS.pelvis, FPS) == firm).all(), "elsewhere the plan stays"


def test_a_run_has_no_stance_in_the_air_and_keeps_its_pelvis_path():
    human = walker(seconds=3.0, gait=Gait(speed_m_s=3.0, stride_s=0.7, stance_share=0.35))
    at_rate = human.resampled(SETTINGS.fps)
    assert human.contacts is not None
    assert (~human.contacts.any(axis=1)).mean() > 0.2, "the person flies"
    planned = contacts_of(at_rate, SETTINGS.stance)
    theirs = at_rate.contacts
    assert theirs is not None
    assert planned.any(axis=0).all()
    assert (planned & ~theirs).mean() < 0.03
    rough = dataclasses.replace(SETTINGS.pelvis, jerky_ratio=99.0)
    held = dataclasses.replace(rough, tolerated_m_s=0.1, free_m_s=0.05, astray_m_s=0.1)
    loose = dataclasses.replace(rough, tolerated_m_s=9.0)
    held, soft = (dataclasses.replace(SETTINGS, pelvis=pelvis) for pelvis in (held, loose))
    numbers, without = (process(human, {}, settings=each, robot=ROBOT).pieces[0].numbers for each in (held, soft))
    assert without["pelvis_held_share"] == 0.0 < numbers["pelvis_held_share"]
    assert numbers["pelvis_velocity_error_m_s"] < 0.75 * without["pelvis_velocity_error_m_s"]
    assert numbers["slip_m_s"] < 1.1 * without["slip_m_s"]


@pytest.mark.parametrize("name", ["t1", "k1"])
def test_ankles_keep_off_the_limit_that_lifts_the_toes_and_no_other(name: str):
    """The sign is checked by where the toes go: up with an angle that moves towards the limit with the margin."""
    robot = load_robot(name)
    solver, kinematics = solver_for(robot), Kinematics(robot)
    root = np.zeros((2, 3)), np.tile(rotation.IDENTITY, (2, 1))
    for side in range(2):
        index, sign = ankle_pitch(robot, side)
        pose = np.tile(robot.default_joint_pos, (2, 1))
        pose[1, index] -= 0.1 * sign
        corners = kinematics.site_pos_w(kinematics.forward(*root, pose), robot.sole_corners[side])
        front = corners[0, :, 0].argmax()
        assert corners[1, front, 2] > corners[0, front, 2] + 0.005
        low, high = solver._lower[index] - robot.joint_lower[index], robot.joint_upper[index] - solver._upper[index]
        toes_up, toes_down = (low, high) if sign > 0.0 else (high, low)
        assert toes_up > 0.05 > toes_down


def test_the_solver_holds_joints_that_are_not_controlled_at_their_default():
    held = [index for index, name in enumerate(ROBOT.joint_names) if name not in ROBOT.controlled]
    default = ROBOT.default_joint_pos.copy()
    default[held] = 0.3 + 0.1 * np.arange(len(held))
    robot = dataclasses.replace(ROBOT, default_joint_pos=default)
    solver, kinematics = Solver(robot), Kinematics(robot)
    solver._start(np.array([1.0, 2.0, 0.7]), rotation.IDENTITY, default)
    poses = kinematics.forward(np.array([[1.0, 2.0, 0.7]]), rotation.IDENTITY[None], default[None])
    for link, name in enumerate(robot.link_names):
        T_world_link = solver._wrapper.get_T_world_frame(name if name not in robot.joint_names else f"{name}{FRAME}")
        np.testing.assert_allclose(T_world_link[:3, 3], poses.pos_w[0, link], atol=1e-9)
        np.testing.assert_allclose(T_world_link[:3, :3], rotation.to_matrix(poses.quat_w[0, link]), atol=1e-9)
