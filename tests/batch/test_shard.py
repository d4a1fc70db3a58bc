"""Shards: rows come back as they were, one more clip changes one shard, and unchanged ones are not worked on."""

import dataclasses
import json
import logging

import pytest
from hypothesis import given
from hypothesis import strategies as st

from pipeline.batch import ClipPool, Entry, Judged, Manifest, Rows, Stage, Store, changed, run_files, run_stage
from pipeline.batch.manifest import SCHEMA_OF_ROWS
from pipeline.batch.shard import CUT_EVERY, cut, shard_of, source_of
from pipeline.clips.outcome import Outcome, Piece
from pipeline.errors import FileError
from pipeline.files import digest
from tests.factories.clips import robot_clip

LOG = logging.getLogger("test")
POOL = ClipPool(backend="sequential")
FINITE = st.floats(allow_nan=False, allow_infinity=False)
VALUES = st.one_of(st.none(), st.booleans(), st.integers(), FINITE, st.text(), st.lists(FINITE, max_size=2))
NUMBERS = st.dictionaries(st.sampled_from(["speed", "skill", "parts", "a b"]), VALUES)


@given(st.lists(st.tuples(st.text(), NUMBERS), max_size=5))
def test_entries_come_back_as_they_were(rows):
    record = ({"stage": "a", "reasons": []},)
    entries = [Entry(clip=name, blob="0" * 64, numbers=numbers, record=record) for name, numbers in rows]
    back = shard_of(Entry, entries).rows()
    assert back == entries
    assert repr([entry.numbers for entry in back]) == repr([dict(sorted(entry.numbers.items())) for entry in entries])


@given(st.lists(st.tuples(st.text(), NUMBERS), max_size=5))
def test_findings_come_back_as_they_were(rows):
    reason = {"code": "x", "text": "y", "effect": "noted", "start_s": 0.5}
    judged = [Judged(clip=name, pieces=(name,), reasons=(reason,), numbers=numbers) for name, numbers in rows]
    assert shard_of(Judged, judged).rows() == judged


def test_a_number_that_is_not_finite_is_refused():
    rows = [Entry(clip="a", blob="", numbers={"speed": speed}) for speed in (1.0, float("nan"))]
    rows[1] = Entry(clip="b", blob="", numbers=rows[1].numbers)
    with pytest.raises(ValueError, match="clip 'b': the number 'speed' is not finite"):
        shard_of(Entry, rows)


def test_a_number_may_not_be_named_like_a_column():
    with pytest.raises(ValueError, match="may not be named 'blob'"):
        shard_of(Entry, [Entry(clip="a", blob="", numbers={"blob": 1})])


def names(count: int, sources: int = 2) -> list[str]:
    return sorted(f"source{index % sources}/clip{index:05d}" for index in range(count))


def shards(clips: list[str]) -> list[tuple[str, ...]]:
    return [tuple(clips[part]) for part in cut(clips)]


def test_one_clip_more_changes_the_shard_that_it_comes_into_and_no_other():
    before, after = set(shards(names(4000))), set(shards(sorted([*names(4000), "source0/clip01000b"])))
    assert len(after - before) <= 2 and len(after) > 20


def test_shards_are_of_one_source_and_about_as_large_as_stated():
    found = shards(names(8000))
    assert all(len({source_of(clip) for clip in shard}) == 1 for shard in found)
    assert 0.5 * CUT_EVERY < 8000 / len(found) < 2.0 * CUT_EVERY
    assert [clip for shard in found for clip in shard] == names(8000)


def read(path, name):
    return Outcome(pieces=(Piece(clip=robot_clip(frames=3, name=name), numbers={"seconds": 0.04}),))


def keep(clip, numbers):
    return Outcome(pieces=(Piece(clip=clip, numbers={}),))


def test_one_clip_more_reads_and_writes_its_own_shard(tmp_path, monkeypatch):
    store, clips = Store(root=tmp_path), names(600)

    def run(names_: list[str]) -> Manifest:
        files = [(name, tmp_path, name, ()) for name in names_]
        store.save("read", run_files(Stage(name="read", version="1", function=read), files, store, POOL, LOG))
        return run_stage(Stage(name="keep", version="1", function=keep), store.load("read"), store, POOL, LOG)

    before = run(clips)
    asked: list[str] = []
    recall = Store.recall
    monkeypatch.setattr(Store, "recall", lambda self, key, stage: asked.append(key) or recall(self, key, stage))
    after = run(sorted([*clips, "source1/another"]))
    assert after.recomputed == 1 and len(after.entries) == 601
    new = {shard.digest for shard in after.entry_shards} - {shard.digest for shard in before.entry_shards}
    assert 1 <= len(new) <= 2 and len(before.entry_shards) > 3
    assert len(asked) < 600, "each of two stages asks for its shards and for the clips of one"


def manifest() -> Manifest:
    entries = tuple(Entry(clip=name, blob="0" * 64, numbers={"seconds": 1.5}) for name in names(400))
    judged = tuple(Judged(clip=entry.clip, pieces=(entry.clip,), reasons=(), numbers={}) for entry in entries)
    return Manifest(stage="made", entries=entries, judged=judged)


def test_what_a_clip_is_dropped_for_changes_its_shard_alone():
    before = manifest()
    after = before.without({"source0/clip00100": {"code": "x", "text": "y", "effect": "rejected"}})
    assert len(after.entries) == 399 and len(after.judged) == 400
    for old, new in ((before.entry_shards, after.entry_shards), (before.judged_shards, after.judged_shards)):
        assert len({shard.digest for shard in new} - {shard.digest for shard in old}) == 1
    (row,) = [row for row in after.judged if not row.pieces]
    assert (row.clip, row.fate, row.numbers["seconds_out"]) == ("source0/clip00100", "rejected", 0.0)


def test_rows_in_shards_are_read_like_a_tuple_of_the_rows():
    made = manifest()
    rows = Rows(made.entry_shards)
    assert len(rows) == 400 and rows == made.entries and rows[-1] == made.entries[-1]
    assert rows[100:103] == made.entries[100:103] and rows != made.entries[1:]
    with pytest.raises(IndexError):
        rows[400]
    assert changed(Entry, rows, lambda entry: entry).shards == rows.shards


def test_tables_have_the_named_columns_or_all():
    made = dataclasses.replace(manifest(), entries=manifest().entries[:2]).with_numbers({"source0/clip00002": {"n": 2}})
    assert list(made.entry_table().columns) == ["clip", "n", "seconds"]
    assert list(made.entry_table(["n", "none"]).columns) == ["clip", "n"]
    assert made.entry_table()["n"].isna().tolist() == [True, False]
    assert list(made.judged_table([]).columns) == ["clip", "fate", "reasons"]


def test_a_damaged_shard_is_named_and_its_answers_are_asked_for_again(tmp_path):
    store = Store(root=tmp_path)
    files = [(name, tmp_path, name, ()) for name in names(10)]
    stage = Stage(name="read", version="1", function=read)
    made = run_files(stage, files, store, POOL, LOG)
    store.save("read", made)
    path = store.shards.path(made.entry_shards[0].digest)
    path.write_bytes(path.read_bytes()[:-1])
    assert not store.holds_blobs_of("read")
    with pytest.raises(FileError, match=r"does not match its name.*Materialize again"):
        list(store.load("read").entries)
    again = run_files(stage, files, store, POOL, LOG)
    assert again.recomputed == 0 and again.digest == made.digest
    assert store.holds_blobs_of("read")


def test_a_manifest_of_an_earlier_version_is_read_and_known_by_its_file(tmp_path):
    store, made = Store(root=tmp_path), manifest()
    rows = {"entries": [vars(row) for row in made.entries], "judged": [vars(row) for row in made.judged]}
    path = store.manifest_path("made")
    path.parent.mkdir(parents=True)
    path.write_text(json.dumps({"schema": SCHEMA_OF_ROWS, "stage": "made", "settings": {"a": {"b": 1}}, **rows}))
    old = store.load("made")
    assert old.entries == made.entries and old.judged == made.judged and old.settings == {"a": {"b": 1}}
    assert old.digest == digest.of_file(path)
    store.save("made", old)
    assert store.load("made").entries == made.entries
