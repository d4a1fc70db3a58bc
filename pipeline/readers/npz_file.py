"""NumPy archives of motions: the caps that they have (`pipeline.files.npz`)."""

from pathlib import Path

from pipeline.files.npz import NpzCaps, NpzHeader, read_npz_header

CAPS = NpzCaps(members=200, member_bytes=1_000_000_000, total_bytes=2_000_000_000, ratio=1_000)


def open_npz(path: Path) -> NpzHeader:
    """The header of an archive. Raises FileError for what is no archive, damaged, or too large when inflated."""
    return read_npz_header(path, CAPS)
