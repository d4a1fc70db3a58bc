"""Motions as lines: the browser's form holds the figure to a millimetre, and thumbnails are made once."""

import json
import struct
import threading
import time

import numpy as np
import pytest

from pipeline.batch import ClipPool, Store
from pipeline.curation_page.clip_table import read_table
from pipeline.curation_page.line_figure import MISSING, STEP_M, encode, lines_w
from pipeline.curation_page.motion_sources import MotionSources
from pipeline.curation_page.thumbnail_process import ThumbnailProcess
from pipeline.curation_page.thumbnails import ThumbnailStore
from pipeline.viewing.human_figure import human_figure
from pipeline.viewing.robot_figure import robot_figure
from tests.factories import curated_project as made
from tests.factories import human_clips, robot_clips


def decoded(data: bytes) -> list[tuple[dict, np.ndarray]]:
    """What the browser reads."""
    (length,) = struct.unpack_from("<I", data)
    head, offset, found = json.loads(data[4 : 4 + length]), 4 + length, []
    for figure in head["figures"]:
        shape = (figure["frames"], figure["lines"], 2, 3)
        found.append((figure, np.frombuffer(data, "<i2", int(np.prod(shape)), offset).reshape(shape)))
        offset += 2 * int(np.prod(shape))
    assert offset == len(data)
    return found


def test_lines_of_a_person_run_from_joint_to_joint():
    clip = human_clips.walker(seconds=2.0)
    figure = human_figure(clip)
    ((head, steps),) = decoded(encode([figure]))
    shank = [part.name for part in figure.parts].index("left_knee-left_ankle")
    ends = steps[:, shank] * STEP_M
    origin = clip.pos("pelvis")[0] * np.array([1.0, 1.0, 0.0])
    np.testing.assert_allclose(ends[:, 0], clip.pos("left_knee") - origin, atol=2e-3)
    np.testing.assert_allclose(ends[:, 1], clip.pos("left_ankle") - origin, atol=2e-3)
    assert head["fps"] == clip.fps and head["frames"] == clip.frame_count


def test_lines_of_a_robot_are_inside_its_shapes(robot):
    figure = robot_figure(robot_clips.wandering(robot), robot)
    lines = lines_w(figure, np.array([0, 40]))
    positions, _ = figure.shape_poses(40)
    np.testing.assert_allclose(lines[1].mean(axis=1), positions, atol=1e-9)


def test_missing_parts_are_marked_and_the_rest_is_drawn():
    clip = human_clips.standing(seconds=1.0)
    clip.body_pos_w[10:20, 7] = np.nan
    ((_, steps),) = decoded(encode([human_figure(clip)]))
    gone = (steps == MISSING).all(axis=(2, 3))
    assert gone[10:20].any(axis=1).all() and not gone[:10].any()
    assert not gone[15].all()


def test_contacts_are_stretches_in_seconds(robot):
    clip = robot_clips.standing(robot, seconds=2.0)
    clip.contacts[50:, 1] = False
    ((head, _),) = decoded(encode([robot_figure(clip, robot)]))
    assert head["contacts"] == [[[0.0, 2.0]], [[0.0, 1.0]]]


@pytest.fixture
def thumbnails(root, robot, tmp_path):
    folder = made.curated_project(root, tmp_path / "project", robot)
    store = Store(root=folder / "data/store")
    pool = ClipPool(backend="sequential")
    return ThumbnailStore(store=store, robot_folder=folder / "robots/t1", robot_digest=robot.digest, pool=pool)


def test_thumbnails_are_made_once_and_named_by_what_they_show(thumbnails):
    table = read_table(thumbnails.store, "t1")
    sources = [MotionSources(table).of(row) for row in table.rows]
    wanted = {thumbnails.key(source): source for source in sources}
    assert list(thumbnails.make_missing(wanted, threading.Event()))[-1] == len(wanted)
    stamps = {key: thumbnails.path(key).stat().st_mtime_ns for key in wanted}
    assert list(thumbnails.make_missing(wanted, threading.Event())) == [len(wanted)]
    assert {key: thumbnails.path(key).stat().st_mtime_ns for key in wanted} == stamps
    kept = MotionSources(table).of(table.row(made.KEPT))
    figures = decoded(thumbnails.make(kept))
    assert [head["name"] for head, _ in figures] == ["human", "t1"]
    assert all(head["frames"] / head["fps"] <= 2.3 for head, _ in figures)


def test_a_clip_whose_blob_is_gone_has_an_empty_thumbnail(thumbnails):
    table = read_table(thumbnails.store, "t1")
    source = MotionSources(table).of(table.row(made.NOT_TAKEN))
    thumbnails.store.own_blobs.path(source.human.blob).unlink()
    assert thumbnails.make(source) == b""


def test_the_process_beside_the_server_makes_them_all_and_ends_with_it(root, robot, tmp_path):
    folder = made.curated_project(root, tmp_path / "project", robot)
    process = ThumbnailProcess(folder, "t1")
    stop = time.monotonic() + 120.0
    while time.monotonic() < stop and not (process.total and process.made == process.total):
        time.sleep(0.2)
    process.stop()
    assert process.made == process.total == len(read_table(Store(root=folder / "data/store"), "t1").rows)
    assert len(list((folder / "data/store/thumbnails").rglob("*.bin"))) == process.made
    process._process.wait(30.0)


def test_the_process_ends_at_once_when_the_server_does(root, robot, tmp_path):
    folder = made.curated_project(root, tmp_path / "project", robot)
    process = ThumbnailProcess(folder, "t1")
    process.stop()
    process._process.wait(30.0)
