"""File names made from clip names."""

from __future__ import annotations

import re

from pipeline.files import digest

MAX_LENGTH = 150
"""Longest stem; with suffix and a digest it stays below the 255 bytes that file systems take."""

RESERVED = ("manifest",)
"""Stems of the database's own JSON files."""


def file_name(clip: str) -> str:
    """A file name for a clip: readable, below no folder, and different for different clips.

    `/` becomes `__`. Where a name has to be changed beyond that (other characters, length, a leading dot,
    a `__` of its own) a digest of it is added, so that no two clips share a file; so it is for capitals, since
    some file systems do not tell them from small letters.
    """
    plain = re.sub(r"[^a-zA-Z0-9._~@+-]", "_", clip.replace("/", "__")).lstrip(".") or "_"
    kept = plain == clip.replace("/", "__") and "__" not in clip and plain == plain.lower()
    if kept and len(plain) <= MAX_LENGTH and plain not in RESERVED:
        return f"{plain}.json"
    return f"{plain[:MAX_LENGTH]}-{digest.of_bytes(clip.encode())[:10]}.json"
