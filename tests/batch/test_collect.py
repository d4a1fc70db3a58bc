"""What `booster-lab store gc` keeps: what results name, and what the last runs asked for."""

import dataclasses
import fcntl
import logging

import pytest

from pipeline.batch import ClipPool, Manifest, Store, run_stage
from pipeline.batch.collect import StoreInUseError, collect
from pipeline.batch.store import LOCK
from pipeline.errors import FileError
from tests.batch.test_run import manifest_of, stage

LOG = logging.getLogger("test")
POOL = ClipPool(backend="sequential")
CLIPS = ["a", "b", "c"]
A_RUN = len(CLIPS) + 1
"""Answers of a run: on each clip, and on the shard that they are in."""


def ran(root, *, add: float, names: list[str] = CLIPS) -> Manifest:
    """A run of the stage with a setting, in a process of its own as far as the store knows."""
    store = Store(root=root)
    before = manifest_of(store, names)
    store.save("before", before)
    made = run_stage(stage(add=add), before, store, POOL, LOG)
    store.save("made", made)
    return made


def old_of(root, keep: int, *, delete: bool = False) -> dict[str, int]:
    return {part.what: len(part.old) for part in collect(Store(root=root), keep, delete=delete)}


def test_answers_of_the_last_runs_and_what_results_name_are_kept(tmp_path):
    for add in (0.0, 1.0, 2.0):
        ran(tmp_path, add=add)
    none = {"answers": 0, "blobs of clips": 0, "shards of manifests": 0, "manifests": 0, "thumbnails": 0}
    assert old_of(tmp_path, 3) == none
    before = sorted(tmp_path.rglob("*"))
    assert old_of(tmp_path, 2) == none | {"answers": A_RUN, "shards of manifests": 1}, "add 0: its blobs are inputs"
    assert old_of(tmp_path, 1)["answers"] == 2 * A_RUN
    assert sorted(tmp_path.rglob("*")) == before, "nothing is deleted unasked"
    deleted = {"answers": 2 * A_RUN, "blobs of clips": 3, "shards of manifests": 2}
    assert old_of(tmp_path, 1, delete=True) == none | deleted
    assert old_of(tmp_path, 1) == none
    assert Store(root=tmp_path).holds_blobs_of("made") and Store(root=tmp_path).holds_blobs_of("before")
    assert ran(tmp_path, add=2.0).recomputed == 0, "the present settings are answered still"


def test_what_was_deleted_is_made_again_with_the_same_bytes(tmp_path):
    first = ran(tmp_path, add=0.5)
    ran(tmp_path, add=1.0)
    old_of(tmp_path, 1, delete=True)
    again = ran(tmp_path, add=0.5)
    assert again.recomputed == 3
    assert again.digest == first.digest


def test_an_answer_that_a_later_run_asked_for_counts_as_of_that_run(tmp_path):
    ran(tmp_path, add=0.0)
    ran(tmp_path, add=1.0)
    assert ran(tmp_path, add=0.0).recomputed == 0
    assert old_of(tmp_path, 1)["answers"] == A_RUN
    old_of(tmp_path, 1, delete=True)
    assert ran(tmp_path, add=0.0).recomputed == 0


def test_answers_on_clips_are_kept_with_the_one_on_their_shard(tmp_path):
    ran(tmp_path, add=0.0)
    assert ran(tmp_path, add=0.0).recomputed == 0, "the shard alone was asked for"
    old_of(tmp_path, 1, delete=True)
    assert ran(tmp_path, add=0.0, names=[*CLIPS, "d"]).recomputed == 1


def test_other_stages_and_many_questions_of_one_run_do_not_age_an_answer(tmp_path):
    ran(tmp_path, add=0.0)
    store = Store(root=tmp_path)
    before = manifest_of(store, CLIPS)
    run_stage(stage(version="2"), before, store, POOL, LOG)
    run_stage(stage(version="3"), before, store, POOL, LOG)
    for _ in range(4):
        Store(root=tmp_path).recall("0" * 64, "another stage")
    assert old_of(tmp_path, 2)["answers"] == 0
    assert old_of(tmp_path, 1)["answers"] == A_RUN, "of the first run; both questions of the second are one run's"


def test_runs_of_one_robot_do_not_age_the_answers_of_another(tmp_path):
    store = Store(root=tmp_path)
    before = manifest_of(store, CLIPS)
    for robot in ("k1", "t1", "t1"):
        here = dataclasses.replace(stage(), robot=robot, depends={"robot": robot})
        run_stage(here, before, Store(root=tmp_path), POOL, LOG)
    assert old_of(tmp_path, 1)["answers"] == 0


def test_torn_answers_answers_of_no_stage_and_halves_of_killed_writers_go(tmp_path):
    ran(tmp_path, add=0.0)
    torn = tmp_path / "memo/00/torn.json"
    torn.parent.mkdir(parents=True, exist_ok=True)
    torn.write_text('{"pieces": [')
    (tmp_path / "memo/00/old.json").write_text('{"pieces": []}')
    (tmp_path / "memo/00/.key.1.part").write_text("{")
    half = tmp_path / "blobs/00/.half.part"
    half.parent.mkdir(parents=True, exist_ok=True)
    half.write_text("PAR1")
    found = old_of(tmp_path, 5, delete=True)
    assert (found["answers"], found["blobs of clips"], found["shards of manifests"]) == (3, 1, 0)
    assert not half.exists() and not torn.exists()
    assert ran(tmp_path, add=0.0).recomputed == 0


def test_a_store_that_a_run_works_on_is_left_alone(tmp_path):
    ran(tmp_path, add=0.0)
    ran(tmp_path, add=1.0)
    with (tmp_path / LOCK).open("a+") as held:
        fcntl.flock(held, fcntl.LOCK_EX)
        held.write("run 12 (process 34)")
        held.flush()
        with pytest.raises(StoreInUseError, match=r"run 12 \(process 34\) is working on the store; try again"):
            old_of(tmp_path, 1, delete=True)
    assert old_of(tmp_path, 1)["answers"] == A_RUN


def test_where_there_is_no_store_nothing_is_made(tmp_path):
    with pytest.raises(FileError, match="there is no store here"):
        collect(Store(root=tmp_path / "none"), 1, delete=True)
    assert not (tmp_path / "none").exists()
