"""Trials as rollouts: what conditions change, that repeats are bit-identical, and the published figures again."""

import dataclasses
from pathlib import Path

import numpy as np
import pytest

from pipeline.batch import ClipPool
from pipeline.deployment import Policy, deployment_task, load_policy
from pipeline.errors import UnknownNameError
from pipeline.robot import Kinematics, Robot
from pipeline.simulation.terrain import FlatGround, Slope
from pipeline.validation.cells import TERRAINS, Cell, condition_cells, terrain_cells
from pipeline.validation.deployed import Deployed, deployed
from pipeline.validation.figures import measure, numbers_of
from pipeline.validation.suites import named, push_cells
from pipeline.validation.trial import CommandProfile, Conditions, GroundSpec, Start, Trial, VelocityCommand
from pipeline.validation.walk import Branches, Worlds, drawn_start, ground_of, walk
from pipeline.virtual_robot.trial import NOISE as AT_REST
from tests.factories.policies import random_policy, still_policy
from tests.factories.policy_walks import anchor

STAND = CommandProfile(commands=(VelocityCommand(),))


@pytest.fixture(scope="module")
def published(policies: Path) -> Policy:
    return load_policy(policies / "t1_walk.npz")


def _trial(**others) -> Trial:
    return Trial(**({"seed": 1, "command": STAND, "seconds": 0.4, "measure_s": 0.1} | others))


def test_a_drawn_start_stands_with_its_lowest_corner_on_the_ground(still: Deployed):
    robot = still.robot
    wide = Start(joint_pos=0.15, joint_vel=1.0, lin_vel=0.3, ang_vel=0.5, tilt=0.1)
    drawn = [drawn_start(still, wide, FlatGround(), np.random.default_rng(seed)) for seed in (1, 1, 2)]
    np.testing.assert_array_equal(drawn[0].joint_pos, drawn[1].joint_pos)
    assert not np.array_equal(drawn[0].joint_pos, drawn[2].joint_pos)
    kinematics = Kinematics(robot)
    for state in drawn:
        assert np.abs(state.joint_pos - robot.default_joint_pos).max() <= 0.15
        assert np.all((robot.joint_lower <= state.joint_pos) & (state.joint_pos <= robot.joint_upper))
        poses = kinematics.forward(state.root_pos_w[None], state.root_quat_w[None], state.joint_pos[None])
        corners = kinematics.site_pos_w(poses, [name for foot in robot.sole_corners for name in foot])
        assert corners[..., 2].min() == pytest.approx(0.0, abs=1e-9)


def test_seed_zero_starts_from_the_default_pose_and_others_do_not(still: Deployed):
    worlds = Worlds(still)
    plain, drawn = (walk(worlds, _trial(seed=seed)) for seed in (0, 1))
    np.testing.assert_array_equal(plain.qpos[0, 7:], still.task.default_joint_pos)
    assert np.abs(drawn.qpos[0, 7:] - still.task.default_joint_pos).max() > 0.005


def test_conditions_reach_the_simulation(still: Deployed):
    worlds = Worlds(still)
    plant = worlds.plant(Conditions(friction=0.3, root_mass_factor=1.2))
    assert plant.options.friction == 0.3
    assert plant.options.root_mass_factor == 1.2
    assert worlds.plant(Conditions(friction=0.3, root_mass_factor=1.2)) is plant
    assert worlds.plant(Conditions(gain_factor=0.9)) is worlds.plant(Conditions(delay_s=0.02))
    nominal, stiff = (walk(worlds, _trial(conditions=Conditions(gain_factor=factor))) for factor in (1.0, 1.1))
    np.testing.assert_allclose(stiff.torque[0], 1.1 * nominal.torque[0])
    assert isinstance(worlds.plant(Conditions(ground=GroundSpec(kind="slope", size=5.0))).ground, Slope)


def test_a_terrain_that_there_is_not_is_refused():
    with pytest.raises(UnknownNameError, match="unknown terrain 'lava'"):
        ground_of(GroundSpec(kind="lava", size=1.0))


def test_random_terrain_is_another_for_each_seed_and_the_rest_is_not():
    seeds = {
        cell.name: {t.conditions.ground.seed for t in cell.trials if t.conditions.ground}
        for cell in terrain_cells((1, 2))
    }
    assert seeds["terrain gravel 2 cm"] == seeds["terrain rough 2 cm"] == {1, 2}
    assert seeds["terrain grass slope 10 up"] == {0}
    assert len(seeds) == len(TERRAINS)


def test_conditions_are_those_of_the_protocol():
    names = {cell.name.rsplit(" ", 2)[0] for cell in condition_cells((1,))}
    assert {"friction 0.3", "friction 1.2", "delay 40 ms", "sensor noise", "trunk mass x0.8", "gains x1.1"} <= names


def test_numbers_are_the_same_bits_however_trials_are_spread(still: Deployed):
    def cell(name: str, conditions: Conditions) -> Cell:
        trials = tuple(_trial(seed=seed, seconds=0.2, conditions=conditions) for seed in range(1, 10))
        return Cell(name=name, group="test", figures=("falls",), trials=trials)

    cells = (cell("a", Conditions(friction=0.6)), cell("b", Conditions()))
    spread, alone = (measure(still, cells, ClipPool(workers=workers)) for workers in (2, 1))
    assert [each.trials for each in spread] == [each.trials for each in alone]
    assert spread[0].trials != spread[1].trials
    worlds = Worlds(still)
    first = cells[1].trials[0]
    assert alone[1].trials[0] == numbers_of(walk(worlds, first), first, still.envelope)


@pytest.mark.parametrize("shift", [0.0, 0.3])
@pytest.mark.parametrize("model", ["force", "kick", "ball"])
def test_pushes_that_share_the_way_there_have_the_bits_of_whole_walks(still: Deployed, model: str, shift: float):
    """Also those between two control steps."""
    moved = dataclasses.replace(still, policy=random_policy(still.task, np.random.default_rng(1), hidden=2))
    moved = dataclasses.replace(moved, task=dataclasses.replace(still.task, action_scale=1e-5))
    worlds = Worlds(moved)
    branches = Branches(worlds)
    cell = next(each for each in push_cells(still.robot, (model,), shift) if "standing" in each.name)
    for trial in (cell.trials[0], cell.trials[2], cell.trials[9]):
        event = dataclasses.replace(trial.events[0], start_s=trial.events[0].start_s - 0.8)
        short = dataclasses.replace(trial, events=(event,), seconds=event.start_s + 0.3, measure_s=event.start_s)
        part, whole = branches.walk(short), walk(worlds, short)
        assert event.start_s - 0.02 < part.start_s <= event.start_s + 1e-9
        assert np.abs(part.target[0] - moved.task.default_joint_pos).max() > 0.0
        np.testing.assert_array_equal(part.qpos, whole.qpos[-len(part.qpos) :])
        np.testing.assert_array_equal(part.foot_wrench_w[5:], whole.foot_wrench_w[-len(part.qpos) + 5 :])
        np.testing.assert_array_equal(part.target, whole.target[-len(part.target) :])
        assert part.fell_s == whole.fell_s
        assert numbers_of(part, short, moved.envelope) == numbers_of(whole, short, moved.envelope)


def test_the_anchor_has_the_manufacturers_armatures_and_ankles(root: Path, robot: Robot):
    one = anchor(root / "robots" / "t1", still_policy(deployment_task(robot)))
    armature = dict(zip(robot.joint_names, np.array(one.armature), strict=True))
    assert armature["Left_Hip_Pitch"] == armature["Right_Knee_Pitch"] == 0.0
    assert armature["Left_Ankle_Roll"] == 0.05
    kd = dict(zip(robot.joint_names, one.task.kd, strict=True))
    assert kd["Left_Ankle_Pitch"] == 2.0
    assert kd["Left_Knee_Pitch"] == 5.0
    np.testing.assert_array_equal(Worlds(one).plant(Conditions()).model.dof_armature[6:], np.array(one.armature))


@pytest.mark.shared
@pytest.mark.parametrize(("cell", "axis", "figure", "power"), [("vx +1.0", "forward", 0.96, 178.0)])
def test_the_published_sweep_comes_out_on_its_model(
    root: Path, published: Policy, cell: str, axis: str, figure: float, power: float
):
    one = anchor(root / "robots" / "t1", published)
    (found,) = measure(one, named(one.robot, {cell: 1}), ClipPool(workers=1))
    assert found.spread(axis)["mean"] == pytest.approx(figure, abs=0.03)
    assert found.spread("power")["mean"] == pytest.approx(power, rel=0.03)


@pytest.mark.shared
def test_pushes_topple_the_published_policy_where_published(root: Path, published: Policy):
    one = anchor(root / "robots" / "t1", published)
    wanted = {"push force standing 40 Ns": 1, "push force standing 60 Ns": 1}
    survived = [each.figure("survival") for each in measure(one, named(one.robot, wanted), ClipPool(workers=1))]
    assert survived == [1.0, 0.0]


@pytest.mark.shared
def test_gains_that_travel_with_a_policy_are_those_it_walks_with(root: Path, published: Policy, robot: Robot):
    from pipeline.deployment import PolicyGains

    gains = PolicyGains(
        joint_names=robot.joint_names,
        kp=0.5 * robot.kp,
        kd=robot.kd,
        default_joint_pos=np.array(robot.default_joint_pos),
    )
    one = deployed(root / "robots" / "t1", dataclasses.replace(published, gains=gains))
    np.testing.assert_allclose(one.motors().kp, 0.5 * robot.kp)


def test_sensor_noise_is_several_times_that_of_a_robot_at_rest():
    """Every width, against the noise of the virtual robot's sensors, in the cells that name it and in no other."""
    cells = condition_cells((0,))
    noisy = [trial.conditions.noise for cell in cells for trial in cell.trials if cell.name.startswith("sensor noise")]
    assert len(noisy) == 2
    for found in noisy:
        assert found is not None
        times = [width / getattr(AT_REST, name) for name, width in vars(found).items()]
        assert min(times) >= 3.0 and max(times) <= 10.0
    others = [cell for cell in cells if not cell.name.startswith("sensor noise")]
    assert all(trial.conditions.noise is None for cell in others for trial in cell.trials)
