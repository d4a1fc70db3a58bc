"""A database written, read, and changed behind its back."""

import dataclasses
import hashlib
import json
import os
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pyarrow.parquet as pq
import pytest

from pipeline.batch import ClipPool, Store
from pipeline.clips.robot_clip import RobotClip
from pipeline.errors import ClipError
from pipeline.expert import (
    DatabaseError,
    ExpertEntry,
    NoClipsError,
    StoredClip,
    check_database,
    read_database,
    write,
    write_database,
)
from pipeline.expert.write import file_name
from pipeline.expert.written_frames import FRAMES
from pipeline.robot import Robot
from tests.factories.database_entries import bytes_of, entries_of
from tests.factories.robot_clips import standing


def test_what_is_written_is_read_and_says_where_it_came_from(robot: Robot, tmp_path: Path):
    folder = tmp_path / "t1"
    manifest = write_database(folder, entries_of(robot), robot, stages={"feasibility": {"version": "1"}}).manifest
    database = read_database(folder)
    assert database.manifest == manifest
    assert [clip.name for clip in database.clips] == ["source/clip0@0-60~mirror", "source/clip1@0-60~mirror"]
    assert [clip.weight for clip in database.clips] == [1.0, 2.0]
    assert database.clips[0].frames.shape == (60, 79)
    row = database.index.iloc[1]
    assert row["source_file"] == "source/clip.bvh"
    assert row["source_sha256"] == "ab"
    assert row["foot_slip_mean"] == pytest.approx(0.02)
    assert row["sha256"] == hashlib.sha256((folder / row["file"]).read_bytes()).hexdigest()
    assert json.loads(row["stages"]) == {"repair": {"version": "1"}}
    assert manifest["licence"]["strictest"] == "non-commercial"
    assert manifest["seconds"] == pytest.approx(2.4)
    assert manifest["robot_digest"] == robot.digest


def test_two_processes_write_the_bytes_of_one(robot: Robot, tmp_path: Path):
    store = Store(root=tmp_path / "store")
    entries = entries_of(robot, 12)
    stored = [
        dataclasses.replace(
            entry, clip=StoredClip(name=entry.clip.name, blob=store.put_clip(_motion(entry)), store=store)
        )
        for entry in entries
    ]
    write_database(tmp_path / "one", entries, robot, stages={})
    write_database(tmp_path / "two", stored, robot, stages={}, pool=ClipPool(workers=2))
    assert bytes_of(tmp_path / "two") == bytes_of(tmp_path / "one")


def test_processes_that_write_are_to_see_the_store_and_the_database(robot: Robot, tmp_path: Path):
    seen = []

    class NotingPool(ClipPool):
        def map(self, function, calls, *, shared=(), **options):
            seen.extend(shared)
            return super().map(function, calls, shared=shared, **options)

    (entry,), store = entries_of(robot, 1), Store(root=tmp_path / "store")
    clip = StoredClip(name=entry.clip.name, blob=store.put_clip(_motion(entry)), store=store)
    pool = NotingPool(backend="sequential")
    write_database(tmp_path / "t1", [dataclasses.replace(entry, clip=clip)], robot, stages={}, pool=pool)
    assert store.root in seen and tmp_path in seen


def test_frames_that_did_not_change_are_copied_not_encoded(robot: Robot, tmp_path: Path, monkeypatch):
    store = Store(root=tmp_path / "store")
    clips = [StoredClip(name=e.clip.name, blob=store.put_clip(_motion(e)), store=store) for e in entries_of(robot, 3)]
    frames, names = write.frames_of_clips, [clip.name for clip in clips]

    def write_weighed(folder: Path, weight: float) -> list[str]:
        """Clips that were encoded when all had this weight."""
        encoded: list[str] = []

        def watched(clips: list[RobotClip], robot: Robot):
            encoded.extend(clip.name for clip in clips)
            return frames(clips, robot)

        monkeypatch.setattr(write, "frames_of_clips", watched)
        entries = [ExpertEntry(clip=clip, weight=weight, skill="walk", licence="CC0-1.0") for clip in clips]
        write_database(folder, entries, robot, stages={})
        return encoded

    assert write_weighed(tmp_path / "t1", 1.0) == names
    assert write_weighed(tmp_path / "t1", 2.0) == []
    assert write_weighed(tmp_path / "from_nothing", 2.0) == names
    assert bytes_of(tmp_path / "t1") == bytes_of(tmp_path / "from_nothing")
    path = tmp_path / "t1" / file_name(names[1])
    head, _, text = path.read_bytes().partition(FRAMES)
    path.write_bytes(head + FRAMES + text.replace(b"0.", b"1.", 3))
    assert write_weighed(tmp_path / "t1", 2.0) == [names[1]], "damaged frames are not copied"
    (tmp_path / ".t1.frames").write_text('{"of": ["other code", ""], "clips": {}}')
    assert write_weighed(tmp_path / "t1", 2.0) == names
    assert bytes_of(tmp_path / "t1") == bytes_of(tmp_path / "from_nothing")


def _motion(entry: ExpertEntry) -> RobotClip:
    assert isinstance(entry.clip, RobotClip)
    return entry.clip


def test_a_file_that_does_not_read_back_keeps_the_database_out_of_its_place(robot: Robot, tmp_path: Path, monkeypatch):
    monkeypatch.setattr(write, "rounded", lambda frames, controlled: frames * 1.001)
    with pytest.raises(DatabaseError, match=r"clip0.*a quaternion whose length is off by 1\.0e-03"):
        write_database(tmp_path / "t1", entries_of(robot), robot, stages={})
    assert not (tmp_path / "t1").exists()


def test_a_fault_in_a_clip_that_is_not_read_back_is_found(robot: Robot, tmp_path: Path):
    """Of the three clips that one process writes in a call, only the first is read back."""
    entries = entries_of(robot, 3)
    clip = _motion(entries[1])
    entries[1] = dataclasses.replace(
        entries[1], clip=dataclasses.replace(clip, root_quat_w=clip.root_quat_w * np.linspace(1.0, 1.001, 60)[:, None])
    )
    with pytest.raises(DatabaseError, match=r"frame 59 has a quaternion whose length is off by 1\.0e-03") as raised:
        write_database(tmp_path / "t1", entries, robot, stages={}, pool=ClipPool(workers=1))
    (fault,) = raised.value.faults
    assert fault.startswith(file_name(clip.name))
    assert not (tmp_path / "t1").exists()


@pytest.mark.parametrize("changed", [0, 2])
def test_a_file_that_changes_before_the_last_check_is_found(robot: Robot, tmp_path: Path, monkeypatch, changed: int):
    encode, file = write.index.encode, file_name(f"source/clip{changed}@0-60~mirror")

    def change_and_encode(rows: list[dict]) -> bytes:
        path = tmp_path / ".t1.part" / file
        path.write_bytes(path.read_bytes().replace(b"0.", b"1.", 1))
        return encode(rows)

    monkeypatch.setattr(write.index, "encode", change_and_encode)
    with pytest.raises(DatabaseError, match="its content is not the one the manifest states") as raised:
        write_database(tmp_path / "t1", entries_of(robot, 3), robot, stages={}, pool=ClipPool(workers=1))
    assert [fault.partition(":")[0] for fault in raised.value.faults] == [file]
    assert not (tmp_path / "t1").exists()


def test_files_are_known_by_their_digests_where_no_frames_are_read(robot: Robot, tmp_path: Path):
    write_database(tmp_path / "t1", entries_of(robot), robot, stages={})
    assert len(check_database(tmp_path / "t1", frames=False).index) == 2
    path = tmp_path / "t1" / file_name("source/clip0@0-60~mirror")
    path.write_bytes(path.read_bytes().replace(b"Clamp", b"Wrap_"))
    with pytest.raises(DatabaseError, match="its content is not the one the manifest states"):
        check_database(tmp_path / "t1", frames=False)


def test_a_clip_file_has_the_keys_of_the_paper(robot: Robot, tmp_path: Path):
    write_database(tmp_path / "t1", entries_of(robot, 1), robot, stages={})
    content = json.loads((tmp_path / "t1" / file_name("source/clip0@0-60~mirror")).read_text())
    assert content["FrameDuration"] == 0.02
    assert content["MotionWeight"] == 1.0
    assert content["LoopMode"] == "Clamp"
    assert content["QuaternionOrder"] == "wxyz"
    assert len(content["Columns"]) == len(content["Frames"][0]) == 79
    assert set(content["Columns"][0]) == {"name", "unit", "frame"}
    assert np.linalg.norm(content["Frames"][30][3:7]) == pytest.approx(1.0, abs=1e-6)


def test_two_runs_give_the_same_bytes_whatever_the_order(robot: Robot, tmp_path: Path):
    write_database(tmp_path / "a", entries_of(robot, 3), robot, stages={})
    write_database(tmp_path / "b", entries_of(robot, 3)[::-1], robot, stages={})
    assert bytes_of(tmp_path / "a") == bytes_of(tmp_path / "b")


def test_a_deleted_clip_leaves_the_database(robot: Robot, tmp_path: Path):
    folder = tmp_path / "t1"
    write_database(folder, entries_of(robot, 3), robot, stages={})
    write_database(folder, entries_of(robot, 1), robot, stages={})
    assert len(read_database(folder).clips) == 1
    assert len(list(folder.glob("*.json"))) == 2  # the clip and the manifest


def test_a_database_of_no_clips_takes_the_place_of_none(robot: Robot, tmp_path: Path):
    folder = tmp_path / "t1"
    with pytest.raises(NoClipsError, match="no clip is left after KP5"):
        write_database(folder, [], robot, stages={})
    assert not folder.exists()
    write_database(folder, entries_of(robot), robot, stages={})
    before = bytes_of(folder)
    with pytest.raises(NoClipsError, match="what was in place is unchanged"):
        write_database(folder, [], robot, stages={})
    assert bytes_of(folder) == before


def _edit(change: Callable[[dict], None]) -> Callable[[Path], None]:
    def apply(path: Path) -> None:
        content = json.loads(path.read_text())
        change(content)
        path.write_text(json.dumps(content))

    return apply


@pytest.mark.parametrize(
    ("damage", "fault"),
    [
        (lambda path: path.unlink(), "is missing"),
        (lambda path: os.truncate(path, 500), "not JSON"),
        (_edit(lambda content: content.pop("Frames")), "the key 'Frames' is missing"),
        (_edit(lambda content: content.update(MotionWeight=-1.0)), "expected a positive number"),
        (_edit(lambda content: content.update(LoopMode="Loop")), "expected one of Clamp, Wrap"),
        (_edit(lambda content: content.update(FrameDuration=0.01)), "FrameDuration is 0.01"),
        (_edit(lambda content: content["Frames"][3].pop()), "no table of numbers"),
        (_edit(lambda content: content["Frames"][3].__setitem__(4, 0.9)), "frame 3 has a quaternion"),
        (lambda path: path.write_text(path.read_text().replace("[0.0,", "[NaN,", 1)), "is not a JSON number"),
    ],
)
def test_a_damaged_clip_is_named_with_its_fault(robot: Robot, tmp_path: Path, damage: Callable, fault: str):
    folder = tmp_path / "t1"
    write_database(folder, entries_of(robot), robot, stages={})
    name = file_name("source/clip0@0-60~mirror")
    damage(folder / name)
    with pytest.raises(DatabaseError, match=fault) as raised:
        read_database(folder)
    assert any(found.startswith(name) or name in found for found in raised.value.faults)
    with pytest.raises(DatabaseError, match=fault) as judged:
        check_database(folder)
    assert judged.value.faults == raised.value.faults


def test_all_faults_are_said_at_once(robot: Robot, tmp_path: Path):
    folder = tmp_path / "t1"
    write_database(folder, entries_of(robot), robot, stages={})
    (folder / file_name("source/clip0@0-60~mirror")).unlink()
    (folder / file_name("source/clip1@0-60~mirror")).write_text("{}")
    (folder / "stray.json").write_text("{}")
    with pytest.raises(DatabaseError) as raised:
        read_database(folder)
    text = str(raised.value)
    assert "clip0" in text
    assert "clip1" in text
    assert "stray.json: is not in the manifest" in text


def test_a_folder_that_is_no_database_is_refused(tmp_path: Path):
    with pytest.raises(DatabaseError, match="manifest\\.json: is missing"):
        read_database(tmp_path)


@pytest.mark.parametrize("weight", [0.0, -1.0, float("nan"), float("inf")])
def test_a_weight_that_is_none_is_refused(robot: Robot, tmp_path: Path, weight: float):
    entry = ExpertEntry(clip=standing(robot), weight=weight, skill="stand", licence="MIT")
    with pytest.raises(ClipError, match="must be positive"):
        write_database(tmp_path / "t1", [entry], robot, stages={})


def test_a_name_given_twice_is_refused(robot: Robot, tmp_path: Path):
    with pytest.raises(ClipError, match="given twice"):
        write_database(tmp_path / "t1", entries_of(robot, 1) * 2, robot, stages={})


@pytest.mark.parametrize(
    "name",
    [
        "../../etc/passwd",
        "/etc/passwd",
        "..",
        ".",
        "",
        "a\\b",
        "a\0b",
        "c:d",
        "é" * 300,
        "x" * 400,
        "index.parquet",
        "manifest",
        "manifest",
    ],
)
def test_a_file_name_stays_in_its_folder(name: str):
    made = file_name(name)
    assert Path(made).name == made
    assert not made.startswith(".")
    assert len(made.encode()) < 200
    assert made not in ("manifest.json", "index.parquet")


def test_clips_that_look_alike_have_files_of_their_own():
    names = ["a/b", "a__b", "A/b", "a/B", "a b", "a_b", "a?b", "x" * 400, "x" * 401, "manifest", "index"]
    assert len({file_name(name).lower() for name in names}) == len(names)


def test_whole_numbers_of_the_index_stay_whole_and_others_do_not(robot: Robot, tmp_path: Path):
    entries = entries_of(robot, 2)
    said = [{"start_frame": 0, "filled_frames": 2**53 + 1, "limit": 1}, {"start_frame": 86, "limit": 0.5}]
    entries = [dataclasses.replace(one, numbers=numbers) for one, numbers in zip(entries, said, strict=True)]
    write_database(tmp_path / "t1", entries, robot, stages={})
    table = pq.read_table(tmp_path / "t1" / "index.parquet")
    types = {name: str(table.schema.field(name).type) for name in ("start_frame", "filled_frames", "limit")}
    assert types == {"start_frame": "int64", "filled_frames": "int64", "limit": "double"}
    assert table.column("start_frame").to_pylist() == [0, 86]
    assert table.column("filled_frames").to_pylist() == [2**53 + 1, None]
    assert table.column("limit").to_pylist() == [1.0, 0.5]
