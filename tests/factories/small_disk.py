"""A disk that is full: a tmpfs in a mount namespace of the process's own, whose size is what it holds and a few pages.

The kernel refuses what is written beyond them, in the middle of a file as well, whoever writes it. It needs no
privilege where user namespaces are allowed, and no other process sees the mount.
"""

from __future__ import annotations

import ctypes
import os
from multiprocessing.context import ForkServerContext
from pathlib import Path

CLONE_NEWNS, CLONE_NEWUSER = 0x00020000, 0x10000000
MS_REMOUNT, MS_REC, MS_PRIVATE = 0x20, 0x4000, 0x40000
PAGE = 4096
"""Bytes in which a tmpfs gives room."""
ROOMY = 1_000_000_000
"""Size of a disk that is not full [bytes]; memory is taken for what is written alone."""


class SmallDisk:
    """A tmpfs at the folder `place`, for a process of one thread that ends afterwards: its namespaces are others."""

    def __init__(self, place: Path):
        self.place = place
        user, group = os.getuid(), os.getgid()
        _call("unshare", CLONE_NEWUSER | CLONE_NEWNS)
        Path("/proc/self/setgroups").write_text("deny")
        Path("/proc/self/uid_map").write_text(f"{user} {user} 1")
        Path("/proc/self/gid_map").write_text(f"{group} {group} 1")
        _call("mount", b"none", b"/", None, ctypes.c_ulong(MS_REC | MS_PRIVATE), None)
        _call("mount", b"tmpfs", os.fsencode(place), b"tmpfs", ctypes.c_ulong(0), f"size={ROOMY}".encode())

    @property
    def used(self) -> int:
        """What is written there, in whole pages [bytes]."""
        stats = os.statvfs(self.place)
        return (stats.f_blocks - stats.f_bfree) * stats.f_frsize

    def leave(self, room: int) -> None:
        """Make `room` bytes the free space."""
        options = f"size={max(self.used + room, PAGE)}".encode()
        _call("mount", None, os.fsencode(self.place), None, ctypes.c_ulong(MS_REMOUNT), options)


def _call(function: str, *arguments: object) -> None:
    """A function of the C library. Raises OSError as it says."""
    library = ctypes.CDLL(None, use_errno=True)
    if getattr(library, function)(*arguments) != 0:
        number = ctypes.get_errno()
        raise OSError(number, f"{function}: {os.strerror(number)}")


def why_unavailable(context: ForkServerContext, place: Path) -> str:
    """Why no such disk can be had on this machine; empty where one can."""
    answers = context.SimpleQueue()
    process = context.Process(target=_try, args=(str(place), answers))
    process.start()
    answer = answers.get()
    process.join()
    return answer


def _try(place: str, answers) -> None:
    try:
        SmallDisk(Path(place))
    except (OSError, AttributeError) as error:  # not Linux: the C library has no such function
        answers.put(f"no file system can be mounted in a user namespace here ({error})")
    else:
        answers.put("")
