"""Digests of files that are not read again while nobody touched them.

A file is known by size, times of change and inode. The time of its inode's change is the system's own: no program sets
it, so that a file changed in place and given its old time back is read again.
"""

from __future__ import annotations

import json
import os
import time
from pathlib import Path

from pipeline.files import atomic, digest

SETTLED_NS = 2_000_000_000
"""A file that changed less than this ago [ns] is not remembered: it could change again within one tick of the clock."""


class DigestMemory:
    """Digests of files, remembered in a file of their own; what is not readable there counts as nothing."""

    def __init__(self, path: Path):
        self._path = path
        try:
            known = json.loads(path.read_text())
        except (OSError, ValueError, RecursionError):
            known = {}
        self._known: dict[str, list] = known if isinstance(known, dict) else {}
        self._used: dict[str, list] = {}

    def of(self, path: Path) -> str:
        """Digest of a file's content. Raises OSError."""
        stat = path.stat()
        state = _state(stat)
        for known in (self._used.get(str(path)), self._known.get(str(path))):
            if isinstance(known, list) and known[:-1] == state and isinstance(known[-1], str):
                break
        else:
            known = [*state, digest.of_file(path)]
            if _state(path.stat()) != state or time.time_ns() - stat.st_ctime_ns < SETTLED_NS:
                self._used.pop(str(path), None)
                return known[-1]
        self._used[str(path)] = known
        return known[-1]

    def save(self) -> None:
        """Keep what was asked for since this was made; the rest is of files that are gone."""
        if self._used != self._known:
            atomic.write_text(self._path, json.dumps(self._used, sort_keys=True))
            self._known = dict(self._used)


def _state(stat: os.stat_result) -> list[int]:
    return [stat.st_size, stat.st_mtime_ns, stat.st_ctime_ns, stat.st_ino]
