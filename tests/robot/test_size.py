"""Figures of settings carried over to a robot of another size."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import numpy as np
import pytest

from pipeline.failures.settings import FailureSettings
from pipeline.feasibility import FeasibilitySettings
from pipeline.files import settings
from pipeline.retarget import RetargetSettings
from pipeline.robot import Robot
from pipeline.robot.size import scaled, size_of
from pipeline.simulation.run import fall_height
from pipeline.tracking.settings import TrackingSettings

FILES = {
    "feasibility.yaml": FeasibilitySettings,
    "tracking.yaml": TrackingSettings,
    "failures.yaml": FailureSettings,
    "retarget.yaml": RetargetSettings,
}


@pytest.fixture
def smaller(t1: Robot) -> Robot:
    """The robot at 0.64 of its size in every length, with half its mass."""
    tree = dataclasses.replace(t1.tree, pos=0.64 * t1.tree.pos, site_pos=0.64 * t1.tree.site_pos)
    height = 0.64 * t1.default_root_height
    return dataclasses.replace(t1, tree=tree, total_mass=0.5 * t1.total_mass, default_root_height=height)


@pytest.mark.parametrize("file", FILES)
def test_values_for_the_robot_of_the_file_are_those_of_the_file(t1: Robot, root: Path, file: str):
    found = settings.read(root / "data" / file, FILES[file])
    assert scaled(found, t1) is found


def test_the_fall_height_of_the_t1_is_its_published_one(t1: Robot):
    assert fall_height(t1) == 0.45


def test_lengths_speeds_and_jerks_scale_with_the_legs(smaller: Robot, root: Path):
    whole = settings.read(root / "data/feasibility.yaml", FeasibilitySettings)
    found = scaled(whole, smaller)
    assert found.feet.floating == pytest.approx(0.64 * whole.feet.floating, rel=1e-3)
    assert found.tracking.root_height == pytest.approx(0.64 * whole.tracking.root_height, rel=1e-3)
    assert found.feet.slip_mean[0] == pytest.approx(0.8 * whole.feet.slip_mean[0], rel=1e-3)
    assert found.feet.slip_mean[1] == whole.feet.slip_mean[1]
    assert found.root.jerk == pytest.approx(whole.root.jerk / 0.8, rel=1e-3)
    assert found.root.acceleration == whole.root.acceleration
    assert found.root.height == whole.root.height
    assert (found.likeness, found.contact, found.collision, found.joints) == (
        whole.likeness,
        whole.contact,
        whole.collision,
        whole.joints,
    )


def test_impulses_and_torques_scale_with_the_mass_too(smaller: Robot, root: Path):
    tracking = settings.read(root / "data/tracking.yaml", TrackingSettings)
    low, high = scaled(tracking, smaller).disturbance.push_impulse
    assert low == 0.0
    assert high == pytest.approx(0.5 * 0.8 * tracking.disturbance.push_impulse[1], rel=1e-3)
    failures = settings.read(root / "data/failures.yaml", FailureSettings)
    found = scaled(failures, smaller)
    assert found.authority.least_torque == pytest.approx(0.5 * 0.64 * failures.authority.least_torque, rel=1e-3)
    assert found.fall.tilt_deg == failures.fall.tilt_deg
    assert fall_height(smaller) == pytest.approx(0.64 * 0.45)


def test_settings_are_scaled_once(smaller: Robot, root: Path):
    found = scaled(settings.read(root / "data/feasibility.yaml", FeasibilitySettings), smaller)
    assert found.calibrated_on == size_of(smaller)
    assert scaled(found, smaller) is found


def test_the_leg_is_hip_to_knee_to_ankle_to_sole(t1: Robot):
    """From the origins in links.csv and the sole's height in sites.csv."""
    thigh = np.hypot(0.081854 + 0.134, 0.014)
    shank = np.hypot(0.28 + 0.012, 0.00025)
    assert t1.leg_length == pytest.approx(thigh + shank + 0.0432508, abs=5e-5)


def test_weights_of_distances_count_a_share_of_the_leg_alike(smaller: Robot, root: Path):
    whole = settings.read(root / "data/retarget.yaml", RetargetSettings)
    found = scaled(whole, smaller)
    error = 0.01
    cost = whole.weights.stance_position * error**2
    assert found.weights.stance_position * (0.64 * error) ** 2 == pytest.approx(cost, rel=1e-3)
    assert found.weights.legs == whole.weights.legs
    assert found.feet.spacing == pytest.approx(0.64 * whole.feet.spacing, rel=1e-3)
