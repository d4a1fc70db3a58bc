"""Writes that are whole or not there, and blobs that are what their name says."""

import os
import signal
import subprocess
import sys

import pytest

from pipeline.errors import FileError
from pipeline.files import atomic
from pipeline.files.blob_store import BlobStore

KILLED_WRITER = """
import os, sys
from pathlib import Path
from pipeline.files import atomic
real = os.fsync
def killed(handle):
    os.kill(os.getpid(), 9)
os.fsync = killed
atomic.write_bytes(Path(sys.argv[1]), b"new" * 100000)
"""


def test_a_writer_killed_before_the_end_leaves_the_old_file(tmp_path, root):
    path = tmp_path / "file"
    atomic.write_bytes(path, b"old")
    done = subprocess.run([sys.executable, "-c", KILLED_WRITER, str(path)], cwd=root, check=False)
    assert done.returncode == -signal.SIGKILL
    assert path.read_bytes() == b"old"


def test_a_refusing_disk_is_told_with_the_free_space_and_leaves_nothing(tmp_path, monkeypatch):
    def full(handle):
        raise OSError(28, "No space left on device")

    path = tmp_path / "file"
    atomic.write_bytes(path, b"old")
    monkeypatch.setattr(os, "fsync", full)
    with pytest.raises(FileError, match=r"No space left on device.*MB are free"):
        atomic.write_bytes(path, b"new")
    assert path.read_bytes() == b"old"
    assert [each.name for each in tmp_path.iterdir()] == ["file"]


def test_a_blob_is_read_back_and_a_changed_one_is_refused(tmp_path):
    store = BlobStore(root=tmp_path)
    blob = store.put(b"frames")
    assert store.get(blob) == b"frames"
    store.path(blob).write_bytes(b"framed")
    with pytest.raises(FileError, match="content does not match its name"):
        store.get(blob)


def test_a_missing_blob_says_what_to_do(tmp_path):
    with pytest.raises(FileError, match=r"missing.*materialize again"):
        BlobStore(root=tmp_path).get("ab" * 32)
