"""Writes that are whole or not there, and blobs that are what their name says."""

import errno
import os
import signal
import stat
import subprocess
import sys
import tempfile
from pathlib import Path
from types import SimpleNamespace

import pytest

from pipeline.errors import FileError
from pipeline.files import atomic
from pipeline.files.blob_store import BlobStore, StoreError

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


def test_the_new_name_and_the_folders_made_for_it_are_synced_after_the_rename(tmp_path, monkeypatch):
    path, synced, real = tmp_path / "a" / "b" / "file", [], os.fsync

    def watched(handle):
        synced.append((os.fstat(handle).st_ino, path.exists()))
        real(handle)

    monkeypatch.setattr(os, "fsync", watched)
    atomic.write_bytes(path, b"new")
    content, *folders = synced
    assert content == (path.stat().st_ino, False)
    assert folders == [(folder.stat().st_ino, True) for folder in (path.parent, path.parent.parent, tmp_path)]
    synced.clear()
    atomic.write_bytes(path, b"newer")
    assert [inode for inode, _ in synced] == [path.stat().st_ino, path.parent.stat().st_ino]


def test_what_can_be_made_again_is_whole_without_being_synced(tmp_path, monkeypatch):
    monkeypatch.setattr(os, "fsync", None)
    atomic.write_unsynced(tmp_path / "a" / "file", b"new", 5_000_000_000)
    assert (tmp_path / "a" / "file").read_bytes() == b"new"
    assert (tmp_path / "a" / "file").stat().st_mtime == 5.0
    with pytest.raises(FileError, match=r"a: could not be written .* are free"):
        atomic.write_unsynced(tmp_path / "a", b"new")
    assert sorted(path.name for path in tmp_path.rglob("*")) == ["a", "file"]


def test_files_are_synced_before_the_names_in_their_folders(tmp_path, monkeypatch):
    synced, real = [], os.fsync

    def watched(handle):
        synced.append(os.fstat(handle).st_ino)
        real(handle)

    files = [tmp_path / "a" / "one", tmp_path / "b" / "two"]
    for file in files:
        atomic.write_unsynced(file, b"new")
    monkeypatch.setattr(os, "fsync", watched)
    atomic.sync(files)
    assert set(synced[:2]) == {file.stat().st_ino for file in files}
    assert set(synced[2:]) == {file.parent.stat().st_ino for file in files}


def test_a_file_that_cannot_be_synced_is_no_folder_that_need_not_be(tmp_path, monkeypatch):
    def refuse(handle):
        raise OSError(errno.EINVAL, "Invalid argument")

    (tmp_path / "file").write_bytes(b"new")
    monkeypatch.setattr(os, "fsync", refuse)
    with pytest.raises(OSError, match="Invalid argument"):
        atomic.sync([tmp_path / "file"])


def test_a_file_system_that_syncs_no_folders_is_written_to_all_the_same(tmp_path, monkeypatch):
    def files_only(handle):
        if stat.S_ISDIR(os.fstat(handle).st_mode):
            raise OSError(22, "Invalid argument")

    monkeypatch.setattr(os, "fsync", files_only)
    atomic.write_bytes(tmp_path / "file", b"new")
    assert (tmp_path / "file").read_bytes() == b"new"


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


@pytest.mark.parametrize("error", [errno.EROFS, errno.EACCES, errno.ENOSPC, errno.EDQUOT])
def test_a_folder_that_takes_no_file_is_told_in_one_sentence(tmp_path, monkeypatch, error):
    def refuse(*arguments, **more):
        raise OSError(error, os.strerror(error))

    path = tmp_path / "new" / "file"
    monkeypatch.setattr(tempfile, "mkstemp", refuse)
    with pytest.raises(FileError, match=rf"file: could not be written \(.*{os.strerror(error)}.*MB are free"):
        atomic.write_bytes(path, b"new")
    assert not path.exists()


@pytest.mark.parametrize("call", ["mkdir", "exists"])
def test_a_folder_that_may_not_be_made_or_looked_into_is_told(tmp_path, monkeypatch, call):
    def refuse(*arguments, **more):
        raise PermissionError(errno.EACCES, "Permission denied")

    path = tmp_path / "locked" / "new" / "file"
    monkeypatch.setattr(Path, call, refuse)
    with pytest.raises(FileError, match=r"file: could not be written \(.*Permission denied.*MB are free"):
        atomic.write_bytes(path, b"new")


def test_a_name_that_is_too_long_is_told(tmp_path):
    with pytest.raises(FileError, match=r"could not be written \(.*too long.*MB are free"):
        atomic.write_bytes(tmp_path / ("x" * 300) / "file", b"new")


def test_a_disk_that_also_keeps_what_was_begun_is_told(tmp_path, monkeypatch):
    def refuse(*arguments, **more):
        raise OSError(errno.EIO, "Input/output error")

    monkeypatch.setattr(os, "fsync", refuse)
    monkeypatch.setattr(Path, "unlink", refuse)
    with pytest.raises(FileError, match="Input/output error"):
        atomic.write_bytes(tmp_path / "file", b"new")


def test_a_file_where_a_folder_should_be_is_told(tmp_path):
    (tmp_path / "folder").write_text("no folder")
    with pytest.raises(FileError, match=r"could not be written \(.*folder"):
        atomic.write_bytes(tmp_path / "folder" / "file", b"new")
    assert (tmp_path / "folder").read_text() == "no folder"


def test_a_full_table_of_names_is_told(tmp_path, monkeypatch):
    found = os.statvfs(tmp_path)
    full = SimpleNamespace(f_bavail=found.f_bavail, f_frsize=found.f_frsize, f_files=10, f_favail=0)
    monkeypatch.setattr(os, "statvfs", lambda folder: full)
    monkeypatch.setattr(os, "fsync", _full)
    with pytest.raises(FileError, match=r"MB and no more names are free"):
        atomic.write_bytes(tmp_path / "file", b"new")


def _full(handle: int) -> None:
    raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))


def test_a_blob_is_read_back_and_a_changed_one_is_refused(tmp_path):
    store = BlobStore(root=tmp_path)
    blob = store.put(b"frames")
    assert store.get(blob) == b"frames"
    store.path(blob).write_bytes(b"framed")
    with pytest.raises(StoreError, match="content does not match its name"):
        store.get(blob)
    assert not store.has(blob), "it is removed, so that it is made again"
    assert store.get(store.put(b"frames")) == b"frames"


def test_a_blob_is_not_forced_to_the_disk(tmp_path, monkeypatch):
    monkeypatch.setattr(os, "fsync", None)
    store = BlobStore(root=tmp_path)
    assert store.get(store.put(b"frames")) == b"frames"


def test_a_missing_blob_says_what_to_do(tmp_path):
    with pytest.raises(FileError, match=r"missing.*Materialize again"):
        BlobStore(root=tmp_path).get("ab" * 32)


def test_parts_are_written_one_after_the_other_and_one_that_fails_leaves_the_old_file(tmp_path):
    path = tmp_path / "file"
    atomic.write_parts(path, iter([b"one ", b"two"]))
    assert path.read_bytes() == b"one two"

    def failing():
        yield b"new"
        raise ValueError("no number")

    with pytest.raises(ValueError, match="no number"):
        atomic.write_parts(path, failing())
    assert path.read_bytes() == b"one two"
    assert list(tmp_path.iterdir()) == [path]
