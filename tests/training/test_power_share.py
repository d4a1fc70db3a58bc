"""Power by what is usual at the command: all of the moment's, or of its average what is beyond a share of that."""

from __future__ import annotations

from types import SimpleNamespace

import pytest
import torch

from pipeline.learning.training_error import TrainingError
from pipeline.training import reward_terms as terms
from pipeline.training.bundle import read_bundle
from pipeline.training.environment import AmpEnvironment
from pipeline.training.power_excess import PowerExcess
from pipeline.training.presets import PRESETS, preset
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


COMMAND = (1.0, 0.0, 0.0)
USUAL_W = 182.0
FREE = 0.8


def _excess(env_count: int, **options: float) -> tuple[PowerExcess, SimpleNamespace]:
    """Of robots told COMMAND, whose motors give the torques of the second at 1 rad/s."""
    env = SimpleNamespace(
        num_envs=env_count,
        device="cpu",
        step_dt=0.02,
        command=torch.tensor([COMMAND]).repeat(env_count, 1),
        context=SimpleNamespace(options=SimpleNamespace(**({"power_free": FREE, "recovery_s": 0.0} | options))),
        readings=SimpleNamespace(torque=torch.zeros(env_count, 1), joint_vel=-torch.ones(env_count, 1)),
        coming_pushes=[SimpleNamespace(since_s=torch.full((env_count,), torch.inf))],
    )
    return PowerExcess(env), env


def _spend(excess: PowerExcess, env: SimpleNamespace, watts: float, seconds: float) -> None:
    env.readings.torque[:] = watts
    for _ in range(round(seconds / env.step_dt)):
        excess.advance()


def test_in_the_long_run_what_is_beyond_the_free_share_is_held_against_the_command():
    assert terms.usual_power(torch.tensor([COMMAND])).item() == pytest.approx(USUAL_W)
    for watts, share in ((0.0, 0.0), (FREE * USUAL_W, 0.0), (FREE * USUAL_W + 0.5 * (USUAL_W + terms.NOISE_W), 0.5)):
        excess, env = _excess(2)
        _spend(excess, env, watts, 5.0)
        assert excess.share.tolist() == pytest.approx([share] * 2, abs=1e-5)


def test_peaks_cost_nothing_where_the_mean_is_free():
    excess, env = _excess(1)
    for _ in range(20):
        _spend(excess, env, 2.0 * FREE * USUAL_W, 0.1)
        peak = excess.share.item()
        _spend(excess, env, 0.0, 0.1)
    assert 0.0 < peak < 0.1
    assert excess.share.item() == 0.0


def test_neither_a_new_command_nor_the_end_of_a_recovery_inherits_a_debt():
    excess, env = _excess(2, recovery_s=2.0)
    _spend(excess, env, FREE * USUAL_W, 3.0)
    env.command[0] = 0.0
    env.readings.torque[:] = 0.0
    excess.advance()
    assert excess.share[0].item() == 0.0, "it was told 1 m/s, and spent what that may"
    excess, env = _excess(2, recovery_s=2.0)
    (push,) = env.coming_pushes
    for step in range(100):
        push.since_s[0] = 0.02 * step
        _spend(excess, env, 1000.0, 0.02)
    push.since_s[0] = 2.0
    env.readings.torque[:] = 0.0
    excess.advance()
    caught, spent = excess.share.tolist()
    assert caught == 0.0
    assert spent > 1.0


def test_an_episode_begins_with_none():
    excess, env = _excess(3)
    _spend(excess, env, 1000.0, 1.0)
    before = excess.share.clone()
    excess.restart(torch.tensor([False, True, False]))
    assert excess.share.tolist() == pytest.approx([before[0].item(), 0.0, before[2].item()])
    assert before.min() > 1.0


def test_the_row_pays_what_is_averaged_of_a_running_environment(tmp_path, root, robot):
    options = preset("settled_steps").changed(power_free=0.01)
    env = AmpEnvironment(read_bundle(small_bundle(tmp_path, root, robot)), options, 3, "cpu", seed=2)
    env.reset()
    (row,) = (row for row in table(options) if row.name == "power_share")
    given = torch.Generator().manual_seed(3)
    for _ in range(6):
        env.step(0.3 * torch.randn(3, 21, generator=given))
    assert env.power_excess is not None
    assert torch.equal(row.value(env), env.power_excess.share)
    assert row.value(env).max() > 0.01
    assert (row.weight, row.ramp, row.spared) == (-20.0, "cost", True)
    assert "max(0" in row.equation


@pytest.mark.parametrize(
    ("changed", "told"),
    [
        ({"power_free": -0.1, "power_share": 1.0}, "0 or more"),
        ({"power_free": float("nan"), "power_share": 1.0}, "0 or more"),
        ({"power_free": 0.5}, "needs option 'power_share'"),
        ({"recovery_of": "steps"}, "needs 'recovery_s'"),
    ],
)
def test_options_that_would_do_nothing_or_harm_are_refused(changed: dict, told: str):
    with pytest.raises(TrainingError, match=told):
        preset("paper_flat").changed(**changed)
