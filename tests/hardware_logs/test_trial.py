"""A trial goes to Parquet and back."""

import dataclasses

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from pipeline.errors import FileError
from pipeline.hardware_logs import Gap, OperatorEvent, Trial, read_trial
from pipeline.hardware_logs.missed_bars import MissedBar
from pipeline.hardware_logs.trial import ARRAYS, TrialWriter
from tests.factories.log_trials import head_of, write_trial


def a_trial(count: int = 5, joints: int = 2) -> Trial:
    def table(first: float, columns: int) -> np.ndarray:
        return (first + np.arange(count * columns, dtype=np.float32).reshape(count, columns)).astype(np.float32)

    return Trial(
        name="day1/walk",
        robot="t1",
        joint_names=("a", "b"),
        policy_digest=None,
        command_source="unknown",
        simulated=False,
        integrity="recovered",
        rate_hz=500.0,
        start_ns=7,
        log_digest="00",
        notes=("one sentence.",),
        events=(OperatorEvent(time_s=0.004, kind="stop", source="remote"),),
        gaps=(Gap(start_s=0.002, stop_s=0.006, reason="no messages"),),
        time_s=np.arange(count) / 500.0,
        lost=np.arange(count * joints).reshape(count, joints),
        fall_state=np.arange(count),
        **{
            name: table(10.0 * number, joints)
            for number, name in enumerate(
                ("joint_pos", "joint_vel", "torque_est", "temperature_c", "target_pos", "target_torque", "kp", "kd")
            )
        },
        **{
            name: table(100.0 * number, 3)
            for number, name in enumerate(("rpy", "gyro_b", "acc_b", "odometer", "command"))
        },
    )


def assert_same(one: Trial, other: Trial) -> None:
    assert head_of(one) == head_of(other)
    for name in ARRAYS:
        np.testing.assert_array_equal(getattr(one, name), getattr(other, name), err_msg=name)


def test_a_trial_comes_back_as_it_was(tmp_path):
    trial = a_trial()
    write_trial(tmp_path / "trial", trial)
    assert_same(read_trial(tmp_path / "trial"), trial)


def test_missed_bars_come_back_and_others_have_no_word_of_them(tmp_path):
    missed = MissedBar(cell="vx +0.6", figure="slip", got=0.2, asked=0.1, from_s=4.0, until_s=10.0)
    trial = dataclasses.replace(a_trial(), simulated=True, missed=(missed,))
    write_trial(tmp_path / "trial", trial)
    assert_same(read_trial(tmp_path / "trial"), trial)
    assert "missed" in head_of(trial) and "missed" not in head_of(a_trial())


def test_the_same_trial_gives_the_same_bytes(tmp_path):
    for name in ("one", "two"):
        write_trial(tmp_path / name, a_trial())
    assert (tmp_path / "one").read_bytes() == (tmp_path / "two").read_bytes()


def test_pieces_make_the_same_trial(tmp_path):
    trial = a_trial()
    with TrialWriter(tmp_path / "trial") as writer:
        for rows in (slice(0, 2), slice(2, 5)):
            writer.add({name: getattr(trial, name)[rows] for name in ARRAYS})
        writer.finish(head_of(trial))
    assert_same(read_trial(tmp_path / "trial"), trial)


def test_what_is_not_finished_leaves_nothing(tmp_path):
    with TrialWriter(tmp_path / "trial") as writer:
        writer.add({name: getattr(a_trial(), name) for name in ARRAYS})
    assert list(tmp_path.iterdir()) == []


def test_what_is_no_trial_is_refused(tmp_path):
    (tmp_path / "trial").write_bytes(b"PAR1")
    with pytest.raises(FileError, match="not a trial"):
        read_trial(tmp_path / "trial")


def test_gravity_and_gaps_are_where_they_should_be():
    trial = a_trial()
    np.testing.assert_allclose(np.linalg.norm(trial.gravity_b, axis=1), 1.0, rtol=1e-6)
    np.testing.assert_array_equal(trial.measured, [True, True, False, True, True])


def test_gravity_is_that_of_the_rotation_matrix():
    """R = Rz(yaw) Ry(pitch) Rx(roll), by scipy: gravity in the trunk's frame is minus R's third row."""
    rpy = np.random.default_rng(0).uniform(-1.4, 1.4, (5, 3)).astype(np.float32)
    matrix = Rotation.from_euler("ZYX", rpy[:, ::-1]).as_matrix()
    trial = dataclasses.replace(a_trial(), rpy=rpy)
    np.testing.assert_allclose(trial.gravity_b, -matrix[:, 2], atol=1e-6)
