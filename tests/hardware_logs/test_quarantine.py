"""Sentences on refused logs are written where they can be, and never keep other logs from being read."""

import re
from pathlib import Path

import pytest

from pipeline.hardware_logs.log_folder import note_refusals, text_paths


def texts(folder: Path) -> dict[str, str]:
    return {path.relative_to(folder).as_posix(): path.read_text() for path in folder.rglob("*") if path.is_file()}


def test_a_text_for_each_refused_log_and_no_other(tmp_path):
    assert note_refusals(tmp_path, {"a": "a is bad.", "day/b": "b is bad."}) == []
    assert texts(tmp_path) == {"a.txt": "a is bad.\n", "day/b.txt": "b is bad.\n"}
    assert note_refusals(tmp_path, {"a": "a is worse."}) == []
    assert texts(tmp_path) == {"a.txt": "a is worse.\n"}
    assert [path.name for path in tmp_path.iterdir()] == ["a.txt"]


@pytest.mark.parametrize("name", ["r" * 246, "é" * 123, "r" * 246 + "/x", "日" * 80, "\udcff" * 240])
def test_a_name_that_is_too_long_is_shortened(tmp_path, name):
    assert note_refusals(tmp_path, {name: "it is bad.", name[:-1] + "y": "so is this."}) == []
    assert sorted(texts(tmp_path).values()) == ["it is bad.\n", "so is this.\n"]
    assert all(path.startswith(name[:50]) and "/" not in path for path in texts(tmp_path))
    assert note_refusals(tmp_path, {}) == []
    assert texts(tmp_path) == {}


def test_a_folder_that_is_named_like_a_file_is_no_text(tmp_path):
    for refused in ({"session.txt/bad": "it is bad."}, {"session.txt/bad": "it is bad."}, {}):
        assert note_refusals(tmp_path, refused) == []
        assert sorted(texts(tmp_path).values()) == [f"{text}\n" for text in refused.values()]


def test_a_text_and_a_folder_of_one_name_are_both_kept(tmp_path):
    refused = {"session": "it is bad.", "session.txt/bad": "so is this."}
    paths = text_paths(list(refused))
    assert paths["session.txt/bad"] == "session.txt/bad.txt"
    assert re.fullmatch(r"session-[0-9a-f]{12}\.txt", paths["session"])
    for _ in range(2):
        assert note_refusals(tmp_path, refused) == []
        assert sorted(texts(tmp_path).values()) == ["it is bad.\n", "so is this.\n"]


def test_what_cannot_be_written_is_said_and_the_rest_is_written(tmp_path):
    (tmp_path / "a.txt").mkdir()
    (tmp_path / "a.txt" / "of somebody").write_text("else")
    (problem,) = note_refusals(tmp_path, {"a": "a is bad.", "b": "b is bad."})
    assert "a.txt" in problem
    assert texts(tmp_path) == {"a.txt/of somebody": "else", "b.txt": "b is bad.\n"}


def test_a_folder_that_cannot_be_made_is_said_for_each_log(tmp_path):
    (tmp_path / "quarantine").write_text("a file")
    problems = note_refusals(tmp_path / "quarantine", {"a": "a is bad.", "b": "b is bad."})
    assert len(problems) == 2
    assert all("can't be written" in problem for problem in problems)
