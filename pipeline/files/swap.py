"""Replace a folder atomically: readers find the complete old or new one.

The new folder is written next to the old one as `.<name>.part`. On Linux the two names are exchanged in one step;
elsewhere the old one is first moved to `.<name>.old`, where `current` finds it if the writer dies between the two
moves. The next writer removes leftovers of a killed one, including a version that was not yet kept.
"""

import ctypes
import errno
import fcntl
import os
import shutil
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

from pipeline.errors import FileError
from pipeline.files import atomic

_AT_FDCWD = -100
_RENAME_EXCHANGE = 2
_NOT_ABLE = (errno.ENOSYS, errno.EINVAL, errno.ENOTSUP)


def replace_folder(
    folder: Path,
    fill: Callable[[Path], None],
    *,
    check: Callable[[Path], None] | None = None,
    keep: Callable[[Path], object] | None = None,
) -> None:
    """Replace `folder` by a new folder with the files that `fill` writes.

    If `folder` is a link, its target is replaced. Errors of `fill` and `check` are raised and the old folder is
    unchanged. Raises FileError on disk errors, if `folder` is a file or if another writer is active.

    Args:
        folder: folder to replace
        fill: writes the files into the empty folder that it is given
        check: checks the new folder before the replacement; it may move it away when it raises
        keep: moves the old folder away after the replacement; None: the old one is removed
    """
    folder = target_of(folder)
    if folder.exists() and not folder.is_dir():
        raise FileError(folder, "it is a file; a folder is written here.", "Move it away.")
    part, old = beside(folder, "part"), beside(folder, "old")
    with _only_writer(folder):
        try:
            _recover(folder, part, old)
            part.mkdir()
            fill(part)
            atomic.sync([f"{where}/{name}" for where, _, names in os.walk(part) for name in names])
            if check is not None:
                check(part)
        except OSError as error:
            _remove(part)
            raise FileError(folder, f"could not be written ({error}); the previous version is unchanged.") from error
        except BaseException:
            _remove(part)
            raise
        try:
            _swap(folder, part, old, keep or _remove)
        except OSError as error:
            raise FileError(folder, f"the previous version could not be replaced and kept ({error}).") from error


def put_in_place(folder: Path, version: Path, keep: Callable[[Path], object]) -> None:
    """Replace `folder` by the complete folder `version` (same file system); `keep` moves the old one away.

    Raises FileError on disk errors or if another writer is active.
    """
    folder = target_of(folder)
    part, old = beside(folder, "part"), beside(folder, "old")
    with _only_writer(folder):
        _recover(folder, part, old)
        try:
            version.rename(part)
        except OSError as error:
            raise FileError(folder, f"could not be replaced ({error}); it is unchanged.") from error
        _swap(folder, part, old, keep)


def current(folder: Path) -> Path:
    """Path of the complete folder: its own, or `.<name>.old` if a writer died while moving it."""
    old = beside(folder, "old")
    return old if not folder.exists() and old.is_dir() else folder


def target_of(folder: Path) -> Path:
    """The folder itself, or the target if it is a link."""
    return Path(os.path.realpath(folder)) if folder.is_symlink() else folder


def _swap(folder: Path, part: Path, old: Path, keep: Callable[[Path], object]) -> None:
    if not folder.exists():
        part.rename(folder)
    elif _exchange(part, folder):
        keep(part)
    else:
        folder.rename(old)
        part.rename(folder)
        keep(old)
    atomic.sync([folder])


def _exchange(first: Path, second: Path) -> bool:
    """Exchange two names in one step; False if the system does not support it."""
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


def beside(folder: Path, what: str) -> Path:
    """Path next to a folder for a file that belongs to it; for a link, next to its target."""
    folder = target_of(folder)
    return folder.with_name(f".{folder.name}.{what}")


def _remove(folder: Path) -> None:
    if folder.is_symlink() or folder.is_file():
        folder.unlink()
    elif folder.exists():
        shutil.rmtree(folder)


@contextmanager
def _only_writer(folder: Path) -> Iterator[None]:
    path = beside(folder, "lock")
    try:
        folder.parent.mkdir(parents=True, exist_ok=True)
        stream = path.open("a")
    except OSError as error:
        raise FileError(folder, f"could not be written ({error}); what was there is unchanged.") from error
    with stream:
        try:
            fcntl.flock(stream, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError as error:
            raise FileError(folder, "is being written by another process.", "Wait until it has ended.") from error
        yield
