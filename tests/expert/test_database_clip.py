"""One clip file of a database, which may come from others: read as it was written, or refused in one sentence."""

import json
import os
import resource
import subprocess
import sys

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from pipeline.cli.stored_clips import clip_of
from pipeline.errors import FileError
from pipeline.expert import DatabaseSettings, ExpertEntry, write_database
from pipeline.expert.database_clip import read_database_clip
from pipeline.expert.index import read_table
from pipeline.files.csv_json import MAX_JSON_BYTES
from tests.factories.robot_clips import wandering


@pytest.fixture(scope="module")
def written(robot, tmp_path_factory):
    """A clip and its file in a database."""
    clip = wandering(robot).cut(0, 60, "source/clip")
    folder = tmp_path_factory.mktemp("database") / "t1"
    entry = ExpertEntry(clip=clip, weight=1.0, skill="walk", licence="CC0-1.0", numbers={})
    write_database(folder, [entry], robot, stages={}, settings=DatabaseSettings(max_lost_share=0.9, kept_versions=1))
    (path,) = folder.glob("source*.json")
    return clip, path


def test_a_clip_comes_back_as_it_was_written(written, robot):
    clip, path = written
    found, facts = read_database_clip(path, robot)
    assert (found.name, found.fps, facts["Licence"]) == ("source/clip", pytest.approx(clip.fps), "CC0-1.0")
    assert np.allclose(found.root_pos_w, clip.root_pos_w, atol=1e-6)


def row(**values):
    """Numbers of frame 3 replaced."""

    def change(content):
        for at, value in values.items():
            content["Frames"][3][int(at[1:])] = value

    return change


@pytest.mark.parametrize(
    ("change", "says"),
    [
        (lambda content: content.update(FrameDuration=-0.02), "its rate -50 Hz; wanted are"),
        (lambda content: content.update(FrameDuration=1e-300), r"its rate 1e\+300 Hz"),
        (lambda content: content.update(FrameDuration=0), "ZeroDivisionError"),
        (lambda content: content.update(FrameDuration=[1]), "not a clip of an expert database"),
        (lambda content: content.update(Clip=[1]), r"its name is \[1\]"),
        (lambda content: content.update(Columns=5), "not a clip of an expert database"),
        (row(_5=float("nan")), "NaN is not a JSON number"),
        (row(_2=1e999), "Infinity is not a JSON number"),
        (row(_3=0.0, _4=0.0, _5=0.0, _6=0.0), "frame 3: a quaternion's length is off by 1"),
    ],
)
def test_a_clip_that_can_not_be_one_is_refused(written, robot, tmp_path, change, says):
    content = json.loads(written[1].read_text())
    change(content)
    (tmp_path / "clip.json").write_text(json.dumps(content))
    with pytest.raises(FileError, match=rf"clip\.json: .*{says}"):
        read_database_clip(tmp_path / "clip.json", robot)


def test_a_file_that_is_too_deep_or_too_large_is_refused(robot, tmp_path):
    path = tmp_path / "clip.json"
    path.write_text("[" * 100_000 + "]" * 100_000)
    for read in (lambda: read_database_clip(path, robot), lambda: clip_of(path)):
        with pytest.raises(FileError, match=r"clip\.json: not .*recursion"):
            read()
    os.truncate(path, MAX_JSON_BYTES + 1)
    for read in (lambda: read_database_clip(path, robot), lambda: clip_of(path)):
        with pytest.raises(FileError, match=r"clip\.json: the file is larger than the 50000000 bytes allowed"):
            read()


CODE = """
import sys
from pathlib import Path
from pipeline.expert import DatabaseError, read_database
from pipeline.tracking.tracker_folder import read_card
from pipeline.errors import FileError
for read, kinds in ((read_database, DatabaseError), (read_card, FileError)):
    try:
        read(Path(sys.argv[1]))
    except kinds as error:
        print(error)
"""


def test_manifests_and_cards_of_holes_take_no_memory(root, tmp_path):
    for name in ("manifest.json", "card.json"):
        with (tmp_path / name).open("wb") as stream:
            stream.truncate(3 << 30)
    limit = 3 << 30
    done = subprocess.run(
        [sys.executable, "-c", CODE, tmp_path],
        cwd=root,
        capture_output=True,
        text=True,
        check=False,
        preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_AS, (limit, limit)),
    )
    assert done.stdout.count("is larger than the 50000000 bytes allowed") == 2, done.stderr[-2_000:]


def test_an_index_that_claims_too_many_rows_is_refused_before_it_is_read(tmp_path, monkeypatch):
    pq.write_table(pa.table({"clip": pa.array(np.zeros(2_000_000, dtype=np.int64))}), tmp_path / "index.parquet")
    monkeypatch.setattr("pandas.read_parquet", lambda *_, **__: pytest.fail("it was read"))
    with pytest.raises(FileError, match=r"index\.parquet: it claims 2000000 rows"):
        read_table(tmp_path / "index.parquet")
