"""The scorer, against motions whose figures are known."""

import dataclasses

import numpy as np
import pytest

from pipeline import rotation
from pipeline.clips.robot_clip import RobotClip
from pipeline.errors import ClipError
from pipeline.robot import load_robot
from pipeline.scoring import FIGURES, aligned, pooled, score
from pipeline.scoring.align import STRICTNESSES, stance_labels
from pipeline.scoring.figures import Pooling
from tests.factories.human_clips import Gait, walker
from tests.factories.retarget_clips import person_of

ROBOT = load_robot("t1")
FPS = 50.0
TOE = np.array([0.085, 0.0, -0.035])


def still(frames: int = 60) -> RobotClip:
    return RobotClip(
        name="robot",
        fps=FPS,
        robot="t1",
        joint_names=ROBOT.joint_names,
        root_pos_w=np.tile([0.0, 0.0, ROBOT.default_root_height], (frames, 1)),
        root_quat_w=np.tile(rotation.IDENTITY, (frames, 1)),
        joint_pos=np.tile(ROBOT.default_joint_pos, (frames, 1)),
    )


def figures_of(clip: RobotClip, human=None) -> dict[str, float]:
    return score(human or person_of(still(clip.frame_count), ROBOT, TOE), clip, ROBOT).figures()


def test_a_robot_that_stands_as_the_person_does_has_no_fault():
    figures = figures_of(still())
    height = figures.pop("height_shift_mm")
    assert height < 5.0
    for key, value in figures.items():
        assert value == pytest.approx(0.0, abs=1e-4), key


def test_feet_that_slide_at_a_speed_have_that_slip_and_drift_by_its_way():
    clip = still(51)
    root = clip.root_pos_w.copy()
    root[:, 0] += 0.1 * np.arange(51) / FPS
    figures = figures_of(dataclasses.replace(clip, root_pos_w=root))
    for name in STRICTNESSES:
        assert figures[f"slip_{name}_m_s"] == pytest.approx(0.1, rel=1e-6)
    assert figures["drift_cm"] == pytest.approx(10.0, rel=1e-6)


def test_one_height_shift_is_taken_out_and_a_dip_under_it_is_penetration():
    clip = still(100)
    root = clip.root_pos_w.copy()
    root[:, 2] += 0.2
    root[40:45, 2] -= 0.03
    figures = figures_of(dataclasses.replace(clip, root_pos_w=root))
    assert figures["height_shift_mm"] == pytest.approx(200.0, abs=5.0)
    assert figures["penetration_max_cm"] == pytest.approx(3.0, abs=1e-6)
    assert figures["penetration_over_1cm_percent"] == pytest.approx(5.0)


def test_a_frame_over_a_limit_and_the_step_to_it_are_counted():
    clip = still(100)
    joints = clip.joint_pos.copy()
    knee = ROBOT.joint("Left_Knee_Pitch")
    joints[50, knee] = ROBOT.joint_upper[knee] + 0.01
    figures = figures_of(dataclasses.replace(clip, joint_pos=joints))
    assert figures["position_limit_percent"] == pytest.approx(1.0)
    assert figures["speed_limit_percent"] == pytest.approx(100.0 * 2 / 99)
    assert figures["jump_percent"] == pytest.approx(3.0)


def test_a_forearm_in_the_belly_is_a_self_collision():
    joints = still().joint_pos.copy()
    joints[:30, ROBOT.joint("Left_Shoulder_Roll")] = -1.57
    joints[:30, ROBOT.joint("Left_Elbow_Pitch")] = 1.57
    joints[:30, ROBOT.joint("Left_Elbow_Yaw")] = -1.9
    figures = figures_of(dataclasses.replace(still(), joint_pos=joints))
    assert figures["self_collision_percent"] == 50.0
    assert 4.0 < figures["self_collision_max_cm"] < 12.0, "a forearm is 6 to 8 cm thick"


def test_a_leaning_trunk_is_a_trunk_error_and_the_pelvis_tilts_with_it():
    lean = rotation.from_axis_angle(np.array([0.0, 1.0, 0.0]), np.full(60, 0.2))
    figures = figures_of(dataclasses.replace(still(), root_quat_w=lean))
    assert figures["trunk_error_deg"] == pytest.approx(np.rad2deg(0.2), abs=1e-6)
    assert figures["pelvis_tilt_error_deg"] == pytest.approx(np.rad2deg(0.2), abs=1e-6)
    assert figures["heading_error_deg"] == pytest.approx(0.0, abs=1e-6)


def test_clips_are_pooled_by_their_samples_and_depths_by_the_deepest():
    scores = [score(person_of(still(n), ROBOT, TOE), still(n), ROBOT) for n in (60, 20)]
    whole = pooled(scores)
    assert whole.frames == 80
    for figure in FIGURES:
        parts = np.concatenate([part.samples[figure.key] for part in scores])
        pools = {Pooling.MEAN: np.mean, Pooling.LARGEST: np.max, Pooling.RMS: lambda x: np.sqrt(np.mean(x**2))}
        wanted = pools[figure.pooling](parts)
        assert whole.figures()[figure.key] == pytest.approx(wanted)


def test_a_person_in_the_air_gives_no_slip_rather_than_none():
    human = person_of(still(), ROBOT, TOE)
    fall = np.linspace(0.0, 6.0, 60)[:, None] * [0.0, 0.0, 1.0]
    flying = dataclasses.replace(human, body_pos_w=human.body_pos_w + fall[:, None])
    assert np.isnan(figures_of(still(), flying)["slip_strict_m_s"])


@pytest.mark.parametrize("fps", [30.0, 60.0, 120.0])
def test_the_labels_find_the_stances_of_a_walker_at_any_rate(fps):
    human = walker(seconds=6.0, fps=fps, gait=Gait(speed_m_s=1.1))
    share = {}
    for name, labels in stance_labels(human).items():
        share[name] = labels.mean()
        assert np.mean(human.contacts[labels]) > 0.9, name
    assert 0.2 < share["strict"] <= share["middle"] <= share["loose"] < 0.75


def test_the_labels_are_not_the_clips_contacts():
    human = walker(seconds=3.0)
    without = dataclasses.replace(human, contacts=None)
    for own, other in zip(stance_labels(human).values(), stance_labels(without).values(), strict=True):
        np.testing.assert_array_equal(own, other)


def test_both_are_brought_to_the_robots_rate_and_length():
    clip = still(61)
    human, robot = aligned(person_of(clip, ROBOT, TOE).resampled(30.0), clip, ROBOT)
    assert human.fps == robot.fps == FPS
    assert human.frame_count == robot.frame_count
    assert 60 <= robot.frame_count <= 61


def test_lengths_that_differ_are_refused():
    with pytest.raises(ClipError, match=r"it is 2\.00 s long, the human 'robot' 1\.20 s"):
        aligned(person_of(still(60), ROBOT, TOE), still(100), ROBOT)
