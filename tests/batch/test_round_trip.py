"""A stored clip is read as it was written: the digest of its bytes and a round trip through the codec say so."""

from pathlib import Path

from pipeline.batch import ClipPool, Entry, Manifest, Store
from pipeline.clips import codec
from pipeline.files import blob_store
from tests.factories.robot_clips import standing
from tests.factories.simulated_clip import simulated_standing


def test_a_stored_clip_round_trips_with_forces_and_without(tmp_path: Path, robot):
    store = Store(root=tmp_path)
    for clip in (standing(robot), simulated_standing(robot, 0.5)):
        assert store.round_trips(store.put_clip(clip))


def test_a_damaged_missing_or_foreign_blob_does_not(tmp_path: Path, robot):
    store = Store(root=tmp_path)
    blob = store.put_clip(standing(robot))
    other = store.blobs.put(codec.encode(standing(robot, 3.0)) + b" ")
    assert not store.round_trips(other), "bytes that no clip encodes to"
    store.own_blobs.path(blob).write_bytes(b"damaged")
    assert not store.round_trips(blob)
    assert not store.round_trips("0" * 64)


def test_a_blob_that_round_trips_is_not_read_again_to_be_known_as_whole(tmp_path: Path, robot, monkeypatch):
    monkeypatch.setattr(blob_store, "SETTLED_NS", 0)
    store, pool = Store(root=tmp_path), ClipPool(backend="sequential")
    whole, cut = store.put_clip(standing(robot)), store.put_clip(standing(robot, 3.0))
    entries = (Entry(clip="a", blob=whole, numbers={}), Entry(clip="b", blob=cut, numbers={}))
    store.own_blobs.path(cut).write_bytes(store.own_blobs.path(cut).read_bytes()[:-1])
    assert [*store.damaged(Manifest(stage="made", entries=entries), pool)] == ["b"]
    monkeypatch.setattr(blob_store.digest, "of_file", lambda path: "read")
    assert store.holds(whole)
    store.own_blobs.path(whole).write_bytes(b"damaged")
    assert not store.holds(whole)
