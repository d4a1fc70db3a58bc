"""A stage over many clips: nothing is worked on twice, a failing clip does not stop the others."""

import dataclasses
import logging
from functools import partial

import numpy as np
import pytest

from pipeline.batch import ClipPool, Entry, Manifest, Stage, Store, run_stage
from pipeline.batch.again import AGAIN_VARIABLE
from pipeline.batch.run import progress
from pipeline.batch.shard import Rows, shard_of
from pipeline.clips.outcome import Outcome, Piece, Reason
from pipeline.errors import ClipError, FileError
from tests.factories.clips import robot_clip

LOG = logging.getLogger("test")
POOL = ClipPool(backend="sequential")


def keep(clip, numbers, *, add=0.0):
    """Accepts all but the clips whose names say otherwise."""
    if "bad" in clip.name:
        raise ClipError(clip.name, "no_good", "is bad by name.", frame=2)
    if "fault" in clip.name:
        raise ZeroDivisionError("by design")
    if "lame" in clip.name:
        return Outcome(reasons=(Reason(code="lame", text="it limps", effect="rejected"),))
    moved = dataclasses.replace(clip, joint_pos=clip.joint_pos + add)
    return Outcome(pieces=(Piece(clip=moved, numbers={"seconds": clip.duration_s, "tenfold": 10 * numbers["rank"]}),))


def manifest_of(store: Store, names: list[str]) -> Manifest:
    entries = []
    for rank, name in enumerate(names):
        blob = store.put_clip(robot_clip(frames=5 + rank, name=name))
        entries.append(Entry(clip=name, blob=blob, numbers={"rank": rank, "seconds": (5 + rank) / 50.0}))
    return Manifest(stage="before", entries=tuple(entries), judged=())


def stage(version: str = "1", add: float = 0.0) -> Stage:
    return Stage(name="keep", version=version, function=partial(keep, add=add), settings={"add": add})


@pytest.fixture
def store(tmp_path) -> Store:
    return Store(root=tmp_path)


def test_a_second_run_works_on_no_clip_and_has_the_same_digest(store):
    before = manifest_of(store, ["a", "b", "c"])
    first = run_stage(stage(), before, store, POOL, LOG)
    second = run_stage(stage(), before, store, POOL, LOG)
    assert (first.recomputed, second.recomputed) == (3, 0)
    assert first.digest == second.digest
    assert first.to_text() == second.to_text()


def test_one_clip_added_works_on_that_clip_alone(store):
    run_stage(stage(), manifest_of(store, ["a", "b"]), store, POOL, LOG)
    assert run_stage(stage(), manifest_of(store, ["a", "b", "c"]), store, POOL, LOG).recomputed == 1


def test_named_clips_are_worked_on_again_and_nothing_else(store, tmp_path, monkeypatch):
    before = manifest_of(store, ["a", "b", "lame"])
    first = run_stage(stage(), before, store, POOL, LOG)
    listed = tmp_path / "again.json"
    listed.write_text('["a", "lame"]')
    monkeypatch.setenv(AGAIN_VARIABLE, str(listed))
    again = run_stage(stage(), before, store, POOL, LOG)
    assert (again.recomputed, again.digest) == (2, first.digest)
    monkeypatch.delenv(AGAIN_VARIABLE)
    assert run_stage(stage(), before, store, POOL, LOG).recomputed == 0


def test_the_clips_of_a_named_source_are_worked_on_again(store, tmp_path, monkeypatch):
    before = manifest_of(store, ["one/a", "one/b", "two/a", "two/one"])
    first = run_stage(stage(), before, store, POOL, LOG)
    listed = tmp_path / "again.json"
    listed.write_text('["one/"]')
    monkeypatch.setenv(AGAIN_VARIABLE, str(listed))
    again = run_stage(stage(), before, store, POOL, LOG)
    assert (again.recomputed, again.digest) == (2, first.digest)


@pytest.mark.parametrize("text", ["", "{}", "[1]", None])
def test_a_list_of_clips_that_can_not_be_read_is_an_error_with_its_file(store, tmp_path, monkeypatch, text):
    listed = tmp_path / "again.json"
    if text is not None:
        listed.write_text(text)
    monkeypatch.setenv(AGAIN_VARIABLE, str(listed))
    with pytest.raises(FileError, match=r"again\.json.*Unset BOOSTER_LAB_AGAIN"):
        run_stage(stage(), manifest_of(store, ["a"]), store, POOL, LOG)


def test_a_line_of_progress_states_percent_and_the_time_left():
    assert progress("keep", 10, 40, 20.0) == "keep: 10 of 40 clips (25 %), 20 s, about 60 s left"


@pytest.mark.parametrize("other", [stage(version="2"), stage(add=1.0)])
def test_another_version_or_setting_works_on_all(store, other):
    before = manifest_of(store, ["a", "b"])
    run_stage(stage(), before, store, POOL, LOG)
    assert run_stage(other, before, store, POOL, LOG).recomputed == 2


def test_a_lost_blob_is_made_again(store):
    before = manifest_of(store, ["a", "b"])
    made = run_stage(stage(add=1.0), before, store, POOL, LOG)
    store.own_blobs.path(made.entries[0].blob).unlink()
    again = run_stage(stage(add=1.0), before, store, POOL, LOG)
    assert again.recomputed == 1
    assert again.digest == made.digest


def test_a_failing_clip_is_rejected_with_its_reason_and_the_rest_goes_on(store):
    found = run_stage(stage(), manifest_of(store, ["a", "bad", "fault", "lame"]), store, POOL, LOG)
    reasons = {row.clip: [reason["code"] for reason in row.reasons] for row in found.judged}
    assert reasons == {"a": [], "bad": ["no_good"], "fault": ["failed"], "lame": ["lame"]}
    assert [entry.clip for entry in found.entries] == ["a"]
    bad = next(row for row in found.judged if row.clip == "bad")
    assert bad.reasons[0]["text"] == "clip 'bad' frame 2: is bad by name."
    assert bad.numbers["seconds_in"] == pytest.approx(6 / 50.0)


def uneven(clip, numbers):
    """A stage that makes a clip which cannot be encoded."""
    broken = dataclasses.replace(clip)
    object.__setattr__(broken, "joint_pos", clip.joint_pos[:2] if clip.name == "broken" else clip.joint_pos)
    return Outcome(pieces=(Piece(clip=broken, numbers={}),))


def test_a_clip_that_can_not_be_encoded_is_a_fault_of_the_stage_and_the_rest_goes_on(store):
    uneven_stage = dataclasses.replace(stage(), function=uneven)
    found = run_stage(uneven_stage, manifest_of(store, ["a", "broken"]), store, POOL, LOG)
    reasons = {row.clip: [(each["code"], each["text"]) for each in row.reasons] for row in found.judged}
    ((code, text),) = reasons["broken"]
    assert reasons["a"] == [] and code == "failed" and text.startswith("clip 'broken': the stage failed with")


def test_a_disk_that_refuses_stops_the_run(store, monkeypatch):
    def full(clip):
        raise FileError(store.root, "could not be written (no space left).")

    before = manifest_of(store, ["a"])
    monkeypatch.setattr(Store, "put_clip", lambda self, clip: full(clip))
    with pytest.raises(FileError, match="no space left"):
        run_stage(stage(add=1.0), before, store, POOL, LOG)


def test_a_fault_of_the_stage_is_tried_again_a_verdict_is_not(store):
    before = manifest_of(store, ["fault", "lame", "bad"])
    run_stage(stage(), before, store, POOL, LOG)
    assert run_stage(stage(), before, store, POOL, LOG).recomputed == 1


def test_numbers_of_earlier_stages_are_handed_on_and_go_with_the_clip(store):
    found = run_stage(stage(), manifest_of(store, ["a", "b"]), store, POOL, LOG)
    assert [entry.numbers["tenfold"] for entry in found.entries] == [0, 10]
    assert [entry.numbers["rank"] for entry in found.entries] == [0, 1]
    assert found.entries[0].record[0]["stage"] == "keep"


def hand_on(clip, numbers):
    return Outcome(pieces=(Piece(clip=clip, numbers={**numbers, "rank": numbers["rank"] + 1}),))


def test_an_answer_holds_the_numbers_that_its_stage_made_alone(store):
    handing_on = dataclasses.replace(stage(), function=hand_on)
    for _ in ("worked on", "recalled"):
        (entry,) = run_stage(handing_on, manifest_of(store, ["a"]), store, POOL, LOG).entries
        assert entry.numbers == {"rank": 1, "seconds": 0.1}
    (given,) = manifest_of(store, ["a"]).entries
    answer = store.recall(handing_on.key(given.clip, given.blob, given.numbers), handing_on.asker)
    assert answer is not None
    assert answer["pieces"][0]["numbers"] == {"rank": 1}


def test_processes_give_the_same_bytes_as_this_one(store, tmp_path):
    before = manifest_of(store, ["a", "b", "bad", "c"])
    other = Store(root=tmp_path / "other")
    manifest_of(other, ["a", "b", "bad", "c"])
    here = run_stage(stage(), before, store, POOL, LOG)
    there = run_stage(stage(), before, other, ClipPool(workers=2), LOG)
    assert here.to_text() == there.to_text()


def test_order_of_the_input_does_not_matter(store):
    before = manifest_of(store, ["a", "b", "c"])
    turned = dataclasses.replace(before, entries=before.entries[::-1])
    assert run_stage(stage(), before, store, POOL, LOG).digest == run_stage(stage(), turned, store, POOL, LOG).digest


def test_two_clips_of_one_name_are_refused(store):
    before = manifest_of(store, ["a", "b"])
    doubled = dataclasses.replace(before, entries=(*before.entries, before.entries[0]))
    with pytest.raises(ClipError, match="two clips of this name"):
        run_stage(stage(), doubled, store, POOL, LOG)


def test_a_manifest_comes_back_from_its_text(store):
    found = run_stage(stage(), manifest_of(store, ["a", "bad"]), store, POOL, LOG)
    again = Manifest.from_text(found.to_text(), store.shards)
    assert again.to_text() == found.to_text()
    assert again.judged[1].fate == "rejected"


def test_dropped_clips_leave_with_their_reason_and_seconds(store):
    found = run_stage(stage(), manifest_of(store, ["a", "b"]), store, POOL, LOG)
    reason = Reason(code="not_taken", text="enough of these", effect="rejected").to_dict()
    left = found.without({"b": reason})
    assert [entry.clip for entry in left.entries] == ["a"]
    assert left.judged[1].reasons[-1]["code"] == "not_taken"
    assert left.judged[1].fate == "rejected"
    assert left.seconds("seconds_out") == pytest.approx(found.seconds("seconds_out") - 6 / 50.0)


def test_faults_of_frames_are_found_when_a_clip_is_made_and_remembered(store):
    def lose(clip, numbers):
        lost = dataclasses.replace(clip, joint_pos=np.where(clip.joint_pos > 3.0, np.nan, clip.joint_pos))
        return Outcome(pieces=(Piece(clip=lost, numbers={}),))

    lossy = Stage(name="lossy", version="1", function=lose)
    before = manifest_of(store, ["a"])
    expected = (("a", "frame 3: joint_pos is not finite"),)
    assert run_stage(lossy, before, store, POOL, LOG).unsound == expected
    again = run_stage(lossy, before, store, POOL, LOG)
    assert again.recomputed == 0 and tuple(map(tuple, again.unsound)) == expected
    assert run_stage(stage(), before, store, POOL, LOG).unsound == ()


def test_blobs_that_do_not_round_trip_are_named_by_their_clips(store):
    made = run_stage(stage(), manifest_of(store, ["a", "b", "c"]), store, POOL, LOG)
    assert list(store.damaged(made, ClipPool(workers=2))) == []
    store.own_blobs.path(made.entries[1].blob).write_bytes(b"damaged")
    assert list(store.damaged(made, POOL)) == ["b"]


def test_every_clip_of_a_damaged_blob_is_named(store):
    """`a/one` and `b/one` are in shards of their own, which name the same blob."""
    blob = store.put_clip(robot_clip(frames=5, name="one"))
    shards = [shard_of(Entry, [Entry(clip=name, blob=blob, numbers={})]) for name in ("a/one", "b/one")]
    made = Manifest(stage="before", entries=Rows([store.put_shard(shard) for shard in shards]), judged=())
    store.own_blobs.path(blob).write_bytes(b"damaged")
    assert list(store.damaged(made, POOL)) == ["a/one", "b/one"]


def test_a_stage_that_writes_to_its_clip_fails(store):
    """Windows of one clip share its arrays, so the next window would be of a changed clip."""

    def lift(clip, numbers):
        clip.root_pos_w[:, 2] += 0.1
        return Outcome(pieces=(Piece(clip=clip, numbers={}),))

    found = run_stage(Stage(name="lift", version="1", function=lift), manifest_of(store, ["a"]), store, POOL, LOG)
    assert found.entries == ()
    (reason,) = found.judged[0].reasons
    assert "ValueError: output array is read-only" in reason["text"]
