"""What is alike for all windows of one clip is worked out once, and nobody can tell from the answers."""

import dataclasses
import logging
from functools import partial

import numpy as np
import pytest

from pipeline.batch import ClipPool, Entry, Manifest, Stage, Store, run_stage
from pipeline.clips.outcome import Outcome, Piece
from pipeline.errors import ClipError
from tests.factories.clips import robot_clip

LOG = logging.getLogger("test")
HERE = ClipPool(backend="sequential")
WINDOWS = {"long": 3, "short": 2}
"""Clip -> its windows."""


def mean_height(clip, *, seen=None):
    """What the windows share."""
    if seen is not None:
        seen.append(clip.name)
    if clip.root_pos_w[0, 2] < 0.0:
        raise ClipError(clip.name, "below", "is below the ground.")
    return float(clip.root_pos_w[:, 2].mean())


def cut(clip, numbers, prepared=None):
    """The window of a clip, set down by what its clip is high on average."""
    height = mean_height(clip) if prepared is None else prepared
    lowered = dataclasses.replace(clip, root_pos_w=clip.root_pos_w - [0.0, 0.0, height])
    piece = dataclasses.replace(lowered, name=f"{clip.name}!")
    return Outcome(pieces=(Piece(clip=piece, numbers={"height": height, "from": numbers["first"]}),))


def windows(store: Store, lift: float = 0.0) -> Manifest:
    entries = []
    for rank, (name, count) in enumerate(WINDOWS.items()):
        up = np.array([0.0, 0.0, rank + lift])
        clip = robot_clip(frames=6 + rank, name=name)
        blob = store.put_clip(dataclasses.replace(clip, root_pos_w=clip.root_pos_w + up))
        numbers = {"seconds": 0.1}
        entries += [
            Entry(clip=f"{name}@{first}-{first + 1}", blob=blob, numbers={**numbers, "first": first})
            for first in range(count)
        ]
    return Manifest(stage="before", entries=tuple(entries), judged=())


def stage(prepare=mean_height) -> Stage:
    return Stage(name="cut", version="1", function=cut, prepare=prepare)


def test_a_clip_of_several_windows_is_prepared_once(tmp_path):
    store, seen = Store(root=tmp_path), []
    found = run_stage(stage(partial(mean_height, seen=seen)), windows(store), store, HERE, LOG)
    assert seen == ["long@0-1", "short@0-1"]
    assert found.recomputed == len(found.entries) == sum(WINDOWS.values())
    run_stage(stage(partial(mean_height, seen=seen)), windows(store), store, HERE, LOG)
    assert len(seen) == len(WINDOWS)


@pytest.mark.parametrize("pool", [HERE, ClipPool(workers=2)], ids=["here", "processes"])
def test_the_answers_are_those_of_a_stage_that_prepares_each_window(tmp_path, pool):
    together, each = Store(root=tmp_path / "together"), Store(root=tmp_path / "each")
    found = run_stage(stage(), windows(together), together, pool, LOG)
    assert found.to_text() == run_stage(stage(None), windows(each), each, HERE, LOG).to_text()
    heights = [entry.numbers["height"] for entry in found.entries]
    assert heights == pytest.approx([0.7] * WINDOWS["long"] + [1.7] * WINDOWS["short"])
    assert [entry.numbers["from"] for entry in found.entries] == [0, 1, 2, 0, 1]


def test_one_window_that_is_new_is_worked_on_alone(tmp_path):
    store, seen = Store(root=tmp_path), []
    before = windows(store)
    run_stage(stage(), dataclasses.replace(before, entries=before.entries[1:]), store, HERE, LOG)
    assert run_stage(stage(partial(mean_height, seen=seen)), before, store, HERE, LOG).recomputed == 1
    assert seen == ["long@0-1"]


def test_windows_of_a_clip_that_cannot_be_prepared_are_rejected_each_by_its_name(tmp_path):
    store = Store(root=tmp_path)
    found = run_stage(stage(), windows(store, lift=-1.0), store, HERE, LOG)
    assert [row.fate for row in found.judged] == ["rejected"] * WINDOWS["long"] + ["accepted"] * WINDOWS["short"]
    assert [row.reasons[0]["text"] for row in found.judged[:2]] == [
        "clip 'long@0-1': is below the ground.",
        "clip 'long@1-2': is below the ground.",
    ]


def passed_on(clip, numbers, prepared=None):
    """The clip as it is, twice, and a copy of it that is lifted by the number of its window."""
    lifted = clip.root_pos_w + np.array([0.0, 0.0, numbers["first"]])
    clips = [dataclasses.replace(clip, name=f"{clip.name}+{index}") for index in range(2)]
    clips.append(dataclasses.replace(clip, name=f"{clip.name}+2", root_pos_w=lifted))
    return Outcome(pieces=tuple(Piece(clip=each) for each in clips))


def test_a_motion_passed_as_it_is_keeps_the_blob_that_encoding_gives(tmp_path, monkeypatch):
    store, before = Store(root=tmp_path), windows(Store(root=tmp_path))
    expected = [
        store.put_clip(piece.clip)
        for entry in before.entries
        for piece in passed_on(store.get_clip(entry.blob, entry.clip), entry.numbers).pieces
    ]
    calls = []
    for name in ("put_clip", "get_clip"):
        own = getattr(Store, name)
        monkeypatch.setattr(Store, name, lambda *given, own=own, name=name: calls.append(name) or own(*given))
    passing = Stage(name="pass", version="1", function=passed_on, prepare=mean_height)
    found = run_stage(passing, before, store, HERE, LOG)
    assert [entry.blob for entry in found.entries] == expected
    assert calls.count("get_clip") == len(WINDOWS)  # once for all windows of a clip
    assert calls.count("put_clip") == sum(WINDOWS.values())  # of three pieces only the lifted one
