"""What a teacher that walks another speed than it is told is told: on the lines between the pairs, and beyond them."""

from __future__ import annotations

import pytest
import torch

from pipeline.training.training_error import TrainingError
from pipeline.training.walked_speeds import WalkedSpeeds


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


@pytest.mark.parametrize("text", ["", "1", "a:1", "1:1:1", "1:1,"])
def test_what_is_no_pairs_is_refused(text):
    with pytest.raises(TrainingError, match="it must look like"):
        WalkedSpeeds(text)


@pytest.mark.parametrize("text", ["1:1,.5:2", "1:1,2:1", "0:.1", "1:nan", "1:inf", "-1:1"])
def test_pairs_that_do_not_grow_are_refused(text):
    with pytest.raises(TrainingError, match="must grow from pair to pair"):
        WalkedSpeeds(text)
