"""Mirrored samples in PPO: an update begins at a ratio of 1 for originals and mirror images, however asymmetric the
policy, and stays finite. The bound of the deviation decreases at the end of a run."""

from __future__ import annotations

from typing import Any

import pytest
import torch

from pipeline.training.amp.symmetry import MirroredSamples
from pipeline.training.bundle import read_bundle
from pipeline.training.config import RECIPE
from pipeline.training.runner import FROZEN, AmpStage
from pipeline.training.stage import Request
from tests.factories.training_bundle import small_bundle


def amp_stage(tmp_path, root, robot, options: dict[str, Any] | None = None) -> AmpStage:
    """A stage of four environments whose normalizer is fixed; otherwise it moves between steps, and ratios with it.

    The deviation is so large that no mirror image of a random network's action is dropped as improbable.
    """
    bundle = read_bundle(small_bundle(tmp_path, root, robot))
    config = RECIPE.changed({"simulation.num_envs": 4, "ppo.init_std": 0.5, **(options or {})})
    request = Request(out=tmp_path, preset="recipe", config=config, device="cpu", seed=1, physics="plain")
    stage = AmpStage(bundle, request, tmp_path / "amp")
    stage.algorithm.get_policy().obs_normalizer.count.fill_(FROZEN)
    return stage


def test_ratios_are_1_before_the_update(tmp_path, root, robot, monkeypatch):
    stage = amp_stage(tmp_path, root, robot)
    actor, found = stage.algorithm.get_policy(), []
    append = MirroredSamples.augment_batch

    def append_and_compare(self: Any, batch: Any, count: int) -> None:
        originals = batch.old_actions_log_prob[:, 0]
        append(self, batch, count)
        if not found:  # the first mini-batch, before any step
            with torch.no_grad():
                actor(batch.observations, stochastic_output=True)
            found.append((actor.get_output_log_prob(batch.actions), batch.old_actions_log_prob[:, 0], originals))

    monkeypatch.setattr(MirroredSamples, "augment_batch", append_and_compare)
    stage.iterate(0.5)
    ((now, old, originals),) = found
    count = len(originals)
    torch.testing.assert_close(now, old, rtol=0.0, atol=1e-3)
    assert torch.equal(old[:count], originals)
    assert (old[count:] - originals).abs().max() > 0.1, "a network drawn at random is not symmetric"
    assert stage.algorithm.storage.actions_log_prob.shape[-1] == 1, "the storage is as rsl_rl made it"


def test_an_update_of_a_very_asymmetric_policy_is_finite(tmp_path, root, robot):
    """Its mirror images are so improbable that e^(new - old) overflows after the first steps of the optimizer."""
    stage = amp_stage(tmp_path, root, robot)
    actor = stage.algorithm.get_policy()
    with torch.no_grad():
        list(actor.mlp.parameters())[-1][0] += 30.0  # one joint of one side
    stage.iterate(0.5)
    before = [parameter.clone() for parameter in actor.parameters()]
    stage.iterate(0.5)
    assert all(parameter.isfinite().all() for parameter in actor.parameters())
    assert any((old != new).any() for old, new in zip(before, actor.parameters(), strict=True)), "originals still count"


def test_the_action_std_decreases_at_the_end_of_a_run(tmp_path, root, robot):
    stage, found = amp_stage(tmp_path, root, robot), []
    for share in (0.6, 0.75, 0.9):
        stage.iterate(share)
        found.append(float(stage.algorithm.get_policy().distribution.std_param.detach().max()))
    assert 0.45 < found[0] <= 0.5
    assert found[1:] == pytest.approx([0.3325, 0.165], abs=0.01)


def test_updates_change_the_policy_less_at_the_end_of_a_run(tmp_path, root, robot):
    """The divergence that the learning rate adapts to goes from its first to its last value in the final ramp."""
    options = {"ppo.desired_kl": 0.02, "ppo.final_kl": 0.004, "schedule.final_ramp": (0.6, 1.0)}
    stage, found = amp_stage(tmp_path, root, robot, options), []
    for share in (0.3, 0.6, 0.8, 1.0):
        stage.iterate(share)
        found.append(stage.algorithm.desired_kl)
    assert found == pytest.approx([0.02, 0.02, 0.012, 0.004])


def test_a_resumed_run_continues_the_discriminators_optimizer(tmp_path, root, robot):
    stage = amp_stage(tmp_path, root, robot)
    discriminator = stage.algorithm.discriminator
    assert discriminator is not None
    windows = torch.zeros(64, *discriminator._expert.shape[1:])
    discriminator.replay.insert(windows, torch.ones(64, dtype=torch.bool))
    discriminator.update()
    fresh = amp_stage(tmp_path, root, robot).algorithm
    fresh.load(stage.state(), None, strict=True)
    assert fresh.discriminator is not None
    before, after = (each.optimizer.state_dict()["state"] for each in (discriminator, fresh.discriminator))
    assert before.keys() == after.keys() and len(before) > 0
    for number, moments in before.items():
        assert moments["exp_avg_sq"].abs().max() > 0.0
        assert all(torch.equal(value, after[number][name]) for name, value in moments.items())
