"""Which clips are in the picture of the worst."""

import dataclasses
import io

import pytest
from PIL import Image

from pipeline.batch import Entry, Judged, Manifest, Store
from pipeline.viewing import contact_sheet as module
from tests.factories.figures import standing_robot

LOST_S = {"a": 0.5, "b": 3.0, "b~mirror": 3.5, "c": 0.0, "d": 2.0}


@pytest.fixture
def stages(tmp_path, robot):
    store = Store(root=tmp_path)
    clip = standing_robot(robot, frame_count=11)
    entries = tuple(
        Entry(clip=name, blob=store.put_clip(dataclasses.replace(clip, name=name)), numbers={}) for name in LOST_S
    )
    judged = tuple(
        Judged(
            clip=name,
            pieces=(),
            reasons=({"code": "torque", "text": f"too heavy for {name}", "effect": "rejected"},),
            numbers={"seconds_in": 5.0, "seconds_out": 5.0 - lost_s},
        )
        for name, lost_s in LOST_S.items()
    )
    return Manifest(stage="kp5", entries=(), judged=judged), Manifest(stage="kp4", entries=entries, judged=()), store


def test_the_worst_come_first_one_of_each_family_with_its_reason(stages, robot, monkeypatch):
    titles = []

    def listed(strips, robot) -> bytes:
        titles.extend((strip.name, strip.note) for strip in strips)
        return b""

    monkeypatch.setattr(module, "contact_sheet", listed)
    module.worst_clips(*stages, robot, most=2)
    assert titles == [("b~mirror", "too heavy for b~mirror"), ("d", "too heavy for d")]


def test_it_is_a_picture_also_when_nothing_was_lost(stages, robot):
    stage, previous, store = stages
    assert Image.open(io.BytesIO(module.worst_clips(stage, previous, store, robot))).width > 500
    nothing = dataclasses.replace(stage, judged=())
    assert Image.open(io.BytesIO(module.worst_clips(nothing, previous, store, robot))).width > 500
