"""A stored clip is read as it was written: the digest of its bytes and a round trip through the codec say so."""

from pathlib import Path

from pipeline.batch import Store
from pipeline.clips import codec
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
