"""Slopes, kicks, pushes and rotors, each against physics that is known."""

from __future__ import annotations

import math
from unittest.mock import MagicMock

import mujoco
import numpy as np
import pytest
import torch
from scipy.spatial.transform import Rotation

from pipeline.physics import GRAVITY
from pipeline.training.bundle import read_bundle
from pipeline.training.config import AFTER_CHANGE_S, PAPER, RECIPE
from pipeline.training.environment import AFTER_CHANGE_STEPS, AmpEnvironment
from pipeline.training.mdp.events import FORCE_S, ROTOR_LEVELS, SMALLEST_PUSH, Slopes, horizontal
from pipeline.training.rotors import rotors_on_links
from tests.factories.training_bundle import small_bundle

ENVS = 24
STEEPEST_DEG = 10.0
CALM = {
    "randomization.noise": 0.0,
    "pushes.kick_m_s": (0.0, 0.0),
    "pushes.impulse_n_s": (0.0, 0.0),
    "discriminator.style": 0.0,
}


@pytest.fixture(scope="module")
def bundle(tmp_path_factory, root, robot):
    return read_bundle(small_bundle(tmp_path_factory.mktemp("events"), root, robot))


def made(bundle, **changed) -> AmpEnvironment:
    values = {"simulation.num_envs": ENVS, "simulation.stall_s": 0.0, "randomization.delay_s": 0.0, **CALM}
    env = AmpEnvironment(bundle, RECIPE.changed({**values, **changed}), "cpu", seed=4)
    env.reset()
    return env


@pytest.fixture(scope="module")
def sloped(bundle) -> AmpEnvironment:
    return made(bundle, **{"randomization.slope_deg": STEEPEST_DEG, "randomization.rotor_link_share": 0.6})


def tilt_deg(env: AmpEnvironment) -> torch.Tensor:
    return torch.rad2deg(torch.atan2(env.slopes.down_w[:, :2].norm(dim=1), -env.slopes.down_w[:, 2]))


def test_slopes_grow_with_the_disturbance_in_a_third_of_the_environments(sloped):
    tilts = []
    for share in (0.0, 0.5, 1.0):
        sloped.set_disturbance(share)
        tilts.append(tilt_deg(sloped))
        assert sloped.slopes.down_w.norm(dim=1) == pytest.approx(torch.ones(ENVS), abs=1e-6)
    level = tilts[2] == 0.0
    assert 0 < int(level.sum()) < ENVS
    assert tilts[2].max() <= STEEPEST_DEG
    assert tilts[0].max() == 0.0
    assert tilts[1] == pytest.approx(tilts[2] / 2.0, abs=1e-4)


def test_a_robot_in_the_air_falls_along_its_tilted_gravity(sloped):
    env = sloped
    env.set_disturbance(1.0)
    env.reset()
    env.sim.data.qpos[:, 2] += 5.0
    env.sim.data.qpos[:, 7:] = env.default_joint_pos
    env.sim.data.qvel[:] = 0.0
    root = env.scene["robot"].indexing.root_body_id
    env.sim.forward()
    start = env.sim.data.subtree_com[:, root].clone()
    env.step(torch.zeros(ENVS, 21))
    env.step(torch.zeros(ENVS, 21))
    steps, dt = round(2 * env.step_dt / env.physics_dt), env.physics_dt
    fall_m = 0.5 * steps * (steps + 1) * dt * dt * GRAVITY  # semi-implicit Euler: the newest velocity moves it
    moved = env.sim.data.subtree_com[:, root] - start
    assert moved == pytest.approx(fall_m * env.slopes.down_w, abs=3e-4)
    assert moved[:, :2].abs().max() > 1e-3


def test_sensors_and_mjlab_terms_read_the_tilted_gravity(sloped):
    sloped.set_disturbance(1.0)
    sloped.reset()
    seen = sloped.step(torch.zeros(ENVS, 21))[0]["actor"]
    w, x, y, z = sloped.sim.data.qpos[:, 3:7].T.double().numpy()
    turn = Rotation.from_quat(np.stack([x, y, z, w], axis=1)).inv()
    expected = turn.apply(sloped.slopes.down_w.double().numpy())
    assert seen[:, -72 + 3 : -72 + 6].numpy() == pytest.approx(expected, abs=1e-4)
    assert sloped.scene["robot"].data.projected_gravity_b.numpy() == pytest.approx(expected, abs=1e-4)


def moment(principal: np.ndarray, quat: np.ndarray) -> np.ndarray:
    """Inertia in the link's axes [kg m^2] from principal moments and their axes, w first."""
    turn = Rotation.from_quat(np.roll(quat, -1)).as_matrix()
    return turn @ np.diag(principal) @ turn.T


def test_some_environments_have_a_share_of_the_rotors_on_links(sloped):
    model, fields = sloped.sim.mj_model, sloped.sim.model
    hinge = int(model.jnt_dofadr[np.flatnonzero(model.jnt_type == mujoco.mjtJoint.mjJNT_HINGE)[0]])
    shares = set()
    for at in range(ENVS):
        share = 1.0 - float(fields.dof_armature[at][hinge]) / float(model.dof_armature[hinge])
        inertia, iquat, armature = rotors_on_links(model, share)
        assert fields.dof_armature[at].tolist() == pytest.approx(armature.tolist(), abs=1e-6)
        for body in np.unique(model.jnt_bodyid[1:]):
            given = moment(fields.body_inertia[at][body].numpy(), fields.body_iquat[at][body].numpy())
            assert given == pytest.approx(moment(inertia[body], iquat[body]), abs=2e-6)
        shares.add(round(share * (ROTOR_LEVELS - 1), 3))
    assert shares <= {float(level) for level in range(ROTOR_LEVELS)}
    assert 0.0 in shares and len(shares) > 1


def test_pushes_have_all_horizontal_directions_and_lengths():
    torch.manual_seed(0)
    push = horizontal(5000, 0.3, "cpu")
    length = push.norm(dim=1)
    assert (push[:, 2] == 0.0).all()
    assert 0.3 - 1e-3 <= length.min() < 0.31 and length.max() <= 1.0 + 1e-3
    assert push.mean(dim=0).abs().max() < 0.03


def test_a_kick_changes_the_velocity_by_at_most_the_ramps_value(bundle):
    env = made(bundle, **{"pushes.kick_m_s": (0.0, 2.0), "pushes.interval_s": (0.02, 0.02)})
    term = env.event_manager.get_term_cfg("kick").func
    for disturbance, largest in ((0.0, 0.0), (0.5, 1.0), (1.0, 2.0)):
        env.set_disturbance(disturbance)
        before = env.sim.data.qvel[:, :3].clone()
        term(env, None)
        change = (env.sim.data.qvel[:, :3] - before).norm(dim=1)
        assert change.max() <= largest + 1e-5
        assert change.min() >= SMALLEST_PUSH * largest - 1e-5


def test_the_papers_kicks_are_of_0_3_to_1_5_m_s():
    largest = PAPER.pushes.kick_m_s[1]
    assert (SMALLEST_PUSH * largest, largest) == pytest.approx((0.3, 1.5))


def test_a_force_acts_for_0_1_s_and_ends_with_the_episode(bundle):
    env = made(bundle, **{"pushes.impulse_n_s": (40.0, 40.0), "pushes.interval_s": (0.3, 0.4)})
    trunk, _ = env.scene["robot"].find_bodies(env.context.bundle.robot.root_link)
    lasted, seen, largest = torch.zeros(ENVS, dtype=torch.long), set(), 0.0
    for step in range(40):
        if step == 25:
            env.episode_length_buf[:] = env.max_episode_length
        env.step(torch.zeros(ENVS, 21))
        new = env.episode_length_buf == 0
        assert (env.push_w[new] == 0.0).all()
        force = env.scene["robot"].data.body_external_force[:, trunk[0]].norm(dim=1)
        largest = max(largest, float(force.max()))
        acts = force > 0.0
        seen |= set(lasted[~acts & ~new & (lasted > 0)].tolist())
        lasted = torch.where(acts & ~new, lasted + 1, 0)
    assert seen == {round(FORCE_S / env.step_dt)}
    assert 0.5 * 400.0 < largest <= 400.0 + 1e-3


@pytest.mark.parametrize("push", ("impulse_n_s", "kick_m_s"))
def test_the_discriminator_reads_no_window_soon_after_a_push(bundle, push):
    still = {"simulation.reference_share": 0.0, "commands.standing_share": 1.0}
    others = {"commands.single_axis_share": 0.0, "commands.fast_share": 0.0}
    env = made(bundle, **{f"pushes.{push}": (0.1, 0.1), "pushes.interval_s": (1.3, 1.4)}, **still, **others)
    timer = env.event_manager.get_term_cfg("push" if push == "impulse_n_s" else "kick").func._timer
    span = env._motion.shape[1]
    since, read = torch.full((ENVS,), 10_000), 0
    for _ in range(150):
        left_s = timer._left_s.clone()
        *_, extras = env.step(torch.zeros(ENVS, 21))
        new = env.episode_length_buf == 0
        began = (timer._left_s > left_s) & ~new
        since = torch.where(began, 0, torch.where(new, 10_000, since + 1))
        settled = env.velocity_command.age >= AFTER_CHANGE_S
        wanted = (env.episode_length_buf > span + 1) & (since >= AFTER_CHANGE_STEPS) & settled
        assert torch.equal(extras["motion_valid"], wanted)
        read += int((wanted & (since < 10_000)).sum())
        if push == "impulse_n_s":
            assert torch.equal(env.push_w.norm(dim=1) > 0.0, since < round(FORCE_S / env.step_dt))
    assert read > 0


def test_one_environment_in_three_is_on_a_slope():
    count, start = 9000, torch.tensor([0.0, 0.0, -1.0])
    env = MagicMock(num_envs=count, device="cpu")
    env.context.config.randomization.slope_deg = STEEPEST_DEG
    env.scene["robot"].data.gravity_vec_w = start.repeat(count, 1)
    torch.manual_seed(0)
    slopes = Slopes(env)
    slopes.set_scale(1.0)
    assert float((slopes.down_w[:, 2] > -1.0).float().mean()) == pytest.approx(1.0 / 3.0, abs=0.02)


def test_grounds_motors_and_trunks_are_drawn_from_all_of_their_ranges(sloped):
    """24 draws each: one that misses a quarter at an end of its range has a probability of 0.1 %."""
    random, model, fields = RECIPE.randomization, sloped.sim.mj_model, sloped.sim.model
    feet = [model.geom(f"robot/{name}").id for name in sloped.context.bundle.robot.shapes["feet"]]
    friction = fields.geom_friction[:, feet, 0]
    assert torch.equal(friction, friction[:, :1].expand_as(friction)), "the ground is the same under both feet"
    trunk = sloped.scene["robot"].indexing.root_body_id
    mass = fields.body_mass[:, trunk] / float(model.body_mass[trunk])
    stiffness, damping = (
        torch.cat(
            [getattr(motor, name) / getattr(motor, f"default_{name}") for motor in sloped.scene["robot"].actuators],
            dim=1,
        )
        for name in ("stiffness", "damping")
    )
    low, high = random.trunk_density
    for values, (least, most) in (
        (friction[:, 0], random.friction),
        (stiffness[:, 0], random.gains),
        (damping[:, 0], random.gains),
        (mass, (math.exp(2.0 * low), math.exp(2.0 * high))),
    ):
        quarter = 0.25 * (most - least)
        assert least - 1e-4 <= values.min() < least + quarter
        assert most - quarter < values.max() <= most + 1e-4
