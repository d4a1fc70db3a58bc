"""Rotors on links: as the engines' comparison has them, and which environments do."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest
import torch
from scipy.spatial.transform import Rotation

from pipeline.simulation.armature_on_links import put_armature_on_links
from pipeline.simulation.mujoco_plant import MujocoOptions, MujocoPlant
from pipeline.training.bundle import read_bundle
from pipeline.training.environment import AmpEnvironment
from pipeline.training.plain_walk import model_of
from pipeline.training.presets import preset
from pipeline.training.rotor_links import LEVELS
from pipeline.training.rotors import put_rotors_on_links, rotors_on_links
from tests.factories.training_bundle import small_bundle

ENVS = 24


def _accelerations(model: mujoco.MjModel, seed: int) -> np.ndarray:
    """Of a robot in the air in a random state, under random torques."""
    rng, data = np.random.default_rng(seed), mujoco.MjData(model)
    data.qpos[:] = model.qpos0
    data.qpos[2] = 3.0
    data.qpos[7:] += rng.uniform(-0.3, 0.3, model.nq - 7)
    data.qvel[:] = rng.uniform(-1.0, 1.0, model.nv)
    data.qfrc_applied[6:] = rng.uniform(-10.0, 10.0, model.nv - 6)
    mujoco.mj_forward(model, data)
    return data.qacc.copy()


def test_all_of_them_on_links_is_what_the_comparison_of_engines_has(robot):
    wanted = MujocoPlant(robot, MujocoOptions(armature=robot.armature)).model
    given = MujocoPlant(robot, MujocoOptions(armature=robot.armature)).model
    put_armature_on_links(wanted, robot)
    put_rotors_on_links(given, 1.0)
    assert given.dof_armature.max() == 0.0
    for seed in range(3):
        assert _accelerations(given, seed) == pytest.approx(_accelerations(wanted, seed), rel=1e-7, abs=1e-7)


def test_a_joint_alone_feels_the_same_wherever_its_rotor_is():
    """A parent that is held does not turn: then the armature and the link's inertia are one and the same."""
    text = (
        '<mujoco><option gravity="0 0 0"/><worldbody><body><joint axis="0 .6 .8" armature=".05"/>'
        '<geom type="box" size=".1 .2 .3" density="300" pos=".1 0 .2"/></body></worldbody></mujoco>'
    )
    model = mujoco.MjModel.from_xml_string(text)

    def acceleration(model: mujoco.MjModel) -> float:
        data = mujoco.MjData(model)
        data.qfrc_applied[0] = 1.0
        mujoco.mj_forward(model, data)
        return float(data.qacc[0])

    for share in (0.0, 0.3, 1.0):
        moved = mujoco.MjModel.from_xml_string(text)
        put_rotors_on_links(moved, share)
        assert moved.dof_armature[0] == pytest.approx(0.05 * (1.0 - share))
        assert acceleration(moved) == pytest.approx(acceleration(model), rel=1e-9)


def _moment(principal: np.ndarray, quat: np.ndarray) -> np.ndarray:
    """Of inertia [kg m^2] in the link's axes, from principal moments and their axes, w first."""
    turn = Rotation.from_quat(np.roll(quat, -1)).as_matrix()
    return turn @ np.diag(principal) @ turn.T


def test_environments_have_shares_of_them_and_the_others_none(tmp_path_factory, root, robot):
    bundle = read_bundle(small_bundle(tmp_path_factory.mktemp("rotors"), root, robot))
    env = AmpEnvironment(bundle, preset("paper_flat").changed(rotor_link_share=0.6), ENVS, "cpu", seed=2)
    share = env.rotor_link_share
    levels = (LEVELS - 1) * share
    assert torch.equal(levels, levels.round())
    assert 0 < int((share == 0.0).sum()) < ENVS
    model, fields = env.sim.mj_model, env.sim.model
    for at in range(ENVS):
        inertia, iquat, armature = rotors_on_links(model, float(share[at]))
        assert fields.dof_armature[at].tolist() == pytest.approx(armature.tolist(), abs=1e-6)
        for body in np.unique(model.jnt_bodyid[1:]):
            given = _moment(fields.body_inertia[at][body].numpy(), fields.body_iquat[at][body].numpy())
            assert given == pytest.approx(_moment(inertia[body], iquat[body]), abs=1e-6)


def test_a_walk_with_rotors_on_links_has_no_armature(tmp_path, root, robot):
    folder = small_bundle(tmp_path, root, robot)
    plain, moved = model_of(folder, 1.0), model_of(folder, 1.0, 1.0)
    assert plain.dof_armature.max() > 0.0
    assert moved.dof_armature.max() == 0.0
