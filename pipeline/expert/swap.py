"""A folder replaced as a whole: its readers find the old one or the new one, complete.

The new folder is filled beside the old one as `.<name>.part`. Where the system can exchange two names in one
step (Linux), that is done; elsewhere the old one is moved to `.<name>.old` first, and `current` finds it there
should the writer die between the two moves. Leftovers of a killed writer are cleared by the next one.
"""

from __future__ import annotations

import ctypes
import errno
import fcntl
import os
import shutil
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

from pipeline.errors import FileError

_AT_FDCWD = -100
_RENAME_EXCHANGE = 2
_NOT_ABLE = (errno.ENOSYS, errno.EINVAL, errno.ENOTSUP)


def replace_folder(folder: Path, fill: Callable[[Path], None]) -> None:
    """Make `folder` hold what `fill` writes into the empty folder it is given, and nothing else.

    Whatever `fill` raises is passed on and the old folder stays as it was. Raises FileError when the disk
    refuses or another writer is at work.
    """
    folder.parent.mkdir(parents=True, exist_ok=True)
    part, old = _beside(folder, "part"), _beside(folder, "old")
    with _only_writer(folder):
        _recover(folder, part, old)
        part.mkdir()
        try:
            fill(part)
            _sync(part)
        except OSError as error:
            _remove(part)
            raise FileError(folder, f"could not be written ({error}); the previous version is unchanged.") from error
        except BaseException:
            _remove(part)
            raise
        _swap(folder, part, old)


def current(folder: Path) -> Path:
    """Where the complete folder is: at its name, or aside if a writer died while moving it."""
    old = _beside(folder, "old")
    return old if not folder.exists() and old.is_dir() else folder


def _swap(folder: Path, part: Path, old: Path) -> None:
    if not folder.exists():
        part.rename(folder)
    elif _exchange(part, folder):
        _remove(part)
    else:
        folder.rename(old)
        part.rename(folder)
        _remove(old)
    _sync_folder(folder.parent)


def _exchange(first: Path, second: Path) -> bool:
    """Exchange two names in one step; False where the system or file system can't."""
    renameat2 = getattr(ctypes.CDLL(None, use_errno=True), "renameat2", None)
    if renameat2 is None:
        return False
    done = renameat2(_AT_FDCWD, os.fsencode(first), _AT_FDCWD, os.fsencode(second), ctypes.c_uint(_RENAME_EXCHANGE))
    if done == 0:
        return True
    code = ctypes.get_errno()
    if code in _NOT_ABLE:
        return False
    raise FileError(second, f"could not be exchanged with the new version ({os.strerror(code)}).")


def _recover(folder: Path, part: Path, old: Path) -> None:
    if old.is_dir() and not folder.exists():
        old.rename(folder)
    _remove(part)
    _remove(old)


def _beside(folder: Path, what: str) -> Path:
    return folder.with_name(f".{folder.name}.{what}")


def _remove(folder: Path) -> None:
    if folder.exists():
        shutil.rmtree(folder)


def _sync(folder: Path) -> None:
    for path in sorted(folder.iterdir()):
        with path.open("rb") as stream:
            os.fsync(stream.fileno())
    _sync_folder(folder)


def _sync_folder(folder: Path) -> None:
    handle = os.open(folder, os.O_RDONLY)
    try:
        os.fsync(handle)
    finally:
        os.close(handle)


@contextmanager
def _only_writer(folder: Path) -> Iterator[None]:
    path = _beside(folder, "lock")
    with path.open("a") as stream:
        try:
            fcntl.flock(stream, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError as error:
            raise FileError(folder, "is being written by another process.", "Wait until it has ended.") from error
        yield
