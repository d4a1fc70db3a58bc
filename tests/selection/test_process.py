"""The stage for one clip."""

import numpy as np
import pytest

from pipeline.files import settings as settings_file
from pipeline.selection import Curation, process
from tests.conftest import ROOT
from tests.factories.gliding import gliding_person

CURATION = settings_file.read(ROOT / "data" / "curation.yaml", Curation)


def test_pieces_are_windows_that_keep_the_whole_clip():
    clip = gliding_person([(2.0, 0.0, 0.0, 0.0), (3.0, 1.0, 0.0, 0.0)], name="test/start")
    outcome = process(clip, {}, settings=CURATION)
    assert [piece.numbers["skill"] for piece in outcome.pieces] == ["stand", "walk"]
    for piece in outcome.pieces:
        first, stop = piece.numbers["start_frame"], piece.numbers["stop_frame"]
        assert piece.clip.name == f"test/start@{first}-{stop - 1}"
        assert piece.numbers["seconds"] == pytest.approx((stop - first) / 60.0)
        np.testing.assert_array_equal(piece.clip.body_pos_w, clip.body_pos_w)
    assert sum(piece.numbers["seconds"] for piece in outcome.pieces) == pytest.approx(clip.duration_s)
    assert outcome.numbers["seconds_stand"] + outcome.numbers["seconds_walk"] == pytest.approx(clip.duration_s)


def test_the_input_is_not_written_to_and_the_answer_repeats():
    clip = gliding_person([(2.0, 0.0, 0.5, 0.0), (2.0, 1.0, 0.0, 1.0)])
    before = clip.body_pos_w.copy()
    first, second = (process(clip, {}, settings=CURATION) for _ in range(2))
    np.testing.assert_array_equal(clip.body_pos_w, before)
    assert [dict(piece.numbers) for piece in first.pieces] == [dict(piece.numbers) for piece in second.pieces]
