"""Knees of planted curves: found, inside their intervals, and none where the sweep ends before the fall."""

import numpy as np
import pytest

from pipeline.actuators.calibrate import calibrate
from pipeline.actuators.knee_fit import fit_knee
from pipeline.actuators.synthesize import Curve, Sweep, sample
from tests.factories.sweeps import CASES, CURVE, MOTOR, SETTINGS, points, written

DRAWS = 80
OUTLIER = SETTINGS.knee.outlier


@pytest.mark.parametrize("case", CASES)
def test_planted_knees_are_found_and_lie_in_their_intervals(case: str):
    sag, sweep = CASES[case]
    rng = np.random.default_rng([7, *case.encode()])
    errors, inside = [], []
    for _ in range(DRAWS):
        curve = Curve(knee_speed=rng.uniform(5.0, 20.0), knee_torque=rng.uniform(5.0, 60.0), sag=sag)
        fit = fit_knee(*sample(curve, sweep, rng), OUTLIER)
        truth = np.array([curve.knee_speed, curve.knee_torque])
        errors.append(np.abs(np.array([fit.knee_speed.value, fit.knee_torque.value]) / truth - 1.0))
        inside.append([curve.knee_speed in fit.knee_speed, curve.knee_torque in fit.knee_torque])
    assert np.all(np.median(errors, axis=0) <= 0.012)  # 80 draws; the benchmark holds 1 % over 1,000
    assert np.all(np.quantile(errors, 0.9, axis=0) <= 0.03)
    assert np.mean(inside) >= 0.9


def test_a_curve_without_noise_is_found_to_all_digits():
    fit = fit_knee(*points(Sweep(noise=0.0), Curve(knee_speed=16.76, knee_torque=45.0, sag=0.05)), OUTLIER)
    assert fit.knee_speed.value == pytest.approx(16.76, rel=1e-6)
    assert fit.knee_torque.value == pytest.approx(45.0, rel=1e-6)
    assert fit.no_load_speed == pytest.approx(1.25 * 16.76, rel=1e-6)
    assert fit.stall_torque == pytest.approx(1.05 * 45.0, rel=1e-6)
    assert 16.76 in fit.knee_speed and 45.0 in fit.knee_torque


def test_scaling_speed_and_torque_scales_the_fit():
    speed, torque = points()
    one, other = fit_knee(speed, torque, OUTLIER), fit_knee(30.0 * speed, 0.1 * torque, OUTLIER)
    for name, factor in (("knee_speed", 30.0), ("knee_torque", 0.1)):
        for part in ("value", "low", "high"):
            assert getattr(getattr(other, name), part) == pytest.approx(factor * getattr(getattr(one, name), part))


def test_order_of_points_does_not_matter():
    speed, torque = points(Sweep(outliers=0.1))
    order = np.random.default_rng(1).permutation(len(speed))
    one, other = fit_knee(speed, torque, OUTLIER), fit_knee(speed[order], torque[order], OUTLIER)
    assert one.knee_speed.value == pytest.approx(other.knee_speed.value, rel=1e-9)
    np.testing.assert_array_equal(one.outlier[order], other.outlier)


def test_planted_outliers_are_the_ones_left_out():
    speed, torque = points()
    torque[[4, 17, 37]] += [-20.0, 15.0, 18.0]
    assert np.flatnonzero(fit_knee(speed, torque, OUTLIER).outlier).tolist() == [4, 17, 37]


@pytest.mark.parametrize(("end", "noise"), [(1.0, 0.02), (0.8, 0.02), (1.0, 0.05), (0.6, 0.05), (1.03, 0.02)])
def test_a_sweep_that_ends_before_the_fall_is_refused(end: float, noise: float):
    refused = 0
    for seed in range(20):
        speed, torque = points(Sweep(noise=noise, end=end), seed=seed)
        found = calibrate(written(speed, torque), "knee.csv", MOTOR, SETTINGS)
        refused += any("no knee" in reason for reason in found.reasons)
    assert refused >= 19


@pytest.mark.parametrize("case", CASES)
def test_true_knees_are_not_refused(case: str):
    sag, sweep = CASES[case]
    curve = Curve(knee_speed=CURVE.knee_speed, knee_torque=CURVE.knee_torque, sag=sag)
    verdicts = [
        calibrate(written(*points(sweep, curve, seed)), "knee.csv", MOTOR, SETTINGS).verdict for seed in range(20)
    ]
    assert sum(verdict != "calibrated" for verdict in verdicts) <= 1, verdicts


def test_a_torque_that_ends_right_behind_the_knee_has_no_dc_motor_form():
    speed = np.concatenate([np.linspace(0.0, 12.0, 30), np.linspace(12.005, 12.2, 12)])
    torque = Curve(knee_speed=12.0, knee_torque=60.0, no_load_ratio=1.0167).torque(speed)
    found = calibrate(written(speed, torque), "knee.csv", MOTOR, SETTINGS)
    assert any("no finite saturation torque" in reason for reason in found.reasons)


def test_directions_that_disagree_are_refused_and_named():
    forward = written(*points())
    speed, torque = points(curve=Curve(knee_speed=12.57, knee_torque=50.0))
    backward = written(-speed, -torque, direction="negative").split("\n", 2)[2]
    found = calibrate(forward + backward, "knee.csv", MOTOR, SETTINGS)
    assert any("in the negative direction" in reason for reason in found.reasons)


@pytest.mark.parametrize("torque", [np.full(40, 30.0), np.linspace(60.0, 0.0, 40), np.linspace(10.0, 60.0, 40)])
def test_constant_straight_and_rising_curves_have_no_knee(torque: np.ndarray):
    assert not calibrate(written(np.linspace(0.0, 15.0, 40), torque), "knee.csv", MOTOR, SETTINGS).accepted


@pytest.mark.parametrize("points_on", [0, 1, 12])
def test_a_torque_column_of_zeros_is_refused(points_on: int):
    """A current sensor that is not connected, or answers now and then."""
    speed = np.linspace(0.0, 20.0, 100)
    torque = np.where(np.arange(100) % 8 == 1, 60.0, 0.0) * (np.arange(100) < 8 * points_on)
    found = calibrate(written(speed, torque), "knee.csv", MOTOR, SETTINGS)
    assert found.verdict == "refused: the torque at the knee would be 0.00 N m"


def test_few_points_are_refused():
    speed, torque = points()
    found = calibrate(written(speed[[3, 30]], torque[[3, 30]]), "knee.csv", MOTOR, SETTINGS)
    assert found.verdict == "refused: 2 points at 2 speeds; 8 are required"


@pytest.mark.parametrize("seed", range(5))
def test_points_beyond_the_no_load_speed_do_not_draw_the_fall_out(seed: int):
    speed = np.linspace(0.0, 1.15 * CURVE.no_load_speed, 46)
    noise = 0.02 * CURVE.knee_torque * np.random.default_rng(seed).standard_normal(46)
    text = written(speed, np.maximum(CURVE.torque(speed), 0.0) + noise)
    found = calibrate(text, "knee.csv", MOTOR, SETTINGS)
    assert found.knee.speed.value == pytest.approx(CURVE.knee_speed, rel=0.015)
    assert found.knee.no_load_speed == pytest.approx(CURVE.no_load_speed, rel=0.02)
    assert found.notes[-1].endswith("points beyond the no-load speed left out")
