"""Power by what is usual at the command: all of the moment's, or of its average what is beyond a share of that."""

from __future__ import annotations

from types import SimpleNamespace

import pytest
import torch

from pipeline.training import reward_terms as terms
from pipeline.training.bundle import read_bundle
from pipeline.training.environment import AmpEnvironment
from pipeline.training.presets import PRESETS, preset
from pipeline.training.readings import MEAN_TIME_S
from pipeline.training.reward_table import table
from tests.factories.training_bundle import small_bundle

MEASURED_W = {
    (0.6, 0, 0): (110.2,),
    (-0.6, 0, 0): (105.6,),
    (1.0, 0, 0): (192.9,),
    (1.5, 0, 0): (256.4,),
    (2.0, 0, 0): (371.3,),
    (0, 0.6, 0): (85.62, 71.06),
    (0, 0, 1.0): (48.16, 76.94),
    (0, 0, 1.5): (68.83, 96.75),
    (0.6, 0, 0.8): (118.4, 125.9),
    (1.0, 0, 0.5): (204.3, 204.4),
}
"""t1_walk, to the left and to the right, as the bars of `data/validation.yaml` have it: all commands it walks."""


def test_the_usual_power_is_near_what_was_measured_on_both_sides():
    usual = terms.usual_power(torch.tensor(list(MEASURED_W)))
    assert usual.tolist() == pytest.approx([sum(sides) / len(sides) for sides in MEASURED_W.values()], rel=0.2)
    assert torch.equal(terms.usual_power(-torch.tensor(list(MEASURED_W))), usual)


def test_power_is_held_against_the_command():
    (row,) = (row for row in table(PRESETS["paper_flat"][1].changed(power_share=1.5)) if row.name == "power_share")
    command = torch.tensor([[1.0, 0.0, 0.0], [0.0, 0.0, 0.0]])
    readings = SimpleNamespace(torque=torch.tensor([[116.0], [85.0]]), joint_vel=torch.tensor([[-2.0], [1.0]]))
    assert row.value(SimpleNamespace(command=command, readings=readings)).tolist() == pytest.approx([1.0, 1.0])
    assert row.weight == -1.5


def test_of_the_averaged_power_what_is_beyond_the_free_share_is_held_against_the_command():
    options = PRESETS["paper_flat"][1].changed(power_share=1.5, power_free=0.8)
    (row,) = (row for row in table(options) if row.name == "power_share")
    command = torch.tensor([[1.0, 0.0, 0.0]]).repeat(3, 1)
    usual_w = 182.0
    mean_power = torch.tensor([0.5 * usual_w, 0.8 * usual_w, 0.8 * usual_w + 0.5 * (usual_w + terms.NOISE_W)])
    readings = SimpleNamespace(mean_power=mean_power)
    assert terms.usual_power(command)[0].item() == pytest.approx(usual_w)
    value = row.value(SimpleNamespace(command=command, readings=readings))
    assert value.tolist() == pytest.approx([0.0, 0.0, 0.5], abs=1e-6)
    assert (row.weight, row.ramp) == (-1.5, "cost")


def test_power_is_averaged_over_the_last_moments_of_an_episode(tmp_path, root, robot):
    env = AmpEnvironment(read_bundle(small_bundle(tmp_path, root, robot)), preset("caught_steps"), 3, "cpu", seed=2)
    env.reset()
    read, kept = env.readings, 1.0 - env.step_dt / MEAN_TIME_S
    moments, advance = [], read.advance

    def seen() -> None:
        advance()
        moments.append((read.torque * read.joint_vel).abs().sum(dim=1))

    read.advance = seen
    given = torch.Generator().manual_seed(3)
    for step in range(6):
        env.step(0.3 * torch.randn(3, 21, generator=given))
        shares = torch.tensor([kept ** (step - at) for at in range(step + 1)])
        expected = (1.0 - kept) * (shares[:, None] * torch.stack(moments)).sum(dim=0)
        lives = env.episode_length_buf == step + 1
        assert lives.any()
        assert read.mean_power[lives].tolist() == pytest.approx(expected[lives].tolist(), rel=1e-4)
    assert expected.min() > 1.0
