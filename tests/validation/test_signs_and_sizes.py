"""Cells and figures of a validation against what their names and the geometry say."""

import dataclasses
from types import SimpleNamespace
from unittest.mock import Mock

import numpy as np
import pytest

from pipeline import rotation
from pipeline.robot import Kinematics, Robot
from pipeline.simulation import terrain
from pipeline.simulation.plant import Kick, PlantState, Push, Throw
from pipeline.validation.bars import command_errors
from pipeline.validation.cells import TERRAINS, condition_cells, step_cells, switch_cells
from pipeline.validation.cross_engine_walk import PushSettings, _push, figures_of
from pipeline.validation.deployed import Deployed
from pipeline.validation.suites import push_cells
from pipeline.validation.trial import Start
from pipeline.validation.walk import drawn_start, ground_of
from tests.factories.validation_walks import gliding_rollout


def test_a_robot_that_glides_with_its_trunk_tilted_has_the_velocity_in_its_heading(robot: Robot):
    glide = gliding_rollout(robot, (0.6, 0.1, 0.8))
    tilt = rotation.from_axis_angle(np.array([0.0, 1.0, 0.0]), np.full(len(glide.qpos), 0.4))
    qpos, qvel = glide.qpos.copy(), glide.qvel.copy()
    qpos[:, 3:7] = rotation.multiply(qpos[:, 3:7], tilt)
    qvel[:, 3:6] = rotation.rotate_inverse(qpos[:, 3:7], np.array([0.0, 0.0, 0.8]))
    found = figures_of(dataclasses.replace(glide, qpos=qpos, qvel=qvel), 2.0)
    assert found.velocity == pytest.approx((0.6, 0.1, 0.8), abs=1e-6)


def test_walking_and_turning_the_other_way_is_twice_the_command_off():
    found = command_errors((0.3, 0.4, 1.0), (-0.3, -0.4, -1.0))
    assert found == pytest.approx({"speed_error": 1.0, "yaw_rate_error": 2.0})


def test_a_slope_rises_as_its_cell_says():
    slopes = {name: ground for name, (ground, _) in TERRAINS.items() if name.endswith((" up", " down"))}
    assert len(slopes) >= 4
    for name, spec in slopes.items():
        ground, degrees = ground_of(spec), float(name.split()[-2]) * (1.0 if name.endswith("up") else -1.0)
        assert ground.height(2.0, 0.0) - ground.height(1.0, 0.0) == pytest.approx(np.tan(np.radians(degrees))), name


def test_a_delay_is_that_of_its_cells_name_and_sudden_commands_have_three_seconds_to_settle():
    delays = [cell for cell in condition_cells((1,)) if cell.name.startswith("delay")]
    assert delays
    for cell in delays:
        assert cell.trials[0].conditions.delay_s == pytest.approx(float(cell.name.split()[1]) / 1000.0), cell.name
    for trial in (trial for cell in (*step_cells((1,)), *switch_cells((1,))) for trial in cell.trials):
        assert trial.measure_s - trial.command.last.start_s == 3.0 and trial.seconds - trial.measure_s >= 4.0


def test_a_push_has_its_impulse_in_the_robots_heading():
    push = Mock(spec=PushSettings, start_s=1.0, duration_s=0.1, impulse=(20.0, -5.0))
    made = _push(push, Mock(spec=PlantState, root_quat_w=rotation.about_z(1.0)))
    wanted = rotation.rotate(rotation.about_z(1.0), np.array([20.0, -5.0, 0.0]))
    assert made is not None and made.force_w * made.duration_s == pytest.approx(wanted)


def test_pushes_come_forward_first_and_then_turn_to_the_left(robot: Robot):
    ways = {Push: "force_w", Kick: "delta_v_w", Throw: "direction_w"}
    for cell in push_cells(robot):
        events = [trial.events[0] for trial in cell.trials[:8]]
        way = np.array([getattr(event, ways[type(event)]) for event in events])
        headings = rotation.rotate(rotation.about_z(np.arange(8) * np.pi / 4.0), np.array([1.0, 0.0, 0.0]))
        np.testing.assert_allclose(rotation.normalize(way), headings, atol=1e-9, err_msg=cell.name)


@pytest.mark.parametrize(
    "ground", [terrain.Slope(angle_deg=10.0), terrain.Slope(angle_deg=-10.0), terrain.CrossSlope(angle_deg=10.0)]
)
def test_soles_begin_on_a_slope(robot: Robot, ground):
    one = Mock(spec=Deployed, robot=robot, task=SimpleNamespace(default_joint_pos=robot.default_joint_pos))
    still = Start(joint_pos=0.0, joint_vel=0.0, lin_vel=0.0, ang_vel=0.0, tilt=0.0)
    start = drawn_start(one, still, ground, np.random.default_rng(1))
    names = [name for foot in robot.sole_corners for name in foot]
    corners = start.root_pos_w + Kinematics(robot).sites_of_pose(names, start.joint_pos, start.root_quat_w)
    gap = np.array([z - ground.height(x, y) for x, y, z in corners.tolist()])
    assert gap.min() == pytest.approx(0.0, abs=1e-9) and gap.max() < 0.01
