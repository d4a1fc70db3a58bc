"""The code of `docs/add_a_format.md`, taken from the page and run."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from pipeline.readers import read_motion as package_read_motion
from pipeline.readers.read_motion import _READERS


@pytest.fixture
def blocks(root: Path, monkeypatch) -> list[str]:
    """Reader, registration and tests of the page; the reader is registered."""
    found = re.findall(r"```python\n(.*?)```", (root / "docs" / "add_a_format.md").read_text(), re.DOTALL)
    reader, registration, _ = found
    names = dict(vars(__import__("pipeline.readers.read_motion", fromlist=["_robot"])))
    exec(compile(reader, "robot_jsonl.py", "exec"), names)
    exec(compile(registration, "read_motion.py", "exec"), names)
    monkeypatch.setitem(_READERS, ".jsonl", names["_read_jsonl"])
    return found


def test_the_guides_own_tests_pass(blocks: list[str], tmp_path: Path, robot):
    names: dict = {}
    exec(compile(blocks[2], "test_read_robot_jsonl.py", "exec"), names)
    names["test_positions_joints_and_rate_arrive"](tmp_path, robot)
    names["test_a_broken_line_is_named"](tmp_path)
    assert len([name for name in names if name.startswith("test_")]) == 2


def test_the_guides_reader_refuses_times_that_do_not_increase(blocks: list[str], tmp_path: Path):
    row = '{"t": 0, "pos": [0, 0, 1], "quat_wxyz": [1, 0, 0, 0], "joints": {"a": 0}}\n'
    (tmp_path / "walk.jsonl").write_text(2 * row)
    with pytest.raises(Exception, match=r"t must increase"):
        package_read_motion(tmp_path / "walk.jsonl", "walk")


def test_the_guides_code_is_formatted(blocks: list[str]):
    assert max(len(line) for block in blocks for line in block.splitlines()) <= 120
