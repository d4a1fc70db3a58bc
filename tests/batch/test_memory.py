"""A run holds names, numbers and reasons of all clips, but the frames of one at a time; and what the memo survives."""

import dataclasses
import json
import logging
import os
import tracemalloc
from pathlib import Path

import pytest

from pipeline.batch import ClipPool, Entry, Judged, Manifest, Stage, Store, run_files, run_stage
from pipeline.clips.outcome import Outcome, Piece
from pipeline.files import digest
from pipeline.files.blob_store import StoreError
from tests.factories.clips import robot_clip

LOG = logging.getLogger("test")
FRAMES = 4000
CLIP_BYTES = FRAMES * 8 * (3 + 4 + len(robot_clip(frames=2).joint_names))
FEW, MANY = 4, 24


def raise_a_little(clip, numbers):
    """Another clip of the same size."""
    lifted = dataclasses.replace(clip, root_pos_w=clip.root_pos_w + 0.001)
    return Outcome(pieces=(Piece(clip=lifted, numbers={"seconds": clip.duration_s}),))


def from_file(path, name):
    """As many frames as the others have, made from a file."""
    return raise_a_little(robot_clip(frames=FRAMES, name=name), {})


def stage(function) -> Stage:
    return Stage(name=function.__name__, version="1", function=function)


def stored(store: Store, count: int) -> Manifest:
    entries = []
    for index in range(count):
        name = f"clip{index:03d}"
        clip = robot_clip(frames=FRAMES, name=name)
        moved = dataclasses.replace(clip, root_pos_w=clip.root_pos_w + index)
        entries.append(Entry(clip=name, blob=store.put_clip(moved), numbers={"seconds": clip.duration_s}))
    return Manifest(stage="before", entries=tuple(entries), judged=())


def peak_of(work) -> int:
    """Most bytes allocated at a time by `work()`, arrays included, over what was there before."""
    tracemalloc.start()
    try:
        before, _ = tracemalloc.get_traced_memory()
        result = work()
        peak = tracemalloc.get_traced_memory()[1] - before
    finally:
        tracemalloc.stop()
    assert result.recomputed == len(result.entries) > 0
    return peak


@pytest.mark.parametrize("pool", [ClipPool(backend="sequential"), ClipPool(workers=2)], ids=["here", "processes"])
def test_memory_does_not_grow_by_the_clips_that_pass_through(tmp_path, pool):
    peaks = {}
    for count in (FEW, MANY):
        store = Store(root=tmp_path / str(count))
        before = stored(store, count)
        peaks[count] = peak_of(
            lambda before=before, store=store: run_stage(stage(raise_a_little), before, store, pool, LOG)
        )
    assert peaks[MANY] - peaks[FEW] < 2 * CLIP_BYTES < (MANY - FEW) * CLIP_BYTES / 5


def test_memory_does_not_grow_by_the_files_that_are_read(tmp_path):
    peaks, pool = {}, ClipPool(backend="sequential")
    for count in (FEW, MANY):
        files = [(f"file{index:03d}", tmp_path, str(index), ()) for index in range(count)]
        store = Store(root=tmp_path / str(count))
        peaks[count] = peak_of(lambda files=files, store=store: run_files(stage(from_file), files, store, pool, LOG))
    assert peaks[MANY] - peaks[FEW] < 2 * CLIP_BYTES


def test_the_command_s_process_never_holds_frames_when_others_work(tmp_path):
    store = Store(root=tmp_path)
    before = stored(store, FEW)
    assert peak_of(lambda: run_stage(stage(raise_a_little), before, store, ClipPool(workers=2), LOG)) < CLIP_BYTES


@pytest.mark.parametrize("torn", [b"", b"\0" * 64, b"\xff\xfe", "half"], ids=["empty", "zeros", "no text", "half"])
def test_an_answer_that_a_power_cut_tore_is_asked_for_again(tmp_path, torn):
    store, pool = Store(root=tmp_path), ClipPool(backend="sequential")
    before = stored(store, 2)
    first = run_stage(stage(raise_a_little), before, store, pool, LOG)
    for answer in (tmp_path / "memo").rglob("*.json"):
        answer.write_bytes(answer.read_bytes()[: answer.stat().st_size // 2] if torn == "half" else torn)
    again = run_stage(stage(raise_a_little), before, store, pool, LOG)
    assert again.recomputed == 2
    assert again.digest == first.digest


def test_the_digest_of_a_manifest_read_back_is_that_of_its_content(tmp_path):
    store = Store(root=tmp_path)
    made = run_stage(stage(raise_a_little), stored(store, 2), store, ClipPool(backend="sequential"), LOG)
    store.save("made", made)
    read = store.load("made")
    assert read.digest == made.digest
    assert dataclasses.replace(read, stage="other").digest != made.digest
    assert digest.of_file(store.manifest_path("made")) == made.digest
    more = read.with_numbers({"clip000": {"seconds": 1.5}})
    assert more.digest != made.digest
    assert more.with_numbers({"clip000": {"seconds": read.entries[0].numbers["seconds"]}}).digest == made.digest


def test_a_manifest_of_many_clips_is_written_a_shard_at_a_time(tmp_path):
    numbers = {f"number {index}": index / 7 for index in range(100)}
    entries = tuple(Entry(clip=f"clip{index:04d}", blob="0" * 64, numbers=numbers) for index in range(4000))
    manifest, store = Manifest(stage="made", entries=entries, judged=()), Store(root=tmp_path)
    tracemalloc.start()
    try:
        before, _ = tracemalloc.get_traced_memory()
        store.save("made", manifest)
        made = manifest.digest
        peak = tracemalloc.get_traced_memory()[1] - before
    finally:
        tracemalloc.stop()
    assert store.manifest_path("made").read_text() == manifest.to_text()
    assert digest.of_file(store.manifest_path("made")) == made
    assert peak < sum(len(json.dumps(vars(entry))) for entry in entries) / 5


def test_the_shards_of_a_manifest_are_on_the_disk_before_it_names_them(tmp_path, monkeypatch):
    store, synced, fsync = Store(root=tmp_path), [], os.fsync
    before = dataclasses.replace(stored(store, 2), judged=(Judged(clip="clip000", pieces=(), reasons=(), numbers={}),))

    def note(handle: int) -> None:
        synced.append(Path(f"/proc/self/fd/{handle}").resolve().name)
        fsync(handle)

    monkeypatch.setattr(os, "fsync", note)
    store.save("made", before)
    names = [shard.digest for shard in (*before.entry_shards, *before.judged_shards)]
    manifest = next(index for index, name in enumerate(synced) if name.startswith(".made.json"))
    assert {*names, *(name[:2] for name in names), "shards"} <= set(synced[:manifest])


def test_a_torn_blob_that_is_remembered_as_whole_is_made_again(tmp_path):
    """After a power cut some file systems have a file's size and times without its content."""
    store, pool = Store(root=tmp_path), ClipPool(backend="sequential")
    before = stored(store, 1)
    first = run_stage(stage(raise_a_little), before, store, pool, LOG)
    entry = first.entries[0]
    path = store.own_blobs.path(entry.blob)
    data = path.read_bytes()
    path.write_bytes(bytes(len(data)))
    stat = path.stat()
    state = [stat.st_size, stat.st_mtime_ns, stat.st_ctime_ns, stat.st_ino]
    (tmp_path / "blob_digests.json").write_text(json.dumps({str(path): [*state, entry.blob]}))
    store = Store(root=tmp_path)
    assert store.holds(entry.blob)
    with pytest.raises(StoreError, match="Materialize again"):
        store.get_clip(entry.blob, entry.clip)
    assert not store.holds(entry.blob)
    again = run_stage(stage(raise_a_little), before, store, pool, LOG)
    assert (again.recomputed, again.digest) == (1, first.digest)
    assert path.read_bytes() == data


@pytest.mark.parametrize("damage", ["gone", "a bit turned", "emptied"])
def test_a_blob_that_is_gone_or_was_changed_is_made_again(tmp_path, damage):
    store, pool = Store(root=tmp_path), ClipPool(backend="sequential")
    before = stored(store, 2)
    first = run_stage(stage(raise_a_little), before, store, pool, LOG)
    store.save("made", first)
    assert store.holds_blobs_of("made")
    path = store.own_blobs.path(first.entries[0].blob)
    data = path.read_bytes()
    if damage == "gone":
        path.unlink()
    else:
        path.write_bytes(b"" if damage == "emptied" else data[:100] + bytes([data[100] ^ 1]) + data[101:])
    store = Store(root=tmp_path)
    assert not store.holds_blobs_of("made")
    again = run_stage(stage(raise_a_little), before, store, pool, LOG)
    assert again.recomputed == 1
    assert again.digest == first.digest
    assert path.read_bytes() == data
    assert Store(root=tmp_path).holds_blobs_of("made")
