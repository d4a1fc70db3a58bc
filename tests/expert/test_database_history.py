"""Versions of a database: kept, compared, put aside when too much is lost, and brought back."""

import json
import shutil
from pathlib import Path

import pytest

from pipeline.batch.collect import alone
from pipeline.cli.main import main
from pipeline.errors import FileError, UnknownNameError
from pipeline.expert import (
    DatabaseError,
    DatabaseLossError,
    DatabaseSettings,
    ExpertEntry,
    history,
    read_database,
    write_database,
)
from pipeline.robot import Robot, load_robot
from tests.factories.robot_clips import wandering

SETTINGS = DatabaseSettings(max_lost_share=0.5, kept_versions=2)


def write(folder: Path, robot: Robot, count: int, frames: int = 60, settings: DatabaseSettings = SETTINGS) -> None:
    """A database of so many clips, of two sources in turn."""
    entries = [
        ExpertEntry(
            clip=wandering(robot, seed=index).cut(0, frames, f"source{index % 2}/clip{index}"),
            weight=1.0,
            skill="walk",
            licence="CC0-1.0",
            numbers={"source": f"source{index % 2}"},
        )
        for index in range(count)
    ]
    write_database(folder, entries, robot, stages={}, settings=settings)


def clips(folder: Path) -> int:
    return len(read_database(folder).clips)


def test_earlier_versions_are_kept_the_oldest_go(robot: Robot, tmp_path: Path):
    folder = tmp_path / "t1"
    for count in (4, 5, 6, 7):
        write(folder, robot, count)
    assert clips(folder) == 7
    assert [each.clips for each in history.read_versions(folder)] == [6, 5]
    assert history.read_versions(folder)[0].by_source == {"source0": 3, "source1": 3}


def test_a_database_that_lost_too_much_is_put_aside_and_can_be_put_in_place(robot: Robot, tmp_path: Path):
    folder = tmp_path / "t1"
    write(folder, robot, 7)
    with pytest.raises(DatabaseLossError, match=r"3 of 7 clips .*source0 2 of 4, source1 1 of 3") as raised:
        write(folder, robot, 3)
    assert clips(folder) == 7
    (refused,) = history.read_versions(folder)
    assert refused.name.endswith(history.REFUSED)
    assert f"booster-lab database restore {refused.name} --robot t1" in str(raised.value)
    assert history.restore(folder, refused.name).clips == 3
    assert clips(folder) == 3
    write(folder, robot, 3)
    assert [each.clips for each in history.read_versions(folder)] == [3, 7]


def test_seconds_count_as_well_as_clips(robot: Robot, tmp_path: Path):
    folder = tmp_path / "t1"
    write(folder, robot, 4, frames=100)
    with pytest.raises(DatabaseLossError, match=r"4 of 4 clips and 3\.2 of 8\.0 s"):
        write(folder, robot, 4, frames=40)
    write(folder, robot, 4, frames=40, settings=DatabaseSettings(max_lost_share=1.0, kept_versions=2))
    assert clips(folder) == 4


def test_a_damaged_database_in_place_is_compared_by_its_history(robot: Robot, tmp_path: Path):
    folder = tmp_path / "t1"
    write(folder, robot, 6)
    write(folder, robot, 7)
    (folder / "manifest.json").write_text("null")
    with pytest.raises(DatabaseLossError, match="2 of 6 clips"):
        write(folder, robot, 2)


def test_refused_versions_do_not_push_out_good_ones(robot: Robot, tmp_path: Path):
    folder = tmp_path / "t1"
    for count in (8, 9, 10):
        write(folder, robot, count)
    for count in (1, 2, 3, 4):
        with pytest.raises(DatabaseLossError):
            write(folder, robot, count)
    assert [each.clips for each in history.read_versions(folder)] == [4, 3, 9, 8]


def test_a_damaged_version_is_not_put_in_place(robot: Robot, tmp_path: Path):
    folder = tmp_path / "t1"
    write(folder, robot, 4)
    write(folder, robot, 5)
    (version,) = history.read_versions(folder)
    victim = next(path for path in version.folder.glob("*.json") if path.name != "manifest.json")
    victim.write_text("{}")
    with pytest.raises(DatabaseError, match="its content is not the one the manifest states"):
        history.restore(folder, version.name)
    assert clips(folder) == 5
    with pytest.raises(UnknownNameError, match="unknown version '0009-0'"):
        history.restore(folder, "0009-0")


def test_a_database_folder_that_is_a_link_is_written_where_it_leads(robot: Robot, tmp_path: Path):
    disk, folder = tmp_path / "disk", tmp_path / "data" / "t1"
    disk.mkdir()
    folder.parent.mkdir()
    folder.symlink_to(disk / "t1")
    for count in (4, 5):
        write(folder, robot, count)
        assert folder.is_symlink()
        assert clips(folder) == clips(disk / "t1") == count
    assert sorted(path.name for path in folder.parent.iterdir()) == ["t1"]
    (version,) = history.read_versions(folder)
    assert history.restore(folder, version.name).clips == 4
    assert folder.is_symlink()


def test_what_is_left_of_a_link_that_was_exchanged_is_cleared(robot: Robot, tmp_path: Path):
    folder = tmp_path / "t1"
    write(folder, robot, 2)
    (tmp_path / ".t1.part").symlink_to(tmp_path / "gone")
    write(folder, robot, 3)
    assert clips(folder) == 3
    (tmp_path / "t2").write_text("a file")
    with pytest.raises(FileError, match="it is a file; a folder is written here"):
        write(tmp_path / "t2", robot, 2)


def test_a_manifest_that_was_edited_is_refused(robot: Robot, tmp_path: Path):
    folder = tmp_path / "t1"
    write(folder, robot, 2)
    path = folder / "manifest.json"
    head = json.loads(path.read_text())
    for change, match in (({"seconds": 99.0}, "was changed"), ({"sha256": None}, "was changed")):
        path.write_text(json.dumps({**head, **change}))
        with pytest.raises(DatabaseError, match=match):
            read_database(folder)
    path.write_text(json.dumps({key: value for key, value in head.items() if key != "sha256"}))
    with pytest.raises(DatabaseError, match="carries no digest of itself"):
        read_database(folder)


@pytest.fixture
def project(tmp_path: Path, root: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A project without databases, which commands are typed in."""
    (tmp_path / "data").mkdir()
    (tmp_path / "robots").symlink_to(root / "robots")
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.mark.parametrize(("name", "asset"), [("t1", "expert_db"), ("k1", "k1/expert_db")])
def test_a_summary_names_the_command_that_makes_the_database(project: Path, capsys, name: str, asset: str):
    assert main(["database", "summary", "--robot", name]) == 1
    expected = f"there is no database of '{name}' yet; make it with: dagster asset materialize --select {asset}\n"
    assert capsys.readouterr().err.endswith(expected)


@pytest.mark.parametrize(("name", "option"), [("t1", ""), ("k1", " --robot k1")])
def test_a_summary_ends_in_the_commands_of_its_robot(project: Path, capsys, name: str, option: str):
    write(project / "data/expert_db" / name, load_robot(name), 2)
    assert main(["database", "summary", "--robot", name]) == 0
    commands = [line.strip().split("  ")[0] for line in capsys.readouterr().out.splitlines()[-4:]]
    assert commands[0] == f"booster-lab curate{option}"
    assert commands[2] == f"booster-lab play robots/{name}/policies/walk{option}"


def test_a_summary_of_a_robot_without_a_policy_names_none(root: Path, project: Path, capsys):
    """A robot that was just added."""
    (project / "robots").unlink()
    shutil.copytree(root / "robots/k1", project / "robots/k1", ignore=shutil.ignore_patterns("policies"))
    write(project / "data/expert_db/k1", load_robot("k1"), 2)
    assert main(["database", "summary", "--robot", "k1"]) == 0
    assert "booster-lab play" not in capsys.readouterr().out


def test_the_command_lists_and_restores(robot: Robot, project: Path, capsys):
    folder = project / "data/expert_db/t1"
    write(folder, robot, 4)
    assert main(["database", "restore", "0000-nothing"]) == 1
    assert "unknown version '0000-nothing'; there are none" in capsys.readouterr().err
    write(folder, robot, 5)
    assert main(["database", "list"]) == 0
    printed = capsys.readouterr().out.splitlines()
    assert [line.split()[1] for line in printed[1:]] == ["5", "4"]
    assert main(["database", "restore", printed[2].split()[0]]) == 0
    assert clips(folder) == 4
    assert main(["database", "restore", "0000-nothing"]) == 1
    assert "unknown version" in capsys.readouterr().err


def test_a_version_that_a_person_restored_is_known_until_another_one_is_written(robot: Robot, tmp_path: Path):
    folder = tmp_path / "t1"
    for count in (4, 5):
        write(folder, robot, count)
    assert not history.was_restored(folder)
    history.restore(folder, history.read_versions(folder)[0].name)
    assert clips(folder) == 4 and history.was_restored(folder)
    write(folder, robot, 5)
    assert not history.was_restored(folder)


def test_no_version_is_restored_while_a_run_works_on_the_store(robot: Robot, project: Path, capsys):
    folder, store = project / "data/expert_db/t1", project / "data/store"
    for count in (4, 5):
        write(folder, robot, count)
    store.mkdir()
    with alone(store, "run 7f29"):
        assert main(["database", "restore", history.read_versions(folder)[0].name]) == 1
    assert "run 7f29 is working on the store; try again" in capsys.readouterr().err and clips(folder) == 5
