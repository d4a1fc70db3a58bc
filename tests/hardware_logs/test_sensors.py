"""Sensors that did not measure, or in another unit, are named in the notes of a log."""

import dataclasses

import numpy as np
import pytest

from pipeline.files import settings
from pipeline.hardware_logs import LogSettings, ingest, layouts, write_mcap
from tests.factories.robot_logs import robot_log

WORDS = ("frozen", "in g", "in degrees", "wrong sign")


@pytest.fixture
def notes(root, robot, tmp_path):
    """What is noted of a log of the standing, swaying robot, changed by a function of its arrays."""

    def notes(change, seconds: float = 4.0) -> list[str]:
        log = robot_log(robot, seconds)
        states = log.low_state
        noise = np.random.default_rng(0).normal(0.0, 1e-3, states.gyro_b.shape)
        turned = np.gradient(states.rpy, states.time_ns * 1e-9, axis=0)
        arrays = {
            "rpy": states.rpy,
            "gyro_b": turned + noise,
            "acc_b": states.acc_b + noise,
            "joint_pos": states.joint_pos,
            "joint_vel": states.joint_vel,
        }
        time_s = (states.time_ns - states.time_ns[0]) * 1e-9
        states = dataclasses.replace(states, **change({name: each.copy() for name, each in arrays.items()}, time_s))
        path = tmp_path / "log.mcap"
        write_mcap(path, dataclasses.replace(log, low_state=states))
        values = settings.read(root / "data/hardware_logs.yaml", LogSettings)
        made = ingest(path, "log", tmp_path / "out", layouts=layouts([robot]), settings=values)
        return [note for note in made.notes if any(word in note for word in WORDS)]

    return notes


def frozen(names, columns, start_s: float, stop_s: float):
    def change(arrays, time_s):
        inside = (time_s >= start_s) & (time_s < stop_s)
        for name in names:
            arrays[name][np.ix_(inside, columns(arrays[name]))] = arrays[name][inside][0][columns(arrays[name])]
        return arrays

    return change


def every(values) -> list[int]:
    return list(range(values.shape[1]))


def scaled(name: str, factor: float):
    def change(arrays, _):
        arrays[name] = arrays[name] * factor
        return arrays

    return change


def moving(change):
    """The same of a robot that is never at rest, so that no bar of gravity at rest refuses it."""

    def moved(arrays, time_s):
        arrays["joint_vel"] = arrays["joint_vel"] + 0.5
        return change(arrays, time_s)

    return moved


def test_a_sound_log_has_no_such_note(notes):
    assert notes(lambda arrays, _: arrays) == []


@pytest.mark.parametrize(
    ("change", "says"),
    [
        (
            frozen(("rpy", "gyro_b", "acc_b"), every, 1.0, 3.5),
            "the IMU is frozen: none of its values changed for 2.5",
        ),
        (
            frozen(("gyro_b",), every, 1.0, 3.5),
            "the IMU is frozen in part: the gyroscope did not change for up to 2.5 s.",
        ),
        (
            frozen(("rpy", "acc_b"), every, 1.0, 3.5),
            "the attitude and the accelerometer did not change for up to 2.5 s.",
        ),
        (frozen(("joint_pos", "joint_vel"), every, 1.0, 3.5), "all joints did not change for up to 2.5 s."),
        (frozen(("joint_pos", "joint_vel"), lambda _: [3], 0.0, 4.0), "did not change for up to 4.0 s."),
        (moving(scaled("acc_b", 1.0 / 9.81)), "the acceleration is in g: its mean length is 1.0"),
        (scaled("acc_b", -1.0), "the acceleration has the wrong sign"),
        (scaled("rpy", 180.0 / np.pi), "the attitude is in degrees: it turns"),
    ],
    ids=["IMU", "gyroscope", "attitude and accelerometer", "joints", "one joint", "g", "sign", "degrees"],
)
def test_a_fault_of_the_sensors_is_named(notes, change, says):
    (found,) = notes(change)
    assert says in found


@pytest.mark.parametrize("length_s", [0.5, 1.9])
def test_what_is_still_for_a_shorter_time_is_not(notes, length_s):
    assert notes(frozen(("rpy", "gyro_b", "acc_b"), every, 1.0, 1.0 + length_s)) == []
