"""One finding on a robot folder."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, kw_only=True)
class Finding:
    """Something that a robot folder lacks or contradicts."""

    code: str
    """Short name of the check, for counting."""
    text: str
    """What was found, with the link, joint or site, what was got, and what is expected."""

    def __str__(self) -> str:
        return f"{self.code}: {self.text}"
