"""Every ground where rays find it, flat at the start, and a robot that stands on it."""

from pathlib import Path

import mujoco
import numpy as np
import pytest

from pipeline import rotation
from pipeline.deployment import deployment_task
from pipeline.robot import Robot
from pipeline.robot.kinematics import Kinematics
from pipeline.simulation.mujoco_plant import MujocoOptions, MujocoPlant
from pipeline.simulation.plant import PlantState, standing_state
from pipeline.simulation.terrain import (
    Bump,
    CrossSlope,
    FlatGround,
    Ground,
    Slope,
    gravel,
    rough_ground,
    stepping_stones,
)
from pipeline.validation.deployed import deployed
from pipeline.validation.trial import Start
from pipeline.validation.walk import drawn_start
from tests.factories.policies import still_policy

GROUNDS = {
    "flat": FlatGround(),
    "up": Slope(angle_deg=10.0),
    "down": Slope(angle_deg=-10.0),
    "across": CrossSlope(angle_deg=5.0),
    "bump": Bump(at_m=1.5, rise_m=0.03, width_m=0.4),
    "gravel": gravel(np.random.default_rng(1), step_m=0.03),
    "stones": stepping_stones(np.random.default_rng(2), gap_m=0.04, step_m=0.02),
    "rough": rough_ground(np.random.default_rng(3), amplitude_m=0.03),
}


def _ray_height(model: mujoco.MjModel, data: mujoco.MjData, x: float, y: float) -> float:
    hit = np.zeros(1, dtype=np.int32)
    away = mujoco.mj_ray(model, data, np.array([x, y, 3.0]), np.array([0.0, 0.0, -1.0]), None, 1, 1, hit)
    return 3.0 - away


@pytest.mark.parametrize("name", GROUNDS)
def test_the_ground_is_where_it_says(name: str):
    ground: Ground = GROUNDS[name]
    spec = mujoco.MjSpec()
    ground.add_to(spec)
    model = spec.compile()
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    rng = np.random.default_rng(0)
    # grid points of the height field and inside of the tiles, so that no edge decides
    places = np.round(rng.uniform([-1.0, -1.0], [8.0, 1.0], (60, 2)) / 0.15) * 0.15 + 0.1
    away_from_edges = [
        (x, y) for x, y in places if len({ground.height(x + dx, y) > -0.05 for dx in (-0.01, 0.0, 0.01)}) == 1
    ]
    assert len(away_from_edges) > 45
    for x, y in away_from_edges:
        assert ground.height(x, y) == pytest.approx(_ray_height(model, data, x, y), abs=2e-3)


def test_beside_the_hills_is_a_plane_just_below_them():
    ground = GROUNDS["rough"]
    spec = mujoco.MjSpec()
    ground.add_to(spec)
    model = spec.compile()
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    for y in (-4.0, 1.6):
        assert ground.height(4.0, y) == pytest.approx(_ray_height(model, data, 4.0, y), abs=1e-6)
        assert -0.04 < ground.height(4.0, y) < min(ground.height(4.0, inside) for inside in (-1.0, 0.0, 1.0))


@pytest.mark.parametrize("name", sorted(set(GROUNDS) - {"across"}))
def test_the_start_is_flat(name: str):
    places = np.random.default_rng(4).uniform(-0.49, 0.49, (30, 2))
    assert [GROUNDS[name].height(x, y) for x, y in places] == [0.0] * 30


def test_random_grounds_differ_by_seed_and_keep_to_their_size():
    one, again, other = (gravel(np.random.default_rng(seed), step_m=0.03) for seed in (1, 1, 2))
    np.testing.assert_array_equal(one.top_m, again.top_m)
    assert np.abs(one.top_m).max() <= 0.015
    assert not np.array_equal(one.top_m, other.top_m)
    assert np.abs(rough_ground(np.random.default_rng(5), amplitude_m=0.02).z_m).max() <= 0.02


def lowest_corner(robot: Robot, state: PlantState, ground: Ground) -> float:
    """Least height of the sole corners over the ground [m]."""
    names = [name for foot in robot.sole_corners for name in foot]
    corners = Kinematics(robot).sites_of_pose(names, state.joint_pos, state.root_quat_w) + state.root_pos_w
    return min(z - ground.height(x, y) for x, y, z in corners.tolist())


@pytest.mark.parametrize("name", GROUNDS)
def test_no_sole_begins_below_the_ground(robot: Robot, root: Path, name: str):
    assert lowest_corner(robot, standing_state(robot, GROUNDS[name]), GROUNDS[name]) == pytest.approx(0.0, abs=2e-4)
    one = deployed(root / "robots" / "t1", still_policy(deployment_task(robot)))
    start = Start(joint_pos=0.1, tilt=0.1, lin_vel=0.2, ang_vel=0.2, joint_vel=0.5)
    for seed in range(3):
        state = drawn_start(one, start, GROUNDS[name], np.random.default_rng(seed))
        assert lowest_corner(robot, state, GROUNDS[name]) == pytest.approx(0.0, abs=1e-9)


@pytest.mark.parametrize("angle_deg", [5.0, 10.0, -10.0])
def test_a_robot_on_a_cross_slope_begins_perpendicular_to_it_without_a_blow(robot: Robot, angle_deg: float):
    plant = MujocoPlant(robot, MujocoOptions(ground=CrossSlope(angle_deg=angle_deg)))
    state = plant.state()
    up = rotation.rotate(state.root_quat_w, np.array([0.0, 0.0, 1.0]))
    slope = np.radians(angle_deg)
    assert up == pytest.approx([0.0, -np.sin(slope), np.cos(slope)], abs=1e-12)
    for _ in range(10):
        state = plant.state()
        plant.step(robot.kp * (robot.default_joint_pos - state.joint_pos) - robot.kd * state.joint_vel)
    assert np.abs(plant.state().root_ang_vel_b).max() < 0.15


@pytest.mark.parametrize("name", GROUNDS)
def test_a_robot_put_on_it_rests_on_its_soles(robot: Robot, name: str):
    plant = MujocoPlant(robot, MujocoOptions(ground=GROUNDS[name]))
    for _ in range(150):
        state = plant.state()
        plant.step(robot.kp * (robot.default_joint_pos - state.joint_pos) - robot.kd * state.joint_vel)
    plant.foot_wrench_w()
    over = plant.state().root_pos_w[2] - GROUNDS[name].height(0.0, 0.0)
    assert over == pytest.approx(robot.default_root_height, abs=0.03)
