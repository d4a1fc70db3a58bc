"""How the clips' trunk leans by command, and what it costs to lean otherwise."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest
import torch
from scipy.spatial.transform import Rotation

from pipeline.training.bundle import read_bundle
from pipeline.training.command_cells import LEAST_FRAMES
from pipeline.training.environment import AmpEnvironment
from pipeline.training.motion_features import up_b
from pipeline.training.plain_walk import Notes, Walk, World, network_of
from pipeline.training.presets import preset
from pipeline.training.ramps import Ramps
from pipeline.training.trunk_lean import TrunkLean
from tests.factories.expert_frames import expert_of
from tests.factories.training_bundle import small_bundle

JOINTS = 21


def clip_of(lean_rad: float, speed: float, count: int) -> tuple[np.ndarray, np.ndarray]:
    """Frames and commands of a trunk that leans ahead and faces where it likes."""
    frames = np.zeros((count, 37 + 2 * JOINTS), dtype=np.float32)
    facing = Rotation.from_euler("Z", np.linspace(-3.0, 3.0, count)[:, None])
    frames[:, 3:7] = (facing * Rotation.from_euler("Y", lean_rad)).as_quat(scalar_first=True)
    return frames, np.tile(np.array([speed, 0.0, 0.0], dtype=np.float32), (count, 1))


def test_a_command_is_answered_by_the_lean_of_the_nearest_clips():
    few = clip_of(0.5, 3.0, LEAST_FRAMES - 1)
    lean = TrunkLean(expert_of(clip_of(0.1, 0.6, 80), clip_of(-0.2, 1.5, 80), few), "cpu")
    asked = torch.tensor([[0.5, 0.1, 0.0], [1.6, 0.0, 0.1], [3.0, 0.0, 0.0]])
    assert lean(asked)[:, 0].tolist() == pytest.approx(np.sin([0.1, -0.2, -0.2]).tolist(), abs=1e-5)
    assert lean(asked)[:, 1].tolist() == pytest.approx([0.0, 0.0, 0.0], abs=1e-5)


def test_the_vertical_is_the_rotations():
    rotation = Rotation.from_quat(np.random.default_rng(3).normal(size=(20, 4)))
    quat = torch.from_numpy(rotation.as_quat(scalar_first=True))
    assert up_b(quat).numpy() == pytest.approx(rotation.inv().apply([0.0, 0.0, 1.0]), abs=1e-12)


def test_leaning_to_a_side_is_told_with_its_side():
    turn = Rotation.from_euler("Z", np.linspace(0.0, 3.0, 80)[:, None])
    frames, command = clip_of(0.0, 0.9, 80)
    frames[:, 3:7] = (turn * Rotation.from_euler("X", 0.2)).as_quat(scalar_first=True)
    told = TrunkLean(expert_of((frames, command)), "cpu")(torch.tensor([[0.9, 0.0, 0.0]]))
    expected = -Rotation.from_euler("X", 0.2).inv().apply([0.0, 0.0, 1.0])[:2]
    assert told[0].tolist() == pytest.approx(expected.tolist(), abs=1e-6)
    assert abs(expected[1]) > 0.15


def test_leaning_otherwise_than_the_clips_costs_and_their_own_lean_does_not(tmp_path, root, robot):
    bundle = read_bundle(small_bundle(tmp_path, root, robot))
    env = AmpEnvironment(bundle, preset("paper_flat").changed(lean=20.0, reference_share=0.0), 2, "cpu", seed=1)
    env.reset()
    env.velocity_command.give(torch.arange(2), torch.tensor([[0.9, 0.0, 0.0], [0.9, 0.0, 0.0]]))
    wanted = float(torch.arcsin(env.trunk_lean(env.command)[0, 0]))
    for robot_at, lean in enumerate((wanted, wanted - 0.2)):
        env.sim.data.qpos[robot_at, 3:7] = torch.tensor([np.cos(0.5 * lean), 0.0, np.sin(0.5 * lean), 0.0])
    env.sim.forward()
    env.readings.fresh()
    task = env.reward_manager.get_term_cfg("task").func
    row = [each.name for each in task.rows].index("lean")
    paid = (task.values(env) * task.weights(env))[:, row]
    expected = (np.sin(wanted) - np.sin(wanted - 0.2)) ** 2
    across = float(env.trunk_lean(env.command)[0, 1]) ** 2
    assert paid.tolist() == pytest.approx([-20.0 * across, -20.0 * (expected + across)], abs=1e-4)


def test_effort_costs_more_late():
    options = preset("paper_flat").changed(cost_start=0.4, cost_iterations=(900, 1300))
    ramps, found = Ramps(options, "cpu"), []
    for iteration in (0, 900, 1100, 2000):
        ramps.at(iteration)
        found.append(float(ramps.cost))
    assert found == pytest.approx([0.4, 0.4, 0.7, 1.0])


def test_the_cost_of_effort_grows_and_that_of_the_rest_does_not(tmp_path, root, robot):
    bundle = read_bundle(small_bundle(tmp_path, root, robot))
    asked = {"power": 0.01, "power_share": 1.0, "saturation": 10.0, "cost_start": 0.4, "cost_iterations": (900, 1300)}
    env = AmpEnvironment(bundle, preset("paper_flat").changed(**asked), 1, "cpu", seed=1)
    task = env.reward_manager.get_term_cfg("task").func
    names = [each.name for each in task.rows]
    weights = {}
    for iteration in (0.0, 2000.0):
        env.ramps.at(iteration)
        weights[iteration] = dict(zip(names, task.weights(env).tolist(), strict=True))
    grown = {name for name in names if weights[0.0][name] != weights[2000.0][name]}
    assert grown == {"power", "power_share", "saturation"}
    assert [weights[0.0][name] for name in ("power", "saturation")] == pytest.approx([-0.004, -4.0])
    assert [weights[2000.0][name] for name in ("power", "saturation")] == pytest.approx([-0.01, -10.0])


def test_effort_grows_with_the_penalties_and_further_on(tmp_path, root, robot):
    bundle = read_bundle(small_bundle(tmp_path, root, robot))
    asked = {"power": 0.01, "cost_start": 0.4, "cost_iterations": (900, 1300)}
    asked |= {"penalty_start": 0.25, "penalty_iterations": 400}
    env = AmpEnvironment(bundle, preset("paper_flat").changed(**asked), 1, "cpu", seed=1)
    task = env.reward_manager.get_term_cfg("task").func
    at, found = [row.name for row in task.rows].index("power"), []
    for iteration in (0.0, 400.0, 1300.0):
        env.ramps.at(iteration)
        found.append(float(task.weights(env)[at]))
    assert found == pytest.approx([-0.001, -0.004, -0.01])


def test_a_sweep_tells_how_the_trunk_leans(tmp_path, root, robot):
    folder = small_bundle(tmp_path, root, robot)
    path = root / "robots" / "t1" / "policies" / "walk" / "policy.npz"
    world = World(folder, network_of(path, "any"), Walk(cell="", command=(0.0, 0.0, 0.0)))
    notes = Notes(world)
    for ahead_deg, side_deg in ((4.0, 3.0), (8.0, -3.0)):
        world.data.qpos[3:7] = Rotation.from_euler("YX", (ahead_deg, side_deg), degrees=True).as_quat(scalar_first=True)
        mujoco.mj_forward(world.model, world.data)
        notes.add_effort(np.zeros(len(world.rest)))
        notes.add()
    figures = notes.figures()
    assert figures["lean"] == pytest.approx(6.0, abs=0.05)
    assert figures["rock"] == pytest.approx(3.0, abs=0.05)
    apart = world.data.site_xpos[world.feet[0]] - world.data.site_xpos[world.feet[1]]
    assert figures["feet_apart"] == pytest.approx(np.linalg.norm(apart[:2]), abs=0.005)
