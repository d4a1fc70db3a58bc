"""NumPy archives of motions: the caps that they have (`pipeline.files.npz`)."""

from __future__ import annotations

from pathlib import Path

from pipeline.files.npz import NpzCaps, NpzHeader, read_npz_header

__all__ = ["NpzHeader", "open_npz"]

MAX_MEMBERS = 200
MAX_MEMBER_BYTES = 1_000_000_000
MAX_TOTAL_BYTES = 2_000_000_000
MAX_RATIO = 1_000
"""Caps on an archive: members, bytes of one and of those that are read, and how far a member may inflate."""


def caps() -> NpzCaps:
    """The caps as they are now."""
    return NpzCaps(members=MAX_MEMBERS, member_bytes=MAX_MEMBER_BYTES, total_bytes=MAX_TOTAL_BYTES, ratio=MAX_RATIO)


def open_npz(path: Path) -> NpzHeader:
    """The header of an archive. Raises FileError for what is no archive, damaged, or too large when inflated."""
    return read_npz_header(path, caps())
