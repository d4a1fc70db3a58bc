"""Rotors on links, compared with the engines' comparison and with a single joint."""

from __future__ import annotations

import copy

import mujoco
import numpy as np
import pytest

from pipeline.simulation.mujoco_plant import MujocoOptions, MujocoPlant, put_armature_on_links
from pipeline.training.plain_walk import ground_model
from pipeline.training.rotors import rotors_on_links
from tests.factories.training_bundle import small_bundle


def put_rotors_on_links(model: mujoco.MjModel, share: float) -> None:
    """Change a compiled model accordingly."""
    model.body_inertia[:], model.body_iquat[:], model.dof_armature[:] = rotors_on_links(model, share)
    model.body_sameframe[:] = mujoco.mjtSameFrame.mjSAMEFRAME_NONE  # so that the axes count in any MuJoCo
    mujoco.mj_setConst(model, mujoco.MjData(model))


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


def test_all_rotors_on_links_match_the_engine_comparison(robot):
    wanted = MujocoPlant(robot, MujocoOptions(armature=robot.armature)).model
    given = MujocoPlant(robot, MujocoOptions(armature=robot.armature)).model
    put_armature_on_links(wanted, robot)
    put_rotors_on_links(given, 1.0)
    assert given.dof_armature.max() == 0.0
    for seed in range(3):
        assert _accelerations(given, seed) == pytest.approx(_accelerations(wanted, seed), rel=1e-7, abs=1e-7)


def test_a_single_joint_is_equivalent_with_its_rotor_on_either_side():
    """With a fixed parent the armature and the link's inertia are equivalent."""
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


def test_a_walk_with_rotors_on_links_has_no_armature(tmp_path, root, robot):
    folder = small_bundle(tmp_path, root, robot)
    plain, moved = ground_model(folder), copy.copy(ground_model(folder))
    put_rotors_on_links(moved, 1.0)
    assert plain.dof_armature.max() > 0.0
    assert moved.dof_armature.max() == 0.0
