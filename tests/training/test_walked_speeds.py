"""What a teacher that walks another speed than it is told is told: on the lines between the pairs, and beyond them."""

from __future__ import annotations

import pytest
import torch

from pipeline.learning.training_error import TrainingError
from pipeline.training.walked_speeds import GAIN, MOST, WalkedSpeeds, corrected


def test_pairs_are_met_and_lines_lie_between_them():
    speeds = WalkedSpeeds(".6:.7,1.0:1.1,1.5:1.6")
    asked = {0.7: 0.6, 1.1: 1.0, 1.6: 1.5, 0.35: 0.3, 0.9: 0.8, 1.35: 1.25}
    assert speeds.told_for(torch.tensor(list(asked))).tolist() == pytest.approx(list(asked.values()))


def test_beyond_the_last_pair_the_share_stays_and_backwards_nothing_changes():
    told = WalkedSpeeds("1.0:1.25").told_for(torch.tensor([2.5, 1.25, 0.0, -0.4]))
    assert told.tolist() == pytest.approx([2.0, 1.0, 0.0, -0.4])


def test_who_walks_as_told_is_told_the_same():
    speed = torch.linspace(-0.5, 2.5, 31)
    torch.testing.assert_close(WalkedSpeeds(".3:.3,1:1").told_for(speed), speed)


def test_what_the_velocity_lacks_is_told_on_top_but_not_beyond_what_teachers_know():
    seen = torch.arange(3.0 * 720).reshape(3, 720)
    for frame in range(10):
        seen[:2, 72 * frame + 6 : 72 * frame + 9] = torch.tensor([0.6, 0.0, 0.1])
        seen[2, 72 * frame + 6 : 72 * frame + 9] = 0.0
    seen[1, 6:9] = 0.0  # before an episode nothing was told
    error = torch.tensor([[-0.1, 0.05, 0.1], [2.0, -2.0, -2.0], [0.3, 0.0, 0.0]])
    told, others = corrected(seen, error), torch.ones(10, 72, dtype=torch.bool)
    others[:, 6:9] = False
    assert torch.equal(told[:, others.flatten()], seen[:, others.flatten()])
    command = told.unflatten(1, (10, 72))[:, :, 6:9]
    assert command[0].tolist() == [pytest.approx([0.6 - 0.1 * GAIN, 0.05 * GAIN, 0.1 + 0.1 * GAIN])] * 10
    assert command[1, 1:].tolist() == [pytest.approx([0.6 + MOST[0], -MOST[1], 0.1 - MOST[2]])] * 9
    assert (command[1, 0] == 0.0).all() and (command[2] == 0.0).all()


@pytest.mark.parametrize("text", ["", "1", "a:1", "1:1:1", "1:1,"])
def test_what_is_no_pairs_is_refused(text):
    with pytest.raises(TrainingError, match="it must look like"):
        WalkedSpeeds(text)


@pytest.mark.parametrize("text", ["1:1,.5:2", "1:1,2:1", "0:.1", "1:nan", "1:inf", "-1:1"])
def test_pairs_that_do_not_grow_are_refused(text):
    with pytest.raises(TrainingError, match="must grow from pair to pair"):
        WalkedSpeeds(text)
