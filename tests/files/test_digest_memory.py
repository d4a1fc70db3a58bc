"""Digests that are remembered: a file that was changed is read again, whatever its times say."""

import os
import time
from pathlib import Path

import pytest

from pipeline.files import digest
from pipeline.files.blob_store import DigestMemory


@pytest.fixture
def settled(tmp_path: Path, monkeypatch) -> Path:
    """A file that counts as quiet, and a memory that has read it."""
    monkeypatch.setattr("pipeline.files.blob_store.SETTLED_NS", 0)
    path = tmp_path / "log.mcap"
    path.write_bytes(b"a log of the robot")
    memory = DigestMemory(tmp_path / "memory.json")
    assert memory.of(path) == digest.of_bytes(b"a log of the robot")
    memory.save()
    return path


def reads(monkeypatch) -> list[Path]:
    """The files that are read from now on."""
    found, of_file = [], digest.of_file
    monkeypatch.setattr("pipeline.files.blob_store.digest.of_file", lambda path: found.append(path) or of_file(path))
    return found


def test_a_file_that_nobody_touched_is_not_read_again(settled, tmp_path, monkeypatch):
    read = reads(monkeypatch)
    assert DigestMemory(tmp_path / "memory.json").of(settled) == digest.of_bytes(b"a log of the robot")
    assert read == []


def test_a_file_changed_in_place_with_equal_size_and_time_is_read_again(settled, tmp_path):
    before = settled.stat()
    time.sleep(0.02)
    with settled.open("r+b") as stream:
        stream.write(b"A")
    os.utime(settled, ns=(before.st_atime_ns, before.st_mtime_ns))
    after = settled.stat()
    assert (after.st_size, after.st_mtime_ns) == (before.st_size, before.st_mtime_ns)
    assert DigestMemory(tmp_path / "memory.json").of(settled) == digest.of_bytes(b"A log of the robot")


def test_a_file_that_changed_just_now_is_not_remembered(tmp_path, monkeypatch):
    path = tmp_path / "log.mcap"
    path.write_bytes(b"a log")
    memory = DigestMemory(tmp_path / "memory.json")
    memory.of(path)
    read = reads(monkeypatch)
    memory.of(path)
    assert read == [path]


@pytest.mark.parametrize("text", ["null", "[]", "3", "{", '{"%s": null}', '{"%s": [1, 2]}', '{"%s": {"a": 1}}'])
def test_a_memory_that_is_not_one_counts_as_empty(tmp_path, text):
    path, memory = tmp_path / "log.mcap", tmp_path / "memory.json"
    path.write_bytes(b"a log")
    memory.write_text(text.replace("%s", str(path)))
    assert DigestMemory(memory).of(path) == digest.of_bytes(b"a log")
