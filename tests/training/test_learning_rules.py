"""What the networks learn from: the blend of rewards, mirrored labels, and the discriminator's penalty."""

from pathlib import Path

import pytest
import torch
from rsl_rl.algorithms import PPO
from tensordict import TensorDict

from pipeline.robot import Robot
from pipeline.training.amp import discriminator as amp
from pipeline.training.amp.discriminator import Discriminator
from pipeline.training.amp.features import floors
from pipeline.training.bundle import read_bundle
from pipeline.training.config import RECIPE
from pipeline.training.distillation.run import DistillationStage
from pipeline.training.stage import Request
from tests.factories.training_bundle import small_bundle
from tests.training.test_mirrored_samples import amp_stage


def test_the_reward_is_half_task_half_style_and_invalid_windows_get_the_mean(
    tmp_path: Path, root: Path, robot: Robot, monkeypatch: pytest.MonkeyPatch
):
    algorithm, given = amp_stage(tmp_path, root, robot).algorithm, []
    algorithm.progress = 1.0
    monkeypatch.setattr(PPO, "process_env_step", lambda self, obs, rewards, *_: given.append(rewards))
    monkeypatch.setattr(algorithm.discriminator, "score", lambda motion: torch.tensor([0.0, 1.0, 50.0, -50.0]))
    motion, none = torch.zeros(4, *algorithm.discriminator._expert.shape[1:]), torch.zeros(4, dtype=torch.bool)
    for valid in [none] * 20 + [torch.tensor([True, True, False, False])]:
        assert algorithm.discriminator.replay.count == 0, "no window was read before"
        seen = {"motion": motion, "motion_valid": valid}
        algorithm.process_env_step(TensorDict({}, batch_size=[4]), torch.full((4,), 2.0), torch.zeros(4), seen)
    style = 0.5 * torch.sigmoid(torch.tensor([0.0, 1.0]))
    torch.testing.assert_close(given[-1], 0.5 * 2.0 + 0.5 * torch.cat([style, style.mean().repeat(2)]))
    algorithm.progress = 0.04
    assert algorithm.style_share() == pytest.approx(0.25), "half of its ramp from 2 % to 6 % of the run"


def test_a_symmetric_student_has_no_loss_on_mirrored_labels(tmp_path: Path, root: Path, robot: Robot):
    """It answers with the newest joint positions, of which the labels are a copy."""
    bundle = read_bundle(small_bundle(tmp_path, root, robot, tracker="passive"))
    config = RECIPE.changed({"simulation.num_envs": 4})
    request = Request(out=tmp_path, preset="recipe", config=config, device="cpu", seed=1, physics="plain")
    stage = DistillationStage(bundle, request, tmp_path / "distillation")
    observation = torch.randn(500, 720).half().float()
    newest_joints = slice(-63, -42)
    stage._memory.add(observation, observation[:, newest_joints])
    unused = next(stage.student.mlp.parameters())
    stage._student_action = lambda seen: seen[:, newest_joints] + 0.0 * unused.sum()
    assert stage._fit_labels() == pytest.approx(0.0, abs=1e-6)


def test_the_gradient_penalty_flattens_the_score_at_the_experts_windows(monkeypatch: pytest.MonkeyPatch):
    windows, found = [], []
    norm = amp.gradient_norm
    monkeypatch.setattr(amp, "gradient_norm", lambda score, at: windows.append(at) or norm(score, at))
    for weight in (0.0, 500.0):
        torch.manual_seed(0)
        options = {"gradient_penalty": weight, "learning_rate": 1e-3, "largest_difference": 1000.0}
        config = RECIPE.changed({f"discriminator.{name}": value for name, value in options.items()}).discriminator
        one = Discriminator(torch.randn(300, 4, 60) + 2.0, floors(21), config, 8, "cpu")
        one.replay.insert(torch.randn(300, 4, 60) - 2.0, torch.ones(300, dtype=torch.bool))
        for _ in range(30):
            one.update()
        found.append(one.figures["gradient_penalty"])
    assert found[1] < 0.1 * found[0]
    assert all(at.mean() > -1.0 for at in windows), "the policy's windows are around -2"
