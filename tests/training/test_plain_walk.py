"""The walk in plain MuJoCo from a bundle: compared with `pipeline.validation`, which implements it independently."""

from __future__ import annotations

from pathlib import Path

import mujoco
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from pipeline.deployment import load_policy
from pipeline.errors import FileError
from pipeline.training.plain_walk import Walk, World, measure_walk, touchdown_rate
from pipeline.validation.cells import command_cells
from pipeline.validation.deployed import deployed
from pipeline.validation.figures import measure
from tests.factories.training_bundle import small_bundle

SHIPPED = Path("robots/t1/policies/walk/policy.npz")


@pytest.fixture(scope="module")
def bundle_folder(tmp_path_factory, root, robot):
    return small_bundle(tmp_path_factory.mktemp("bundle"), root, robot)


@pytest.mark.parametrize("command", [(0.6, 0.0, 0.0), (0.0, 0.0, 1.0)])
def test_a_walk_has_the_figures_that_validation_measures(bundle_folder, root, command):
    """Two independent implementations agree within a few per cent."""
    one = deployed(bundle_folder.parent / "adapted" / "t1", load_policy(root / SHIPPED))
    (cell,) = (each for each in command_cells((0,)) if each.trials[0].command.last.goal == command)
    (expected,) = measure(one, [cell])[0].trials
    found = measure_walk(bundle_folder, root / SHIPPED, Walk(command=command))
    for name in ("forward", "yaw_rate"):
        assert found[name] == pytest.approx(expected[name], abs=0.05)
    assert found["power"] == pytest.approx(expected["power"], rel=0.1)


def test_a_fall_ends_the_walk(bundle_folder, root):
    found = measure_walk(bundle_folder, root / SHIPPED, Walk(command=(9.0, 0.0, 0.0)))
    assert found["fell"] == 1.0 and 1.0 < found["fell_s"] < 10.0


def test_joint_targets_that_are_not_finite_count_as_a_fall(bundle_folder, root):
    world = World(bundle_folder, root / SHIPPED, Walk(command=(0.0, 0.0, 0.0)))
    world.update_targets()
    assert not world.fell
    world.target[3] = np.nan
    assert world.fell


def test_gains_of_a_policy_are_those_of_their_joint_names(bundle_folder, root, tmp_path):
    """Also where its file has the joints in another order; its default pose is its own."""
    with np.load(root / SHIPPED) as arrays:
        given = dict(arrays)
    given["kp"], given["default_joint_pos"] = np.arange(23.0), given["default_joint_pos"] + 0.01
    turned = {name: given[name][::-1] for name in ("joint_names", "kp", "kd", "default_joint_pos")}
    np.savez(tmp_path / "turned.npz", **{**given, **turned})
    world = World(bundle_folder, tmp_path / "turned.npz", Walk(command=(0.0, 0.0, 0.0)))
    assert world.kp.tolist() == given["kp"].tolist()
    assert world.rest == pytest.approx(given["default_joint_pos"])


@pytest.mark.parametrize("other", ["k1/policies/walk/policy.npz", "t1/policies/tracker/tracker.npz"])
def test_a_policy_of_another_robot_or_task_is_refused_by_name(bundle_folder, root, other):
    with pytest.raises(
        FileError, match=r"npz: it is not a walking policy of 't1', which needs 720 observations, 21 act"
    ):
        measure_walk(bundle_folder, root / "robots" / other, Walk(command=(0.0, 0.0, 0.0)))


def test_touchdowns_per_minute_do_not_depend_on_the_measured_duration():
    step = np.arange(300)
    assert touchdown_rate(step % 24 >= 10, 0.02) == pytest.approx(60.0 / 0.48)
    assert touchdown_rate(step % 24 >= 1, 0.02) == 0.0, "20 ms in the air are no swing"
    assert touchdown_rate(step >= 10, 0.02) == pytest.approx(10.0), "one touchdown in 6 s"
    assert touchdown_rate((step >= 20) | (step == 10), 0.02) == pytest.approx(20.0), "two, and then it stands"


@pytest.mark.parametrize(("lean_deg", "fell"), [(50.0, False), (-50.0, False), (70.0, True), (-70.0, True)])
def test_a_trunk_that_leans_by_70_degrees_fell_and_by_50_did_not(bundle_folder, root, lean_deg, fell):
    world = World(bundle_folder, root / SHIPPED, Walk(command=(0.0, 0.0, 0.0)))
    world.data.qpos[3:7] = np.roll(Rotation.from_euler("y", lean_deg, degrees=True).as_quat(), 1)
    mujoco.mj_kinematics(world.model, world.data)
    assert world.fell is fell
