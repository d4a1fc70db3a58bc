"""What no robot can say is counted, left out or refused."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from pipeline.files import settings
from pipeline.hardware_logs import LogSettings
from pipeline.hardware_logs.columns import low_state_columns
from pipeline.hardware_logs.log_report import layouts
from pipeline.hardware_logs.plausible import Plausible, _Turns, upward
from pipeline.hardware_logs.write import low_states as payloads
from pipeline.robot import load_robot
from tests.factories.robot_logs import every, low_states


@pytest.fixture
def look(root, robot):
    """A look at a second of a swaying robot after it was changed."""

    def look(change=lambda columns: None) -> Plausible:
        values = settings.read(root / "data/hardware_logs.yaml", LogSettings).plausible
        columns = low_state_columns(payloads(low_states(robot, every(1.0, 500))))
        change(columns)
        plausible = Plausible(values, robot)
        kept = plausible.finite(columns)
        plausible.in_range({name: each[kept] for name, each in columns.items()})
        return plausible

    return look


def still(columns: dict[str, np.ndarray]) -> None:
    columns["gyro_b"][:], columns["joint_vel"][:], columns["rpy"][:] = 0.0, 0.0, 0.0


def test_a_sound_robot_is_plausible(look):
    found = look()
    assert found.refusal() == ""
    assert found.remarks() == []


@pytest.mark.parametrize("name", ["joint_pos", "joint_vel", "torque_est", "rpy", "gyro_b", "acc_b"])
@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf])
def test_numbers_that_are_not_finite_are_found_in_every_column(look, name, value):
    def change(columns):
        columns[name][[3, 5], -1] = value

    found = look(change)
    assert found.not_finite == 2
    assert found.refusal() == ""


@pytest.mark.parametrize(("name", "value"), [("joint_pos", 4.0), ("joint_vel", 60.0), ("acc_b", 250.0)])
def test_out_of_range_is_counted_and_too_much_of_it_refused(look, name, value):
    def some(columns):
        columns[name][:10, 1] = value

    def most(columns):
        columns[name][:200, 1] = value

    assert look(some).out_of_range == 10
    assert look(some).refusal() == ""
    assert "beyond what 't1' can do" in look(most).refusal()


def test_gravity_in_other_units_is_refused(look):
    def in_g(columns):
        still(columns)
        columns["acc_b"] /= 9.81

    assert "at rest the specific force is 1.00 m/s^2" in look(in_g).refusal()


def test_an_accelerometer_that_contradicts_the_attitude_is_told(look):
    def tilted(columns):
        still(columns)
        columns["rpy"][:, 1] = np.radians(45.0)

    assert "45 degrees off the attitude" in " ".join(look(tilted).remarks())


def test_a_moment_at_rest_is_no_evidence_against_the_attitude(look):
    def tilted(columns):
        columns["gyro_b"][:], columns["joint_vel"][:] = 1.0, 1.0
        columns["gyro_b"][:10], columns["joint_vel"][:10] = 0.0, 0.0
        columns["rpy"][:10, 1] = np.radians(45.0)

    found = look(tilted)
    assert found.rest == 10 and found.remarks() == []


def test_upright_at_rest_needs_no_remark(look):
    assert look(still).remarks() == []


def test_a_count_of_lost_packets_that_falls_is_told(look):
    def restarted(columns):
        columns["lost"][250:] = 0

    assert "fell 1 times" in " ".join(look(restarted).remarks())


def test_robots_are_told_by_their_number_of_joints(robot):
    found = layouts([robot, load_robot("k1")])
    assert {count: each.name for count, (each,) in found.items()} == {22: "k1", 23: "t1"}
    assert "Waist" not in found[22][0].joint_names


def test_upward_of_roll_pitch_and_yaw_is_the_vertical_turned_into_the_body():
    rpy = np.random.default_rng(0).uniform(-1.5, 1.5, (50, 3))
    turn = Rotation.from_euler("xyz", rpy)  # about the world's axes: roll, then pitch, then yaw
    np.testing.assert_allclose(upward(rpy), turn.inv().apply([0.0, 0.0, 1.0]), atol=1e-12)


@pytest.mark.parametrize("pieces", [1, 7])
def test_a_gyroscope_turns_as_far_as_the_attitude_that_it_is_the_rate_of(pieces):
    """A steady roll and pitch, in one piece or in several of unequal length."""
    time_s = np.arange(1000) / 500.0
    rpy, gyro = np.outer(time_s, [0.4, -0.3, 0.0]), np.tile([0.4, -0.3, 0.0], (1000, 1))
    turns = _Turns()
    for part in np.split(np.arange(1000), [37, 90, 300, 301, 555, 900] if pieces > 1 else []):
        turns.add((time_s[part] * 1e9).astype(np.int64), rpy[part], gyro[part])
    assert turns.ratio() == pytest.approx(1.0, abs=0.01)
    assert turns.gyro == pytest.approx(0.7 * 0.1 * turns.windows, rel=0.03)
