"""A user's own bench data: read to the same sweep however it is written, or refused with the reason."""

import dataclasses

import numpy as np
import pytest

from pipeline.actuators.read_measurement import read_measurement
from pipeline.errors import AmbiguousFileError, FileError
from tests.factories.sweeps import MOTOR, SETTINGS, points, written

SPEED, TORQUE = points()


def read(text: str):
    return read_measurement(text, "knee.csv", MOTOR, SETTINGS.reading)


def test_units_sides_separators_and_decimal_commas_give_the_same_sweep():
    rpm = SPEED * 60.0 / (2.0 * np.pi)
    motor = "# side: motor\n# gear_efficiency: 0.9"
    texts = [
        written(SPEED, TORQUE),
        written(rpm, TORQUE, speed_unit="rpm"),
        written(np.degrees(SPEED), TORQUE, speed_unit="deg/s"),
        written(18.0 * SPEED, TORQUE / 18.0 / 0.9, about=motor),
        written(SPEED, TORQUE, separator=";", decimal=","),
        written(SPEED, TORQUE, separator="\t"),
        "\ufeff" + written(SPEED, TORQUE).replace("\n", "\r\n"),
        written(-SPEED, -TORQUE, direction="negative"),
        written(SPEED, TORQUE, direction="negative"),
        written(SPEED[::-1], TORQUE[::-1]),
    ]
    for text in texts:
        found = read(text)
        np.testing.assert_allclose(found.speed, SPEED, atol=2e-5)
        np.testing.assert_allclose(found.torque, TORQUE, rtol=2e-5, atol=1e-4)


def test_braking_points_are_left_out_and_counted():
    speed, torque = np.append(SPEED, [-3.0, -5.0, -7.0]), np.append(TORQUE, [55.0, 56.0, 57.0])
    lines = written(speed, torque).splitlines()
    lines[-3:] = [line.replace("positive", "negative") for line in lines[-3:]]
    found = read("\n".join(lines))
    np.testing.assert_allclose(found.speed, SPEED, atol=1e-5)
    assert found.notes == ("3 braking points left out",)


def test_torque_noise_about_zero_is_no_braking():
    torque = np.append(TORQUE, -0.8)
    assert len(read(written(np.append(SPEED, SPEED[-1]), torque)).speed) == len(SPEED) + 1


@pytest.mark.parametrize(
    ("text", "match"),
    [
        (written(SPEED, TORQUE, about=""), "does not say on which side"),
        (written(SPEED, TORQUE, about="# side: motor"), "needs the gear's efficiency"),
        (written(18.0 * SPEED, TORQUE / 18.0), "Is it rpm, deg/s or the motor's side"),
        (written(SPEED * 60.0 / (2.0 * np.pi), TORQUE), "Is it rpm"),
        (written(SPEED, TORQUE * 1000.0), "would give .* N m"),
        (written(TORQUE / 4.0, SPEED * 4.0), "seem to be swapped"),
        (written(SPEED, -TORQUE), "torque against the motion"),
        (written(-SPEED, -TORQUE), "negative speeds"),
        (written(SPEED - 5.0, TORQUE), "speeds of both signs"),
        (written(SPEED, TORQUE, direction="up"), "direction is 'up'"),
        (written(SPEED, TORQUE, decimal=","), "Decimal commas need another separator"),
        (written(SPEED, TORQUE).replace("speed [rad/s]", "speed"), "'speed' has no unit"),
        (written(SPEED, TORQUE, speed_unit="km/h"), "has the unit 'km/h'"),
        (written(SPEED, TORQUE).replace("voltage [V]", "volts [V]"), "unknown column"),
        (written(SPEED, TORQUE).replace("knee,", "hip,"), "of motor 'hip'"),
        (written(SPEED, np.where(SPEED > 5.0, np.nan, TORQUE)), "line 16: torque is 'nan'"),
        (written(SPEED, np.where(SPEED > 5.0, np.inf, TORQUE)), "torque is 'inf'"),
        (written(SPEED, TORQUE).replace("48.000000", "60.000000", 20), "these are several curves"),
        (written(SPEED, TORQUE).replace("30.000000", "90.000000", 20), "torque derates"),
        ("# side: joint\n", "has no rows"),
        (
            written(SPEED, TORQUE).encode("utf-16").decode("utf-8", "replace"),
            "line 1: the line is no UTF-8 .* Save it as",
        ),
        (written(SPEED, TORQUE).replace("degC", "\ufffdC"), "the line is no UTF-8 text. Save it as UTF-8"),
    ],
)
def test_what_is_wrong_or_open_is_refused_with_the_reason(text: str, match: str):
    with pytest.raises(FileError, match=match):
        read(text)


def test_a_comma_that_may_separate_thousands_must_be_explained():
    lines = ["# side: joint", "motor;direction;speed [rpm];torque [N m];voltage [V];temperature [degC]"]
    lines += [f"knee;positive;{step},{500:03d};60;48;30" for step in range(1, 12)]
    with pytest.raises(AmbiguousFileError, match="may separate thousands or decimals"):
        read("\n".join(lines))
    stated = read("\n".join(["# decimal: comma", *lines]))
    assert stated.speed[0] == pytest.approx(1.5 * np.pi / 30.0)


def test_numbers_with_comma_and_point_are_refused():
    text = written(SPEED, TORQUE, separator=";").replace("48.000000", "48,0", 1)
    with pytest.raises(AmbiguousFileError, match=r"with a comma .* and with a point"):
        read(text)


def test_the_gear_of_the_table_is_the_one_used():
    about = "# side: motor\n# gear_efficiency: 1"
    slow = dataclasses.replace(MOTOR, gear_ratio=36.0)
    found = read_measurement(written(36.0 * SPEED, TORQUE / 36.0, about=about), "knee.csv", slow, SETTINGS.reading)
    np.testing.assert_allclose(found.torque, TORQUE, rtol=1e-4, atol=1e-3)
