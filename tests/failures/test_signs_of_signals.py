"""What is read off a log against kinematics: heading, damping, the size of a push, each axis' bound."""

import dataclasses

import numpy as np
import pytest

from pipeline.failures.falls import push_before
from pipeline.failures.motors import asked_torque
from pipeline.failures.signals import _heading
from pipeline.failures.tracking import tracking_divergences
from tests.factories.log_trials import FAILURES


def test_velocities_are_turned_back_into_the_heading():
    yaw = np.linspace(-3.0, 3.0, 50)
    forward, left = 0.7, -0.2
    ahead, across = np.stack([np.cos(yaw), np.sin(yaw)], axis=1), np.stack([-np.sin(yaw), np.cos(yaw)], axis=1)
    np.testing.assert_allclose(_heading(forward * ahead + left * across, yaw), np.tile([forward, left], (50, 1)))


def test_damping_opposes_the_motion(signals):
    trial = signals.trial
    moving = dataclasses.replace(trial, target_pos=trial.joint_pos, joint_vel=np.ones_like(trial.joint_vel))
    asked = asked_torque(dataclasses.replace(signals, trial=moving))
    known = np.isfinite(asked)
    assert known.any() and (asked[known] < 0.0).all()


def test_a_push_is_the_change_of_velocity(signals):
    """20 m/s² for 0.1 s are 2 m/s."""
    pulse = np.where((signals.time_s > 2.0) & (signals.time_s < 2.1), 20.0, 0.0)
    pushed = dataclasses.replace(signals, acceleration_w=np.stack([pulse, 0.0 * pulse], axis=1))
    found = push_before(pushed, signals.at(2.1), signals.at(2.4), FAILURES.fall)
    assert found == pytest.approx(2.0, rel=0.15)


@pytest.mark.parametrize("axis", ["forward", "lateral", "yaw"])
def test_each_axis_has_its_own_bound(signals, axis):
    bound, _ = getattr(FAILURES.tracking, axis)
    for share, count in ((0.95, 0), (1.05, 1)):
        off = np.zeros(3)
        off[["forward", "lateral", "yaw"].index(axis)] = share * bound
        samples = len(signals.time_s)
        drifting = dataclasses.replace(
            signals,
            command=np.zeros((samples, 3)),
            velocity=np.tile(off[:2], (samples, 1)),
            yaw_rate=np.full(samples, off[2]),
        )
        assert len(tracking_divergences(drifting, FAILURES.tracking, 99.0)) == count
