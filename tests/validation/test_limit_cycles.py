"""Period, amplitude and shape of cycles whose figures are known."""

import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from pipeline.validation.limit_cycles import (
    PLANES,
    JointSeries,
    LimitCycle,
    NoCycleError,
    compare,
    limit_cycle,
    shape_distance,
)

RATE_HZ = 200.0


def series(hip, knee, hip_vel=None, knee_vel=None, rate_hz=RATE_HZ, name="walk"):
    return JointSeries(
        name=name,
        rate_hz=rate_hz,
        hip=hip,
        knee=knee,
        hip_vel=np.gradient(hip) * rate_hz if hip_vel is None else hip_vel,
        knee_vel=np.gradient(knee) * rate_hz if knee_vel is None else knee_vel,
    )


def sines(period_s, hip=0.4, knee=0.3, seconds=8.0, rate_hz=RATE_HZ, name="walk"):
    """Hip and knee as sines with analytic speeds, the knee 1.1 rad ahead, about a bent pose."""
    phase = 2.0 * math.pi * np.arange(round(seconds * rate_hz)) / rate_hz / period_s + 0.7
    omega = 2.0 * math.pi / period_s
    return series(
        hip * np.cos(phase) - 0.3,
        knee * np.cos(phase + 1.1) + 0.6,
        -hip * omega * np.sin(phase),
        -knee * omega * np.sin(phase + 1.1),
        rate_hz,
        name,
    )


def circle(radius, sense=1.0, centre=(0.0, 0.0)):
    phase = 2.0 * math.pi * np.arange(100) / 100
    return np.stack([radius * np.cos(phase), sense * radius * np.sin(phase)], axis=1) + centre


@pytest.mark.parametrize("period_s", [0.63, 0.7777, 1.2345])
def test_a_sine_has_its_period_and_twice_its_amplitude(period_s):
    found = limit_cycle(sines(period_s))
    assert found.period_s == pytest.approx(period_s, rel=1e-4)
    assert found.period_std_s < 1e-4
    assert found.hip_amplitude_rad == pytest.approx(0.8, rel=2e-3)
    assert found.knee_amplitude_rad == pytest.approx(0.6, rel=2e-3)
    assert found.spread_rad < 1e-3


@pytest.mark.parametrize("rate_hz", [50.0, 200.0, 500.0])
def test_figures_do_not_depend_on_the_rate(rate_hz):
    found = limit_cycle(sines(0.71, rate_hz=rate_hz))
    assert found.period_s == pytest.approx(0.71, rel=5e-4)
    assert found.hip_amplitude_rad == pytest.approx(0.8, rel=1e-2)


def test_a_stride_with_two_knee_bends_is_one_cycle():
    """The knee bends twice a stride; half a stride is not taken for a whole one."""
    phase = 2.0 * math.pi * np.arange(1600) / RATE_HZ / 0.9
    knee = 0.5 + 0.2 * np.cos(phase) + 0.3 * np.cos(2.0 * phase + 0.4)
    found = limit_cycle(series(0.25 * np.cos(phase), knee))
    assert found.period_s == pytest.approx(0.9, rel=1e-3)
    wanted = np.ptp(0.2 * np.cos(np.linspace(0, 2 * np.pi, 9999)) + 0.3 * np.cos(np.linspace(0, 4 * np.pi, 9999) + 0.4))
    assert found.knee_amplitude_rad == pytest.approx(wanted, rel=5e-3)


def test_spread_is_the_noise_of_both_angles():
    rng = np.random.default_rng(0)
    clean = sines(0.8, seconds=60.0)
    noise = 0.02
    noisy = series(clean.hip + noise * rng.normal(size=12000), clean.knee + noise * rng.normal(size=12000))
    found = limit_cycle(noisy)
    assert found.period_s == pytest.approx(0.8, rel=1e-3)
    # Between samples linear interpolation averages: 2/3 of the variance on average, hip and knee together twice that.
    assert found.spread_rad == pytest.approx(noise * math.sqrt(4.0 / 3.0), rel=0.1)


def test_van_der_pols_oscillator_has_its_published_cycle():
    """x'' - (1 - x^2) x' + x = 0: period 6.66329, amplitude 2.00862 either side; here eight times as fast."""

    def flow(_, state):
        return [8.0 * state[1], 8.0 * ((1.0 - state[0] ** 2) * state[1] - state[0])]

    times = np.arange(round(14.0 * RATE_HZ)) / RATE_HZ
    x, y = solve_ivp(flow, (0.0, times[-1]), [2.0, 0.0], t_eval=times, rtol=1e-9, atol=1e-9).y
    settled = slice(round(3.0 * RATE_HZ), None)
    found = limit_cycle(series(x[settled], y[settled]))
    assert found.period_s == pytest.approx(6.66329 / 8.0, rel=1e-4)
    assert found.hip_amplitude_rad == pytest.approx(2 * 2.00862, rel=3e-3)
    assert found.spread_rad < 5e-3


def test_what_stands_trembles_or_drifts_has_no_cycle():
    rng = np.random.default_rng(0)
    flat = np.zeros(1000)
    with pytest.raises(NoCycleError, match=r"stand: no limit cycle: its likeness to itself is 0.00 at best"):
        limit_cycle(series(flat, flat, name="stand"))
    with pytest.raises(NoCycleError, match=r"likeness"):
        limit_cycle(series(rng.normal(size=1000), rng.normal(size=1000)))
    with pytest.raises(NoCycleError, match=r"0.2 s are too short"):
        limit_cycle(sines(0.8, seconds=0.2))
    with pytest.raises(NoCycleError, match=r"1 whole cycles, expected at least 3"):
        limit_cycle(sines(0.8, seconds=3.2))
    broken = sines(0.8).hip.copy()
    broken[7] = np.nan
    with pytest.raises(NoCycleError, match=r"not finite"):
        limit_cycle(series(broken, sines(0.8).knee))


def test_circles_are_as_far_apart_as_their_radii():
    expected = 0.2 / math.sqrt((1.0 + 1.44) / 2.0)
    assert shape_distance(circle(1.0), circle(1.2)) == pytest.approx(expected, abs=1e-9)
    assert shape_distance(circle(1.2), circle(1.0)) == pytest.approx(expected, abs=1e-9)


def test_an_ellipse_is_away_from_its_circle_by_its_short_axis():
    phase = 2.0 * math.pi * np.arange(100) / 100
    ellipse = np.stack([np.cos(phase), 0.5 * np.sin(phase)], axis=1)
    expected = 0.5 * math.sqrt(0.5) / math.sqrt((1.0 + 0.625) / 2.0)
    assert shape_distance(circle(1.0), ellipse) == pytest.approx(expected, abs=1e-9)


def test_place_and_phase_do_not_count_and_the_sense_does():
    moved = np.roll(circle(1.0, centre=(3.0, -2.0)), 37, axis=0)
    assert shape_distance(circle(1.0), moved) == pytest.approx(0.0, abs=1e-6)
    assert shape_distance(circle(1.0), circle(1.0, sense=-1.0)) == pytest.approx(math.sqrt(2.0), abs=1e-9)


def test_the_shift_is_the_best_of_all():
    """Against trying every shift one by one."""
    rng = np.random.default_rng(5)
    one, two = rng.normal(size=(2, 100, 2)).cumsum(axis=1)
    a, b = one - one.mean(0), two - two.mean(0)
    tried = min(np.mean(np.sum((a - np.roll(b, shift, axis=0)) ** 2, axis=1)) for shift in range(100))
    size = (np.mean(np.sum(a**2, axis=1)) + np.mean(np.sum(b**2, axis=1))) / 2.0
    assert shape_distance(one, two) == pytest.approx(math.sqrt(tried / size), rel=1e-9)


def test_a_sine_against_its_speed_is_a_circle_at_any_cadence():
    slow, fast = (limit_cycle(sines(period_s)) for period_s in (1.1, 0.55))
    for plane in PLANES[1:]:
        radii = np.linalg.norm(slow.plane(plane) - slow.plane(plane).mean(axis=0), axis=1)
        assert np.ptp(radii) < 4e-3
    found = compare(slow, fast)
    assert found.period_ratio == pytest.approx(0.5, rel=1e-3)
    assert max(found.shape_distance.values()) < 0.01
    assert found.offset_rad < 1e-3


def test_a_comparison_tells_amplitude_period_and_place():
    reference = limit_cycle(sines(0.8, name="mujoco"))
    moved = sines(0.9, hip=0.5, knee=0.3, name="dart")
    other = limit_cycle(series(moved.hip + 0.03, moved.knee + 0.04, moved.hip_vel, moved.knee_vel, name="dart"))
    found = compare(reference, other)
    assert (found.name, found.reference) == ("dart", "mujoco")
    assert found.period_ratio == pytest.approx(0.9 / 0.8, rel=1e-3)
    assert found.hip_amplitude_ratio == pytest.approx(1.25, rel=1e-3)
    assert found.knee_amplitude_ratio == pytest.approx(1.0, rel=1e-3)
    assert found.offset_rad == pytest.approx(0.05, abs=1e-3)
    # In the plane hip-knee only the hip differs, by .1 cos: RMS .1 / sqrt(2).
    size = math.sqrt((0.4**2 + 0.3**2 + 0.5**2 + 0.3**2) / 4.0)
    assert found.shape_distance[PLANES[0]] == pytest.approx(0.1 / math.sqrt(2.0) / size, rel=1e-2)


def test_a_cycle_holds_against_itself():
    found = limit_cycle(sines(0.8))
    assert isinstance(found, LimitCycle)
    same = compare(found, found)
    assert max(same.shape_distance.values()) < 1e-6
    assert (same.period_ratio, same.offset_rad) == (1.0, 0.0)
