"""Machines without a common folder share blobs at a URL: same results, and each fault is one sentence."""

import dataclasses
import logging
import pickle
from pathlib import Path

import pytest

from pipeline.batch import ClipPool, Store, run_stage
from pipeline.batch.collect import collect
from pipeline.batch.store import BLOBS_VARIABLE
from pipeline.clips.outcome import Outcome, Piece
from pipeline.errors import FileError
from pipeline.expert import ExpertEntry, StoredClip, write_database
from pipeline.files import digest
from pipeline.files.remote_blobs import BlobGoneError, RemoteBlobError, RemoteBlobs
from pipeline.robot import Robot
from tests.batch.test_cluster import clips, two_workers
from tests.batch.test_run import manifest_of, stage
from tests.factories.robot_clips import standing

LOG = logging.getLogger("test")
HERE = ClipPool(backend="sequential")
NAMES = ["a", "b", "c"]


@pytest.fixture
def url(request: pytest.FixtureRequest) -> str:
    """A folder in memory, of this test alone."""
    return f"memory://{request.node.name}"


def at(root: Path, url: str) -> Store:
    return Store(root=root, blobs_url=url)


def given(store: Store) -> Store:
    """The store as a worker process gets it."""
    return pickle.loads(pickle.dumps(store))  # noqa: S301, our own


def test_a_store_with_a_url_gives_the_bytes_of_one_without(tmp_path: Path, url: str):
    alone, shared = Store(root=tmp_path / "alone"), at(tmp_path / "shared", url)
    expected = run_stage(stage(), manifest_of(alone, NAMES), alone, HERE, LOG)
    found = run_stage(stage(), manifest_of(shared, NAMES), shared, HERE, LOG)
    assert found.to_text() == expected.to_text()
    blobs = {path.name for path in (tmp_path / "alone/blobs").glob("*/*")}
    assert set(RemoteBlobs(url=url).sizes()) == blobs


def test_a_worker_reads_and_writes_at_the_url_alone(tmp_path: Path, url: str, robot: Robot):
    store = at(tmp_path / "store", url)
    worker = given(store)
    blob = worker.put_clip(standing(robot))
    assert not (tmp_path / "store").exists()
    assert worker.get_clip(blob, "still").name == "still" and worker.round_trips(blob)
    assert worker.shared_folders == () and Store(root=tmp_path).shared_folders == (tmp_path,)
    assert store.holds(blob), "this machine copies it"
    assert digest.of_file(store.own_blobs.path(blob)) == blob
    assert not store.holds("ab" * 32)


def test_another_machine_takes_from_the_url_what_it_lacks(tmp_path: Path, url: str):
    here, there = at(tmp_path / "here", url), at(tmp_path / "there", url)
    made = run_stage(stage(), manifest_of(here, NAMES), here, HERE, LOG)
    assert not any((tmp_path / "there").rglob("*"))
    assert [there.get_clip(entry.blob, entry.clip).name for entry in made.entries] == NAMES
    assert len(list((tmp_path / "there/blobs").glob("*/*"))) == len({entry.blob for entry in made.entries})


def test_a_blob_damaged_at_the_url_is_made_again(tmp_path: Path, url: str):
    remote = RemoteBlobs(url=url)
    blob = remote.put(b"content")
    files, path = remote._opened[0], remote._path(blob)
    files.pipe_file(path, b"another")
    with pytest.raises(BlobGoneError, match=r"does not match its name\. Materialize again"):
        remote.get(blob)
    with pytest.raises(BlobGoneError, match=r"is missing\. Materialize again"):
        remote.get(blob)
    files.pipe_file(path, b"con")  # torn: the next who makes it writes it whole
    remote.put(b"content")
    assert remote.get(blob) == b"content"


def test_a_clip_whose_blob_is_gone_everywhere_is_worked_on_again(tmp_path: Path, url: str):
    store = at(tmp_path, url)
    before = manifest_of(store, NAMES)
    made = run_stage(stage(add=1.0), before, store, HERE, LOG)
    blob = made.entries[0].blob
    store.own_blobs.path(blob).unlink()
    assert run_stage(stage(add=1.0), before, at(tmp_path, url), HERE, LOG).recomputed == 0
    store.own_blobs.path(blob).unlink()
    RemoteBlobs(url=url).remove(blob)
    again = run_stage(stage(add=1.0), before, at(tmp_path, url), HERE, LOG)
    assert again.recomputed == 1 and again.to_text() == made.to_text()


def test_old_blobs_at_the_url_are_collected_too(tmp_path: Path, url: str):
    store = at(tmp_path, url)
    for add in (1.0, 2.0):
        before = manifest_of(store, NAMES)
        store.save("before", before)
        store = at(tmp_path, url)
        store.save("made", run_stage(stage(add=add), before, store, HERE, LOG))
    part = collect(store, 1, delete=True)[-1]
    assert part.what == f"blobs at {url}" and len(part.old) == 3
    assert set(RemoteBlobs(url=url).sizes()) == {path.name for path in (tmp_path / "blobs").glob("*/*")}
    assert at(tmp_path, url).holds_blobs_of("made")


def test_the_variable_names_the_url(tmp_path: Path, url: str, monkeypatch: pytest.MonkeyPatch):
    assert Store(root=tmp_path).blobs_url == ""
    monkeypatch.setenv(BLOBS_VARIABLE, f"{url}/")
    assert Store(root=tmp_path).blobs_url == url


def test_a_url_that_cannot_be_used_is_one_sentence(tmp_path: Path):
    with pytest.raises(RemoteBlobError, match=r"^nonsense://x: can't be opened .* Check BOOSTER_LAB_BLOBS\.$"):
        RemoteBlobs(url="nonsense://x").put(b"content")
    (tmp_path / "file").touch()
    with pytest.raises(RemoteBlobError, match=r"does not answer as it should .* Check the network"):
        RemoteBlobs(url=f"file://{tmp_path}/file").put(b"content")


def test_workers_of_a_cluster_that_do_not_see_the_store_work_through_the_url(tmp_path: Path, root: Path, robot: Robot):
    url = f"file://{tmp_path / 'bucket'}"
    here, there = Store(root=tmp_path / "here"), at(tmp_path / "there", url)

    own = tmp_path / "there" / "blobs"

    def lift(clip, numbers):
        return Outcome(pieces=(Piece(clip=clip, numbers={"sees": own.exists()}),))

    work = dataclasses.replace(stage(), function=lift)
    before = clips(there, root, 3, seconds=0.4)
    expected = run_stage(work, clips(here, root, 3, seconds=0.4), here, HERE, LOG)
    with two_workers(tmp_path) as (address, _):
        pool = ClipPool(backend="dask", address=address)
        own.rename(tmp_path / "aside")
        made = run_stage(work, before, there, pool, LOG)
        assert [entry.numbers["sees"] for entry in made.entries] == [False] * 3
        assert [entry.blob for entry in made.entries] == [entry.blob for entry in expected.entries]
        assert [*there.damaged(made, pool)] == []
        entries = [
            ExpertEntry(
                clip=StoredClip(name=entry.clip, blob=entry.blob, store=there),
                weight=1.0,
                skill="walk",
                licence="CC0-1.0",
            )
            for entry in made.entries
        ]
        assert write_database(tmp_path / "t1", entries, robot, stages={}, pool=pool).manifest["clips"] == 3


def test_a_disk_that_refuses_the_copy_is_no_fault_of_the_url(tmp_path: Path, url: str):
    blob = RemoteBlobs(url=url).put(b"content")
    (tmp_path / "blobs").touch()
    with pytest.raises(FileError):
        at(tmp_path, url).holds(blob)
