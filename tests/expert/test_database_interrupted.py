"""A database in place stays whole while another is written that breaks, is killed, or is written twice at once."""

from pathlib import Path

import pytest

from pipeline.errors import FileError
from pipeline.expert import read_database, write_database
from pipeline.files import swap
from pipeline.robot import Robot
from tests.factories.database_entries import bytes_of, entries_of


class _BreakError(Exception):
    pass


def test_a_write_that_breaks_in_the_middle_leaves_the_old_one(
    robot: Robot, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    folder = tmp_path / "t1"
    write_database(folder, entries_of(robot), robot, stages={})
    before = bytes_of(folder)

    def broken(*_: object) -> bytes:
        raise _BreakError

    with monkeypatch.context() as patch:
        patch.setattr("pipeline.expert.write.index.encode", broken)
        with pytest.raises(_BreakError):
            write_database(folder, entries_of(robot, 5), robot, stages={})
    assert bytes_of(folder) == before
    assert len(read_database(folder).clips) == 2


def test_what_a_killed_writer_left_is_cleared_by_the_next(robot: Robot, tmp_path: Path):
    folder = tmp_path / "t1"
    write_database(folder, entries_of(robot), robot, stages={})
    part = tmp_path / ".t1.part"
    part.mkdir()
    (part / "half.json").write_text('{"Frames": [[')
    assert len(read_database(folder).clips) == 2
    write_database(folder, entries_of(robot, 3), robot, stages={})
    assert not part.exists()
    assert len(read_database(folder).clips) == 3


@pytest.mark.parametrize("step", ["after the old one is aside", "after the new one is in place"])
def test_a_writer_killed_between_two_renames_leaves_a_whole_database(
    robot: Robot, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, step: str
):
    folder = tmp_path / "t1"
    write_database(folder, entries_of(robot), robot, stages={})
    monkeypatch.setattr(swap, "_exchange", lambda *_: False)  # a system that can't exchange two names
    rename, calls = Path.rename, []

    def killed(self: Path, target: Path) -> Path:
        calls.append(self.name)
        if len(calls) == (2 if step.startswith("after the old") else 3):
            raise _BreakError
        return rename(self, target)

    def killed_remove(_: Path) -> None:
        raise _BreakError

    with monkeypatch.context() as patch:
        patch.setattr(Path, "rename", killed)
        if step.startswith("after the new"):
            patch.setattr(swap, "_remove", lambda path: killed_remove(path) if path.exists() else None)
        with pytest.raises(_BreakError):
            write_database(folder, entries_of(robot, 3), robot, stages={})
    assert len(read_database(folder).clips) == (2 if step.startswith("after the old") else 3)
    write_database(folder, entries_of(robot, 1), robot, stages={})
    assert len(read_database(folder).clips) == 1
    assert sorted(path.name for path in tmp_path.iterdir()) == [".t1.lock", "t1"]


def test_two_writers_at_once_are_told_apart(robot: Robot, tmp_path: Path):
    def second(part: Path) -> None:
        write_database(tmp_path / "t1", [], robot, stages={})

    with pytest.raises(FileError, match="another process"):
        swap.replace_folder(tmp_path / "t1", second)
