"""The picture of the worst-tracked references shows what the robot did, up to its failure, below its reference."""

import dataclasses

import numpy as np
import pytest

from pipeline.batch import Entry, Judged, Manifest, Store
from pipeline.clips.robot_clip import RobotClip
from pipeline.robot import Robot
from pipeline.tracking.process import NOT_TRACKED
from pipeline.viewing import tracking_plots as module
from pipeline.viewing.contact_sheet import contact_sheet
from pipeline.viewing.playlist import Shown
from pipeline.viewing.tracking_plots import worst_tracked
from tests.factories.robot_clips import standing

FAILS_S = 2.0
"""When the rollout of `failing` fails [s]."""


def sinking(robot: Robot, name: str, seconds: float) -> RobotClip:
    """A robot that sinks by 10 cm a second, as no reference does."""
    clip = standing(robot, seconds, name=name)
    root = clip.root_pos_w.copy()
    root[:, 2] -= 0.1 * np.arange(clip.frame_count) / clip.fps
    return dataclasses.replace(clip, root_pos_w=root)


@pytest.fixture
def tracked(tmp_path, robot: Robot):
    """Rollouts, references and the store: `failing` fails at 2 s, `far` is furthest off at 3 s, `near` hardly."""
    store = Store(root=tmp_path)
    names = ("failing", "far", "far~mirror", "near")
    references = tuple(
        Entry(clip=name, blob=store.put_clip(standing(robot, 4.0, name=name)), numbers={"seconds": 4.0})
        for name in names
    )
    rollouts = tuple(
        Entry(
            clip=f"{name}~rollout",
            blob=store.put_clip(sinking(robot, name, 4.0)),
            numbers={"reference": name, "rollout": 0, "survived": True},
        )
        for name in names[1:]
    )
    reason = {"code": NOT_TRACKED, "effect": "rejected", "text": "it falls", "start_s": 0.0, "stop_s": FAILS_S}
    judged = tuple(
        Judged(
            clip=name,
            pieces=(),
            reasons=(reason,) if name == "failing" else (),
            numbers={"survived": name != "failing", "worst_body_error_m": error, "worst_at_s": 3.0},
        )
        for name, error in zip(names, (0.05, 0.2, 0.3, 0.01), strict=True)
    )
    return (
        Manifest(stage="augmented_motions", entries=rollouts, judged=judged),
        Manifest(stage="reference_motions", entries=references, judged=()),
        store,
    )


def strips_of(tracked, robot: Robot, monkeypatch, most: int = 5) -> tuple[list[Shown], list[str], bytes]:
    """What is drawn, which references were rolled out again, and the picture."""
    rollouts, references, store = tracked
    strips: list[Shown] = []
    asked: list[str] = []

    def listed(drawn, robot) -> bytes:
        strips.extend(drawn)
        return contact_sheet(drawn, robot)

    def to_failure(entries) -> Manifest:
        asked.extend(entry.clip for entry in entries)
        motion = sinking(robot, "failing", FAILS_S + 0.02)
        made = tuple(dataclasses.replace(entry, blob=store.put_clip(motion)) for entry in entries)
        return Manifest(stage="motion to failure", entries=made, judged=())

    monkeypatch.setattr(module, "contact_sheet", listed)
    return strips, asked, worst_tracked(rollouts, references, to_failure, store, robot, most)


def test_the_robot_is_shown_up_to_the_frame_at_which_it_fails(tracked, robot: Robot, monkeypatch):
    strips, asked, picture = strips_of(tracked, robot, monkeypatch)
    strip = strips[0]
    assert (strip.name, strip.note) == ("failing from 1.00 to 2.00 s", "it falls")
    assert strip.robot_clip is not None and strip.reference is not None
    assert strip.robot_clip.frame_count == strip.reference.frame_count == 51
    sunk = strip.reference.root_pos_w[:, 2] - strip.robot_clip.root_pos_w[:, 2]
    assert sunk[[0, -1]] == pytest.approx([0.1, 0.2]), "the robot's own motion, frame for frame"
    assert asked == ["failing"], "those that were followed to their end are in the store"
    assert picture.startswith(b"\x89PNG")


def test_others_are_shown_where_they_are_furthest_off_one_of_each_family(tracked, robot: Robot, monkeypatch):
    strips, _, _ = strips_of(tracked, robot, monkeypatch)
    assert [strip.name.split()[0] for strip in strips] == ["failing", "far~mirror", "near"]
    strip = strips[1]
    assert "from 2.00 to 3.98 s" in strip.name and strip.note.startswith("largest error at 3.00 s: 30.0 cm")
    assert strip.robot_clip is not None and strip.robot_clip.root_pos_w[50, 2] < strip.robot_clip.root_pos_w[0, 2]


def test_at_most_as_many_as_asked_for(tracked, robot: Robot, monkeypatch):
    strips, _, _ = strips_of(tracked, robot, monkeypatch, most=1)
    assert len(strips) == 1
