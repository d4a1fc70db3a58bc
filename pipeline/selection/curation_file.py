"""Write decisions into data/curation.yaml: the text above them, with its remarks, stays as it is.

`decisions:` is the last key of the file and its block is replaced as a whole; all other settings are read before and
after and must be the same.
"""

from __future__ import annotations

import dataclasses
import fcntl
import os
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import yaml

from pipeline.errors import FileError, SettingsError
from pipeline.files import atomic, settings
from pipeline.selection.curation import Curation, Decision

KEY = "decisions"
REMARK = "# Decisions of a person on single clips, written by `booster-lab curate`; docs/curate.md explains them.\n"


def read_decisions(path: Path) -> tuple[Decision, ...]:
    """The decisions in a curation file. Raises SettingsError."""
    return settings.read(path, Curation).decisions


def decide(path: Path, new: Sequence[Decision]) -> tuple[Decision, ...]:
    """Add decisions, each in place of an earlier one on the same clip; those that are in force now.

    Raises SettingsError for a file that can't be read, FileError when it can't be written; it is unchanged then.
    """
    with _only_writer(path):
        names = {each.clip for each in new}
        kept = [each for each in read_decisions(path) if each.clip not in names]
        return _write(path, (*kept, *new))


def take_back(path: Path, clips: Sequence[str]) -> tuple[Decision, ...]:
    """Remove the decisions on some clips; those that are left. Raises FileError for a clip without a decision."""
    with _only_writer(path):
        there = read_decisions(path)
        strange = sorted(set(clips) - {each.clip for each in there})
        if strange:
            raise FileError(path, f"there is no decision on '{strange[0]}'.", "Load the page again.")
        return _write(path, tuple(each for each in there if each.clip not in set(clips)))


def _write(path: Path, decisions: tuple[Decision, ...]) -> tuple[Decision, ...]:
    text = path.read_text(encoding="utf-8")
    before = yaml.safe_load(text)
    new = _without_block(text).rstrip("\n") + "\n"
    if decisions:
        rows = [dataclasses.asdict(each) for each in decisions]
        new += f"\n{REMARK}" + yaml.safe_dump({KEY: rows}, sort_keys=False, allow_unicode=True, width=1000)
    _check(path, _without_block(text), new, before, decisions)
    atomic.write_text(path, new)
    return decisions


def _without_block(text: str) -> str:
    """The text without the top-level key `decisions`, its value and the remark above it."""
    kept, inside = [], False
    for line in text.splitlines(keepends=True):
        if line.startswith(f"{KEY}:"):
            inside = True
        elif inside and (line[:1].isspace() or line.startswith(("-", "#")) or not line.strip()):
            continue
        else:
            inside = False
            if line != REMARK:
                kept.append(line)
    return "".join(kept)


def _check(path: Path, kept: str, new: str, before: dict[str, Any], decisions: tuple[Decision, ...]) -> None:
    """Raises SettingsError if the new text says anything else than the old one apart from the decisions."""
    after = yaml.safe_load(new)
    wanted = [dataclasses.asdict(each) for each in decisions]
    stated = after.pop(KEY, []) if isinstance(after, dict) else None
    rest = {key: value for key, value in before.items() if key != KEY}
    if after != rest or stated != wanted or KEY in (yaml.safe_load(kept) or {}):
        raise SettingsError(path, f"the key '{KEY}' can't be replaced.", f"Move '{KEY}:' to the end of the file.")


@contextmanager
def _only_writer(path: Path) -> Iterator[None]:
    """Keep other writers of the file waiting."""
    handle = os.open(path.parent, os.O_RDONLY)
    try:
        fcntl.flock(handle, fcntl.LOCK_EX)
        yield
    finally:
        os.close(handle)
