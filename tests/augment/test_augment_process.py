"""The variants of a clip, and time scaling against motions whose formula is known."""

import dataclasses
from pathlib import Path

import numpy as np
import pytest

from pipeline.augment import AugmentSettings, process
from pipeline.augment.mirror import time_scale_clip, time_scale_numbers
from pipeline.augment.process import Strengths, perturbed_numbers
from pipeline.clips.robot_clip import RobotClip
from pipeline.errors import SettingsError
from pipeline.files import settings
from pipeline.quality.sole import ContactSettings
from pipeline.retarget import RetargetSettings
from pipeline.retarget import process as retarget
from pipeline.retarget.process import velocity_of
from pipeline.robot import Robot
from tests.factories.human_clips import walker
from tests.factories.robot_clips import standing, wandering

CONTACT = ContactSettings(height=0.01, on_speed=0.4, off_speed=0.7, shortest_s=0.04)
BOTH = AugmentSettings(
    mirror=True, time_scales=(0.9, 1.1), unscaled_skills=("stand",), perturbations=Strengths(), contact=CONTACT
)


def test_the_committed_settings_are_read(root: Path):
    assert settings.read(root / "data" / "augment.yaml", AugmentSettings).mirror


def test_a_walk_becomes_six_and_a_stand_two(robot: Robot):
    walk = process(wandering(robot), {"skill": "walk"}, settings=BOTH, robot=robot)
    assert [piece.clip.name.removeprefix("test/wander") for piece in walk.pieces] == [
        "",
        "~mirror",
        "~x0.9",
        "~mirror~x0.9",
        "~x1.1",
        "~mirror~x1.1",
    ]
    assert [piece.numbers["variant"] for piece in walk.pieces][:4] == ["original", "mirror", "x0.9", "mirror~x0.9"]
    assert {piece.numbers["parent"] for piece in walk.pieces} == {"test/wander"}
    stand = process(standing(robot), {"skill": "stand"}, settings=BOTH, robot=robot)
    assert [piece.clip.name for piece in stand.pieces] == ["test/stand", "test/stand~mirror"]


def test_the_original_goes_on_untouched_and_is_not_written_to(robot: Robot):
    clip = wandering(robot)
    before = clip.joint_pos.copy()
    original = process(clip, {"skill": "walk"}, settings=BOTH, robot=robot).pieces[0].clip
    assert original is clip
    np.testing.assert_array_equal(clip.joint_pos, before)


@pytest.mark.parametrize("scale", [0.5, 0.9, 1.1, 2.0])
def test_a_scaled_sine_is_the_sine_at_scaled_times(robot: Robot, scale: float):
    clip = wandering(robot, seconds=4.0)
    fine = wandering(robot, seconds=4.0, fps=5000.0)
    scaled = time_scale_clip(clip, scale, "scaled")
    index = np.rint(np.arange(scaled.frame_count) * scale / clip.fps * fine.fps).astype(int)
    inner = slice(3, -3)
    for field in ("root_pos_w", "root_quat_w", "joint_pos"):
        np.testing.assert_allclose(getattr(scaled, field)[inner], getattr(fine, field)[index][inner], atol=2e-5)
    assert scaled.fps == clip.fps
    assert abs((scaled.frame_count - 1) * scale - (clip.frame_count - 1)) < scale


@pytest.mark.parametrize("scale", [0.9, 1.1])
def test_a_joint_that_rests_at_its_limit_does_not_pass_it_at_another_speed(robot: Robot, scale: float):
    clip = standing(robot)
    joint, joint_pos = robot.joint("Left_Knee_Pitch"), clip.joint_pos.copy()
    joint_pos[:, joint] = np.maximum(robot.joint_lower[joint], 0.5 * np.sin(np.arange(clip.frame_count) / 5.0))
    clip = dataclasses.replace(clip, joint_pos=joint_pos)
    settings = dataclasses.replace(BOTH, time_scales=(scale,), unscaled_skills=())
    assert time_scale_clip(clip, scale, "spline").joint_pos[:, joint].min() < robot.joint_lower[joint] - 1e-4
    for piece in process(clip, {"skill": "walk"}, settings=settings, robot=robot).pieces:
        assert np.all(piece.clip.joint_pos >= robot.joint_lower)
        assert np.all(piece.clip.joint_pos <= robot.joint_upper)


def test_accelerations_scale_with_the_square_without_steps(robot: Robot):
    clip = wandering(robot, seconds=4.0)
    scaled = time_scale_clip(clip, 1.1, "scaled")

    def peak(some: RobotClip) -> np.ndarray:
        return np.abs(np.diff(some.joint_pos, n=2, axis=0)[5:-5]).max(axis=0) * some.fps**2

    moving = peak(clip) > 0.1
    np.testing.assert_allclose(peak(scaled)[moving] / peak(clip)[moving], 1.1**2, rtol=0.03)


def test_numbers_scale_as_their_units_say():
    said = {"forward_m_s": 1.0, "yaw_rate_rad_s": -0.5, "jerk_rad_s3": 10.0, "seconds": 4.0, "licence": "CC0-1.0"}
    assert time_scale_numbers(said, 2.0) == {
        "forward_m_s": 2.0,
        "yaw_rate_rad_s": -1.0,
        "jerk_rad_s3": 80.0,
        "seconds": 2.0,
        "licence": "CC0-1.0",
    }


def test_every_speed_that_earlier_stages_report_scales(root: Path, robot: Robot):
    retargeting = settings.read(root / "data" / "retarget.yaml", RetargetSettings)
    (piece,) = retarget(walker(seconds=2.0), {}, settings=retargeting, robot=robot).pieces
    reported = {
        **piece.numbers,
        "stance_slip_m_s": 0.1,
        "planted_m_s": 0.2,
        "off_skill_m_s": 0.3,
        "floor_slope_m_s": 0.01,
    }
    scaled = time_scale_numbers(reported, 2.0)
    speeds = {name for name in reported if name.endswith(("_m_s", "_rad_s"))}
    assert {"slip_m_s", "slip_strict_m_s", "pelvis_velocity_error_m_s", "yaw_rate_rad_s"} < speeds
    for name, value in reported.items():
        power = {"jerk_rad_s3": 3, "seconds": -1}.get(name, int(name in speeds))
        assert scaled[name] == (pytest.approx(value * 2.0**power) if isinstance(value, float) else value), name


def test_the_numbers_of_a_faster_clip_are_its_own_velocities(robot: Robot):
    clip = wandering(robot, seconds=4.02)  # 200 steps: the faster one ends where it does
    before, after = (velocity_of(each) for each in (clip, time_scale_clip(clip, 2.0, "fast")))
    assert time_scale_numbers(before, 2.0) == pytest.approx(after, abs=5e-3)


@pytest.mark.parametrize("scale", [0.5, 0.8, 1.25, 2.0])
def test_feet_touch_down_at_scaled_times(robot: Robot, scale: float):
    clip = wandering(robot, seconds=4.0)
    scaled = time_scale_clip(clip, scale, "scaled")
    times_s = np.arange(scaled.frame_count) / scaled.fps * scale  # of the original
    expected = np.stack([times_s % 1.0 < 0.5, times_s % 1.0 >= 0.4], axis=1)
    part = times_s % 1.0
    clear = np.min([np.abs(part - edge) for edge in (0.0, 0.4, 0.5, 1.0)], axis=0) > 1.0 / clip.fps
    assert clear.mean() > 0.7 and scaled.contacts is not None
    np.testing.assert_array_equal(scaled.contacts[clear], expected[clear])


@pytest.mark.parametrize("scale", [0.0, -1.0, 1.0, 2.5])
def test_a_time_scale_that_makes_no_variant_is_refused(root: Path, scale: float):
    path = root / "data" / "augment.yaml"
    values = {**settings.read_yaml(path), "time_scales": [scale]}
    with pytest.raises(SettingsError, match=r"'time_scales\[0\]' is .*(allowed is 0.5 to 2|the original)"):
        settings.parse(AugmentSettings, values, path)


def test_a_mirror_image_at_another_speed_has_the_bits_of_its_own_spline(robot: Robot):
    pieces = {piece.clip.name: piece.clip for piece in process(wandering(robot), {}, settings=BOTH, robot=robot).pieces}
    image = next(clip for name, clip in pieces.items() if name.endswith("~mirror"))
    for scale in BOTH.time_scales:
        own = time_scale_clip(image, scale, f"{image.name}~x{scale:g}")
        for field in ("root_pos_w", "root_quat_w", "joint_pos"):
            assert getattr(pieces[own.name], field).tobytes() == getattr(own, field).tobytes()


def test_longer_steps_are_faster_in_every_direction_at_the_same_turn():
    observed = {"forward_m_s": 1.0, "lateral_m_s": -0.4, "yaw_rate_rad_s": 0.5}
    found = perturbed_numbers(observed, "step_length", 1.2)
    assert {name: found[name] for name in observed} == pytest.approx(
        {"forward_m_s": 1.2, "lateral_m_s": -0.48, "yaw_rate_rad_s": 0.5}
    )
    lifted = perturbed_numbers(observed, "foot_lift", 0.03)
    assert {name: lifted[name] for name in observed} == observed
