"""Labels of stance for clips that bring none."""

import dataclasses
from pathlib import Path

import numpy as np
import pytest

from pipeline import rotation
from pipeline.clips.human_clip import body as human_body
from pipeline.errors import ClipError
from pipeline.files import settings as settings_file
from pipeline.retarget import robot_body, targets
from pipeline.retarget.foot_plan import contacts_of, without_short_runs
from pipeline.retarget.settings import RetargetSettings
from tests.factories.human_clips import HIP_HALF, SHANK, THIGH, walker
from tests.factories.retarget_clips import scaled


@pytest.fixture
def settings(root: Path) -> RetargetSettings:
    return settings_file.read(root / "data/retarget.yaml", RetargetSettings)


def test_a_clips_own_contacts_are_held_and_what_is_low_and_slow_beside_them(settings):
    clip = walker(seconds=5.0)
    fewer = clip.contacts.copy()
    fewer[::7] = False
    held = contacts_of(dataclasses.replace(clip, contacts=fewer), settings.stance)
    assert held[fewer].all()
    assert held[clip.contacts & ~fewer].mean() > 0.6


def test_labels_of_a_walker_agree_with_its_true_contacts(settings):
    clip = walker(seconds=5.0)
    labels = contacts_of(dataclasses.replace(clip, contacts=None), settings.stance)
    assert np.mean(labels == clip.contacts) > 0.85


def test_short_gaps_are_closed_before_short_runs_are_dropped():
    label = np.array([1, 1, 1, 1, 0, 1, 1, 1, 0, 0, 0, 1, 0, 0, 0], dtype=bool)
    expected = np.array([1, 1, 1, 1, 1, 1, 1, 1, 0, 0, 0, 0, 0, 0, 0], dtype=bool)
    np.testing.assert_array_equal(without_short_runs(label, 2, 2), expected)


def test_gaps_too_short_for_a_swing_are_closed_and_the_clips_ends_stay():
    label = np.array([0, 0, 1, 1, 1, 0, 0, 0, 1, 1, 0, 0, 0, 0, 1, 0], dtype=bool)
    expected = np.array([0, 0, 1, 1, 1, 1, 1, 1, 1, 1, 0, 0, 0, 0, 0, 0], dtype=bool)
    np.testing.assert_array_equal(without_short_runs(label, 2, 4), expected)


def test_proportions_are_those_the_walker_was_built_with():
    clip = walker(seconds=3.0)
    measured = targets.measure(clip, clip.contacts)
    assert measured.leg == pytest.approx(THIGH + SHANK, abs=0.01)
    assert measured.hip_half_width == pytest.approx(HIP_HALF, abs=1e-6)
    np.testing.assert_allclose(measured.ankle_height, 0.08, atol=0.005)


def test_legs_that_no_person_has_are_refused():
    clip = scaled(walker(seconds=2.0), 100.0)
    with pytest.raises(ClipError, match=r"the legs are 89 m long"):
        targets.measure(clip, clip.contacts)


@pytest.mark.parametrize("hip_centre_b", [(0.0, 0.0, -0.1), (0.05, 0.02, -0.03)])
def test_the_hips_of_a_pelvis_that_leans_and_turns_are_where_they_are_planned(settings, robot, hip_centre_b):
    """Whatever the way from the pelvis link's origin to the hips: it leans with the trunk and turns with the waist."""
    clip = walker(seconds=2.0)
    chest = human_body("chest")
    lean = rotation.from_rotvec(np.array([0.1, 0.3, 0.5]))
    quat = clip.body_quat_w.copy()
    quat[:, chest] = rotation.multiply(quat[:, chest], lean)
    turned = dataclasses.replace(clip, body_quat_w=quat)
    body = robot_body.measure(robot)
    own, other = (
        targets.plan_targets(turned, clip.contacts, dataclasses.replace(body, hip_centre_b=np.array(way)), settings)
        for way in ((0.0, 0.0, 0.0), hip_centre_b)
    )
    assert np.abs(other.waist_pos).min() > 0.2
    pelvis_quat_w = rotation.multiply(other.trunk_quat_w, rotation.about_z(other.waist_pos))
    hips_w = other.pelvis_pos_w + rotation.rotate(pelvis_quat_w, np.array(hip_centre_b))
    np.testing.assert_allclose(hips_w, own.pelvis_pos_w, atol=1e-9)
