"""Ground that slopes: what falls does so along gravity as it leans, and robots sense it so."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np
import pytest
import torch
from scipy.spatial.transform import Rotation

from pipeline.training.bundle import read_bundle
from pipeline.training.environment import AmpEnvironment
from pipeline.training.presets import preset
from pipeline.training.slopes import GRAVITY, LEVEL_DEG
from tests.factories.training_bundle import small_bundle

ENVS = 12
STEEPEST_DEG = 10.0


@pytest.fixture(scope="module")
def env(tmp_path_factory, root, robot) -> Iterator[AmpEnvironment]:
    bundle = read_bundle(small_bundle(tmp_path_factory.mktemp("slopes"), root, robot))
    options = preset("paper_flat").changed(
        slope_share=0.5,
        slope_deg=STEEPEST_DEG,
        slope_iterations=(10, 20),
        noise=(0.0, 0.0, 0.0, 0.0),
        push_speed=(0.0, 0.0),
    )
    yield AmpEnvironment(bundle, options, ENVS, "cpu", seed=4)


def _lean_deg(env: AmpEnvironment) -> torch.Tensor:
    assert env.slopes is not None
    return torch.rad2deg(torch.atan2(env.slopes.down_w[:, :2].norm(dim=1), -env.slopes.down_w[:, 2]))


def test_slopes_grow_to_their_angles_and_the_others_stay_level(env: AmpEnvironment):
    assert env.slopes is not None
    leans = []
    for iteration in (0.0, 10.0, 15.0, 20.0, 1e9):
        env.slopes.at(iteration)
        leans.append(_lean_deg(env))
        assert env.slopes.down_w.norm(dim=1) == pytest.approx(torch.ones(ENVS), abs=1e-6)
    level = leans[-1] == 0.0
    assert 0 < int(level.sum()) < ENVS
    assert (leans[-1] <= STEEPEST_DEG).all()
    assert len(set(leans[-1][~level].tolist())) == int((~level).sum()), "each has its own"
    assert leans[0].max() == leans[1].max() == 0.0
    assert leans[2] == pytest.approx(leans[3] / 2.0, abs=1e-4)
    assert torch.equal(leans[3], leans[4])


def test_a_robot_in_the_air_falls_along_the_leaning_gravity(env: AmpEnvironment):
    env.reset()
    env.schedule = 1e9
    env.sim.data.qpos[:, 2] += 5.0
    env.sim.data.qpos[:, 7:] = env.default_joint_pos  # where motors hold it: rotors have no momentum in the model
    env.sim.data.qvel[:] = 0.0
    subtree = env.scene["robot"].indexing.root_body_id
    env.sim.forward()
    begun = env.sim.data.subtree_com[:, subtree].clone()
    env.step(torch.zeros(ENVS, 21))
    env.step(torch.zeros(ENVS, 21))
    assert env.slopes is not None
    steps, dt = round(2 * env.step_dt / env.physics_dt), env.physics_dt
    fallen_m = 0.5 * steps * (steps + 1) * dt * dt * GRAVITY  # semi-implicit: the newest velocity moves it
    moved = env.sim.data.subtree_com[:, subtree] - begun
    assert moved == pytest.approx(fallen_m * env.slopes.down_w, abs=2e-4)
    assert moved[:, :2].abs().max() > 1e-3


def test_sensors_see_the_gravity_that_leans(env: AmpEnvironment):
    env.reset()
    env.schedule = 1e9
    seen = env.step(torch.zeros(ENVS, 21))[0]["actor"]
    assert env.slopes is not None
    w, x, y, z = env.sim.data.qpos[:, 3:7].T.double().numpy()
    wanted = Rotation.from_quat(np.stack([x, y, z, w], axis=1)).inv().apply(env.slopes.down_w.double().numpy())
    assert seen[:, -72 + 3 : -72 + 6].numpy() == pytest.approx(wanted, abs=1e-4)
    level = _lean_deg(env) == 0.0
    assert -env.readings.root_rotation_w[level, 2] == pytest.approx(env.readings.gravity_b[level], abs=1e-6)


def test_a_robot_left_alone_tips_down_its_slope(env: AmpEnvironment):
    env.reset()
    env.schedule = 1e9
    assert env.slopes is not None
    env.slopes.at(1e9)
    steep = _lean_deg(env) > math.degrees(0.07)
    assert steep.any()
    env.sim.data.qpos[:, 7:] = env.default_joint_pos
    env.sim.data.qpos[:, 3:7] = torch.tensor([1.0, 0.0, 0.0, 0.0])
    env.sim.data.qpos[:, 2] = env.context.bundle.robot.default_root_height + 0.005
    env.sim.data.qvel[:] = 0.0
    env.sim.forward()
    begun = env.sim.data.qpos[:, :2].clone()
    for _ in range(15):
        env.step(torch.zeros(ENVS, 21))
    along = ((env.sim.data.qpos[:, :2] - begun) * env.slopes.down_w[:, :2]).sum(dim=1)
    still = env.episode_length_buf >= 15
    assert (along[steep & still] > 0.0).all()
    assert (steep & still).any()


def test_nobody_tracks_a_clip_where_the_ground_slopes(tmp_path, root, robot):
    bundle = read_bundle(small_bundle(tmp_path, root, robot))
    asked = {"slope_share": 0.5, "slope_deg": STEEPEST_DEG, "slope_iterations": (10, 20)}
    env = AmpEnvironment(bundle, preset("paper_flat").changed(**asked, tracked=1.0, tracked_end=1.0), ENVS, "cpu", 4)
    clip = env.tracked_clip
    assert clip is not None
    for schedule, sloped in ((0.0, False), (1e9, True)):
        env.schedule = schedule
        env.go_on()
        env.reset()
        lean = _lean_deg(env)
        assert bool((lean > LEVEL_DEG).any()) == sloped
        assert torch.equal(clip.tracks, lean < LEVEL_DEG)
