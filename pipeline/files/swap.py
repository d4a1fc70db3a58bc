"""A folder replaced as a whole: its readers find the old one or the new one, complete.

The new folder is filled beside the old one as `.<name>.part`. Where the system can exchange two names in one
step (Linux), that is done; elsewhere the old one is moved to `.<name>.old` first, and `current` finds it there
should the writer die between the two moves. Leftovers of a killed writer are cleared by the next one; a version that it
had not yet kept is lost with them.
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
    """Make `folder` hold what `fill` writes into the empty folder it is given, and nothing else.

    Where `folder` is a link, the folder that it names is replaced, on that folder's disk. Whatever `fill` or `check`
    raise is passed on and the old folder stays as it was. Raises FileError when the disk refuses, when `folder` is a
    file or when another writer is at work.

    Args:
        check: looks at the new folder before it takes the place of the old one; it may move it away when it raises
        keep: moves the old folder away, once the new one is in place; without it the old one is removed
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
    """Make the whole folder `version`, of the same disk, the one at `folder`; `keep` moves away what was there.

    Raises FileError when the disk refuses or another writer is at work.
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
    """Where the complete folder is: at its name, or aside if a writer died while moving it."""
    old = beside(folder, "old")
    return old if not folder.exists() and old.is_dir() else folder


def target_of(folder: Path) -> Path:
    """The folder itself, or the one that a link at its place names."""
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


def beside(folder: Path, what: str) -> Path:
    """Name of what belongs to a folder, beside it; of a link, beside the folder that it names."""
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
