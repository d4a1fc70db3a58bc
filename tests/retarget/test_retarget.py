"""The stage: limits, feet, scale, symmetry, and the same bytes wherever it runs."""

import dataclasses
import functools
import subprocess
import sys
from pathlib import Path
from xml.etree import ElementTree as Xml

import mujoco
import numpy as np
import pytest

from pipeline import rotation, time_series
from pipeline.clips import codec
from pipeline.clips.human_clip import HumanClip, body
from pipeline.clips.robot_clip import RobotClip
from pipeline.errors import ClipError, PipelineError
from pipeline.files import digest
from pipeline.files import settings as settings_file
from pipeline.quality import retargeting, sole
from pipeline.retarget import RetargetSettings, process, solver_urdf
from pipeline.retarget.process import onto_robot
from pipeline.robot import Kinematics, load_robot, mujoco_model, render
from pipeline.scoring import FIGURES, score
from tests.factories.human_clips import Gait, standing, turned, walker
from tests.factories.retarget_clips import mirrored, person_of, scaled
from tests.factories.robot_folder import copy_robot, replace

ROOT = Path(__file__).resolve().parents[2]
ROBOT = load_robot("t1")
SETTINGS = settings_file.read(ROOT / "data/retarget.yaml", RetargetSettings)


def retarget(clip: HumanClip) -> RobotClip:
    (piece,) = process(clip, {}, settings=SETTINGS, robot=ROBOT).pieces
    return piece.clip


@functools.cache
def walking() -> tuple[HumanClip, RobotClip]:
    human = walker(seconds=4.0)
    return human, retarget(human)


def soles_w(clip: RobotClip, names: tuple[str, ...]) -> np.ndarray:
    kinematics = Kinematics(ROBOT)
    return kinematics.site_pos_w(kinematics.forward(clip.root_pos_w, clip.root_quat_w, clip.joint_pos), names)


def assert_within_limits(clip: RobotClip) -> None:
    assert np.all(clip.joint_pos >= ROBOT.joint_lower)
    assert np.all(clip.joint_pos <= ROBOT.joint_upper)
    one_sided = np.abs(np.diff(clip.joint_pos, axis=0)) * clip.fps
    assert np.all(one_sided <= ROBOT.retarget_speed_limit)
    assert np.all(np.abs(clip.joint_vel()) <= ROBOT.retarget_speed_limit)


@pytest.mark.parametrize("speed_m_s", [0.0, 1.2, 3.4, -0.8])
def test_no_limit_is_passed_whatever_the_speed(speed_m_s):
    share = 0.62 if speed_m_s < 2.0 else 0.4
    clip = retarget(walker(seconds=2.0, gait=Gait(speed_m_s=speed_m_s, stride_s=0.8, stance_share=share)))
    assert_within_limits(clip)


def test_no_limit_is_passed_by_a_motion_no_body_can_do():
    human = walker(seconds=2.0, noise=0.05)
    assert_within_limits(retarget(human))


def test_the_clip_is_at_the_settings_rate_and_as_long_as_the_humans():
    human, clip = walking()
    assert clip.fps == SETTINGS.fps
    assert clip.frame_count == len(time_series.resample_times(human.frame_count, human.fps, SETTINGS.fps))
    theirs = human.contacts[np.rint(np.arange(clip.frame_count) * human.fps / clip.fps).astype(int)]
    assert clip.contacts is not None
    assert np.mean(clip.contacts == theirs) > 0.85


@pytest.mark.parametrize("speed_m_s", [0.5, 1.0])
def test_the_edge_that_a_standing_foot_rolls_over_hardly_slides(speed_m_s):
    clip = retarget(walker(seconds=4.0, gait=Gait(speed_m_s=speed_m_s, stride_s=1.2)))
    assert sole.lowest_corner_slip(sole.sole_motion(clip, ROBOT), clip.contacts)[0] < 0.012


def test_the_soles_stand_on_the_ground_and_not_under_it():
    _, clip = walking()
    height = sole.sole_motion(clip, ROBOT).height
    assert height.min() > -0.005
    assert abs(np.median(height[sole.inner_contacts(clip.contacts)])) < 0.005
    assert height.max() > 0.02, "the feet leave the ground"


def test_a_robot_walks_at_the_humans_speed_times_the_leg_ratio():
    outcome = process(walker(seconds=6.0, gait=Gait(speed_m_s=1.2)), {}, settings=SETTINGS, robot=ROBOT)
    numbers = outcome.pieces[0].numbers
    assert numbers["forward_m_s"] == pytest.approx(1.2 * numbers["leg_ratio"], rel=0.02)
    assert 0.5 < numbers["leg_ratio"] < 0.65


def test_the_robots_own_motion_comes_back():
    """FK(IK(x)) = x for a person with the robot's limbs, at the robot's own scale."""
    _, clip = walking()
    toe = np.array([0.085, 0.0, -0.035])
    again = process(
        person_of(clip, ROBOT, toe), {}, settings=dataclasses.replace(SETTINGS, leg_scale=1.0), robot=ROBOT
    ).pieces[0]
    assert again.numbers["leg_ratio"] == pytest.approx(1.0, abs=0.005)
    assert again.numbers["limb_error_deg"] < 1.5
    assert again.numbers["trunk_error_deg"] < 1.5
    inner = slice(5, -5)
    assert np.abs(again.clip.root_pos_w - clip.root_pos_w)[inner].max() < 0.03
    assert np.abs(again.clip.joint_pos - clip.joint_pos)[inner].mean() < 0.03


def test_people_of_1_5_to_2_m_give_the_same_robot_motion_and_the_scale_is_recorded():
    """Only which frames count as a stance may differ: its thresholds are metres and metres a second."""
    human, _ = walking()
    outcomes = {
        height: process(scaled(human, height / 1.75), {}, settings=SETTINGS, robot=ROBOT).pieces[0]
        for height in (1.5, 1.75, 2.0)
    }
    middle = outcomes[1.75]
    for height, piece in outcomes.items():
        assert np.abs(piece.clip.joint_pos - middle.clip.joint_pos).mean() < 0.01
        assert np.abs(piece.clip.root_pos_w - middle.clip.root_pos_w).max() < 0.03
        assert piece.numbers["leg_ratio"] * height == pytest.approx(middle.numbers["leg_ratio"] * 1.75, rel=0.01)
        assert piece.numbers["forward_m_s"] == pytest.approx(middle.numbers["forward_m_s"], rel=0.01)


def test_with_the_same_stances_the_height_of_the_person_changes_nothing():
    human, _ = walking()
    stances = dataclasses.replace(SETTINGS.stance, toe_height=0.0, toe_speed_m_s=0.0)
    settings = dataclasses.replace(SETTINGS, stance=stances)
    short, tall = (
        process(scaled(human, height / 1.75), {}, settings=settings, robot=ROBOT).pieces[0].clip
        for height in (1.5, 2.0)
    )
    np.testing.assert_allclose(short.joint_pos, tall.joint_pos, atol=0.01)
    np.testing.assert_allclose(short.root_pos_w, tall.root_pos_w, atol=0.005)


def test_turned_and_moved_people_give_turned_and_moved_robots():
    human, clip = walking()
    ratio = process(human, {}, settings=SETTINGS, robot=ROBOT).pieces[0].numbers["leg_ratio"]
    moved = retarget(turned(human, 2.0, (1.0, -3.0, 0.0)))
    turn = rotation.about_z(2.0)
    expected = rotation.rotate(turn, clip.root_pos_w) + ratio * np.array([1.0, -3.0, 0.0])
    np.testing.assert_allclose(moved.joint_pos, clip.joint_pos, atol=1e-4)
    np.testing.assert_allclose(moved.root_pos_w, expected, atol=1e-4)


def test_mirrored_people_give_mirrored_robots():
    human, clip = walking()
    mirror = retarget(mirrored(human))
    expected = ROBOT.mirror_sign * clip.joint_pos[:, ROBOT.mirror_index]
    assert np.abs(mirror.joint_pos - expected).max() < 0.02
    np.testing.assert_allclose(mirror.root_pos_w, clip.root_pos_w * [1.0, -1.0, 1.0], atol=0.005)


def test_the_result_does_not_depend_on_what_was_solved_before():
    human, clip = walking()
    retarget(standing(seconds=1.0))
    retarget(walker(seconds=1.0, gait=Gait(speed_m_s=2.0), noise=0.05))
    assert codec.encode(retarget(human)) == codec.encode(clip)


def test_another_process_gives_the_same_bytes():
    program = (
        "from pathlib import Path\n"
        "from pipeline.clips import codec\n"
        "from pipeline.files import digest, settings\n"
        "from pipeline.retarget import RetargetSettings, process\n"
        "from pipeline.robot import load_robot\n"
        "from tests.factories.human_clips import walker\n"
        "read = settings.read(Path('data/retarget.yaml'), RetargetSettings)\n"
        "outcome = process(walker(seconds=4.0), {}, settings=read, robot=load_robot('t1'))\n"
        "print(digest.of_bytes(codec.encode(outcome.pieces[0].clip)))\n"
    )
    other = subprocess.run([sys.executable, "-c", program], cwd=ROOT, capture_output=True, text=True, check=True)
    assert other.stdout.strip() == digest.of_bytes(codec.encode(walking()[1]))


def test_a_site_with_the_name_of_a_joint_changes_no_motion(tmp_path):
    """Sites are taken out of the solver's URDF; the joint that bore the name of one once went with it."""
    folder = copy_robot(ROOT / "robots" / "t1", tmp_path)
    replace(folder / "sites.csv", "imu,Trunk,", "Left_Elbow_Yaw,Trunk,")
    assert render.main([str(folder)]) == 0
    human = walker(seconds=1.0)
    (piece,) = process(human, {}, settings=SETTINGS, robot=load_robot(folder)).pieces
    assert codec.encode(piece.clip) == codec.encode(retarget(human))


def test_a_joint_that_can_not_be_fixed_is_named():
    with pytest.raises(PipelineError, match="no joint 'Waist' with an origin and an axis"):
        solver_urdf._fix(Xml.fromstring('<robot><joint name="Waist" type="revolute"/></robot>'), "Waist", 0.1)


def test_limbs_trunk_and_heading_follow_the_person():
    numbers = process(walker(seconds=4.0), {}, settings=SETTINGS, robot=ROBOT).pieces[0].numbers
    assert numbers["thigh_error_deg"] < 3.0
    assert numbers["shank_error_deg"] < 3.0
    assert numbers["limb_error_deg"] < 4.5, "straight hanging arms must go round the robot's wide hips"
    assert numbers["trunk_error_deg"] < 3.5
    assert numbers["heading_error_deg"] < 2.0


def test_the_seconds_of_a_clip_are_the_robots():
    human = walker(seconds=1.0).cut(0, 58, "cut")
    (piece,) = process(human, {"seconds": human.duration_s}, settings=SETTINGS, robot=ROBOT).pieces
    assert piece.numbers["seconds"] == piece.clip.duration_s != human.duration_s


def test_a_clips_numbers_are_the_scorers_and_name_the_worst():
    human, clip = walking()
    numbers = process(human, {}, settings=SETTINGS, robot=ROBOT).pieces[0].numbers
    figures = score(human, clip, ROBOT).figures()
    assert numbers["slip_m_s"] == figures["slip_middle_m_s"]
    assert numbers["penetration_m"] == pytest.approx(figures["penetration_max_cm"] / 100.0)
    bars = {figure.key: figure.bar for figure in FIGURES}
    assert numbers["times_its_bar"] == pytest.approx(figures[numbers["worst_figure"]] / bars[numbers["worst_figure"]])
    assert all(
        figures[figure.key] <= numbers["times_its_bar"] * figure.bar + 1e-12
        for figure in FIGURES
        if figure.bar and not figure.at_30_hz and "collision" not in figure.key
    )


def test_missing_samples_are_refused_with_frame_and_body():
    human, _ = walking()
    pos = human.body_pos_w.copy()
    pos[17, body("left_knee")] = np.nan
    with pytest.raises(ClipError, match=r"clip 'walker' frame 17: 'left_knee' has no position"):
        retarget(dataclasses.replace(human, body_pos_w=pos))


def test_a_clip_of_one_frame_is_a_pose():
    human, _ = walking()
    clip = retarget(human.cut(10, 11, "one"))
    assert clip.frame_count == 1
    assert_within_limits(clip)


def test_a_person_who_keeps_still_is_a_still_robot_from_frame_0_on():
    human, _ = walking()
    still = human.cut(40, 90, "still")
    pos, quat = (np.repeat(values[:1], 50, axis=0) for values in (still.body_pos_w, still.body_quat_w))
    clip = retarget(dataclasses.replace(still, body_pos_w=pos, body_quat_w=quat))
    assert np.abs(clip.joint_pos - clip.joint_pos[-1]).max() < 1e-5


def test_a_recording_of_the_robot_goes_on_as_it_is():
    _, clip = walking()
    (piece,) = onto_robot(clip, {}, settings=SETTINGS, robot=ROBOT).pieces
    assert codec.encode(piece.clip) == codec.encode(clip)
    assert piece.numbers["forward_m_s"] > 0.3


def test_a_recording_of_another_robot_is_rejected():
    _, clip = walking()
    outcome = onto_robot(dataclasses.replace(clip, robot="k9"), {}, settings=SETTINGS, robot=ROBOT)
    assert not outcome.pieces
    assert outcome.reasons[0].text == "'walker' is a recording of the robot 'k9', not of 't1'."


def test_crossed_feet_end_up_side_by_side():
    human = standing(seconds=1.0)
    pos = human.body_pos_w.copy()
    for side, sign in (("left", 1.0), ("right", -1.0)):
        for part in ("knee", "ankle", "toe"):
            pos[:, body(f"{side}_{part}"), 1] = sign * -0.02
    clip = retarget(dataclasses.replace(human, body_pos_w=pos))
    left, right = np.moveaxis(soles_w(clip, ROBOT.feet), 1, 0)
    assert (left[:, 1] - right[:, 1]).min() > 0.1


@pytest.mark.shared
@pytest.mark.parametrize("name", ["walk1_subject1_walk2", "multipleActions1_subject1_jog3"])
def test_recorded_motion_keeps_the_limits_and_looks_like_the_person(mocap, name):
    from pipeline.readers import read_motion

    human = read_motion(mocap / f"lafan1_60fps/{name}.bvh", name).clip
    (piece,) = process(human, {}, settings=SETTINGS, robot=ROBOT).pieces
    assert_within_limits(piece.clip)
    assert piece.numbers["limb_error_deg"] < 4.0
    assert piece.numbers["slip_m_s"] < 0.03
    assert piece.numbers["penetration_m"] < 0.02
    assert retargeting.jump_frames(piece.clip).mean() < 0.05


def test_hanging_arms_go_round_the_hips_and_a_hand_in_the_belly_is_taken_further_out():
    human, model = standing(seconds=1.0), mujoco_model(ROBOT)
    assert deepest_contact(retarget(human), model) < 0.002
    pos = human.body_pos_w.copy()
    pos[:, body("left_wrist")] = pos[:, body("left_elbow")] + [0.05, -0.24, 0.03]
    inside = dataclasses.replace(human, body_pos_w=pos)
    without = dataclasses.replace(SETTINGS, clearance=dataclasses.replace(SETTINGS.clearance, trunk_distance=0.0))
    (untouched,) = process(inside, {}, settings=without, robot=ROBOT).pieces
    assert deepest_contact(retarget(inside), model) < 0.6 * deepest_contact(untouched.clip, model)


def deepest_contact(clip: RobotClip, model: mujoco.MjModel) -> float:
    """Depth [m] of the deepest contact between the robot's links in the clip's middle frame."""
    data = mujoco.MjData(model)
    middle = clip.frame_count // 2
    data.qpos[:] = np.concatenate([clip.root_pos_w[middle], clip.root_quat_w[middle], clip.joint_pos[middle]])
    mujoco.mj_forward(model, data)
    return max((-contact.dist for contact in data.contact), default=0.0)
