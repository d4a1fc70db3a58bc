"""Settings of data/curation.yaml: segmentation into windows, the selection among them, and a person's decisions.

Decisions are written by `booster-lab curate` or by hand. KP1 leaves out an excluded recording or window, KP5 an
excluded variant or rollout. An accepted clip is one that a person reviewed: accepting replaces an exclusion, but does
not override a criterion.

Decisions are written at the end of the file; the text above them, including comments, is unchanged. `decisions:` is the
last key and its block is replaced as a whole; all other settings are compared before and after writing.
"""

import dataclasses
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any
from unicodedata import category

import yaml

from pipeline.batch import Manifest
from pipeline.clips.outcome import LABELS, Reason
from pipeline.errors import FileError, SettingsError
from pipeline.files import atomic, settings
from pipeline.files.ranges import NOT_NEGATIVE, POSITIVE, SHARE, Allowed, Keys, OneOf, Pattern, Range
from pipeline.selection.skills import SkillBounds

ACCEPT, EXCLUDE = "accept", "exclude"
MOST_LETTERS = 500
"""Most characters of a name or a reason."""
NO_LETTER = ("Cc", "Cs", "Zl", "Zp")
"""Unicode categories not allowed in a line of text: control characters, surrogates, line and paragraph separators."""


@dataclass(frozen=True)
class Line(Allowed):
    """A non-empty line of text in any language; no-break spaces and joiners are allowed, as in words and emoji."""

    def problem(self, value: Any) -> str | None:
        text = str(value)
        if not text.strip() or len(text) > MOST_LETTERS or any(category(each) in NO_LETTER for each in text):
            return f"is {text[:40]!r}, allowed is one line of 1 to {MOST_LETTERS} letters"
        return None


@dataclass(frozen=True, kw_only=True)
class Decision:
    """A person's decision on one clip."""

    clip: Annotated[str, Line()]
    """Exact name of a recording, window, variant or rollout."""
    verdict: Annotated[str, OneOf((ACCEPT, EXCLUDE))]
    """`accept` or `exclude`."""
    by: Annotated[str, Line()]
    """Name of the person."""
    why: Annotated[str, Line()]
    """Reason, one sentence."""
    day: Annotated[str, Line()]
    """Date of the decision, as `2026-11-26`."""

    def text(self) -> str:
        """The decision as a sentence."""
        return f"{'excluded' if self.verdict == EXCLUDE else 'accepted'} by {self.by} on {self.day}: {self.why}"


def exclusions(decisions: Iterable[Decision]) -> dict[str, Decision]:
    """Name of each excluded clip -> the decision."""
    return {each.clip: each for each in decisions if each.verdict == EXCLUDE}


def without_excluded(manifest: Manifest, decisions: Sequence[Decision]) -> Manifest:
    """Remove clips excluded by a person, by their own or original name; the decision becomes the reason."""
    excluded = exclusions(decisions)
    input_of = {piece: clip for clip, pieces in manifest.findings("clip", "pieces") for piece in pieces}
    dropped: dict[str, dict[str, Any]] = {}
    for (clip,) in manifest.kept("clip"):
        decision = excluded.get(clip) or excluded.get(input_of.get(clip, ""))
        if decision is not None:
            text = f"{clip}: {decision.text()}"
            dropped[clip] = Reason(code="excluded_by_person", text=text, effect="rejected").to_dict()
    return manifest.without(dropped) if dropped else manifest


EXPERT_MOTIONS = ("rollouts", "references", "both")


@dataclass(frozen=True, kw_only=True)
class WindowSettings:
    """Segmentation of a clip into windows."""

    velocity_s: Annotated[float, Range(0.01, 5.0)]
    """Width of the moving mean on the root's velocity [s]."""
    facing_s: Annotated[float, Range(0.01, 5.0)]
    """Width of the moving mean on the facing [s]."""
    label_hz: Annotated[float, Range(5.0, 1000.0)]
    """Rate at which frames are labelled, independent of the clip's own rate [Hz]."""
    shortest_s: Annotated[float, Range(0.0, 60.0, open_low=True)]
    """Shortest window of a skill [s]."""
    shortest_transition_s: Annotated[float, Range(0.0, 60.0, open_low=True)]
    """Shortest transition [s]; shorter ones are merged into neighbouring windows."""
    bridge_s: Annotated[float, Range(0.0, 5.0)]
    """Gaps of the recording up to this long are interpolated for the labels, longer ones are transitions [s]."""
    transition_cost: Annotated[float, POSITIVE]
    """Cost of a transition frame [m/s]: the mean distance from a skill's region up to which frames belong to it."""
    cut_price: Annotated[float, NOT_NEGATIVE]
    """Price of one more cut [m]: distance from a region times the time that it lasts."""
    bounds: SkillBounds
    """The regions of the skills."""


@dataclass(frozen=True, kw_only=True)
class Curation:
    """Selection of windows for the database."""

    skills: Annotated[tuple[str, ...], OneOf(LABELS)]
    """Skills to select, of the ten and `transition`."""
    most_seconds: Annotated[dict[str, float], Keys(keys=OneOf(LABELS), values=NOT_NEGATIVE)]
    """Skill -> most seconds selected; no limit for other skills."""
    shortest_s: Annotated[float, NOT_NEGATIVE]
    """Shortest window that is selected [s]."""
    least_recorded_share: Annotated[float, SHARE]
    """Least share of recorded frames in a window; with fewer its label is unreliable."""
    licences: Annotated[tuple[str, ...], Pattern()]
    """Patterns (`*`, `?`, case does not matter) of licences that may be used."""
    excluded_clips: Annotated[tuple[str, ...], Pattern()]
    """Patterns of names of clips or windows to exclude."""
    excluded_notes: Annotated[tuple[str, ...], Pattern()]
    """Codes of notes (catalogue, readers) that exclude a file."""
    expert_motions: Annotated[str, OneOf(EXPERT_MOTIONS)]
    """Motions in the expert database: `rollouts`, `references` or `both`."""
    windows: WindowSettings
    """Segmentation of a clip into windows."""
    decisions: tuple[Decision, ...] = ()
    """A person's decisions on single clips, in order; the last one of a clip is valid."""


KEY = "decisions"
REMARK = "# Decisions of a person on single clips, written by `booster-lab curate`; docs/curate.md explains them.\n"


def read_decisions(path: Path) -> tuple[Decision, ...]:
    """The decisions in a curation file. Raises SettingsError."""
    return settings.read(path, Curation).decisions


def decide(path: Path, new: Sequence[Decision]) -> tuple[Decision, ...]:
    """Add decisions, each replacing an earlier one on the same clip; return all current decisions.

    Raises SettingsError for a file that can't be read, FileError if it can't be written; it is then unchanged.
    """
    with atomic.only_writer(path):
        names = {each.clip for each in new}
        kept = [each for each in read_decisions(path) if each.clip not in names]
        return _write(path, (*kept, *new))


def take_back(path: Path, clips: Sequence[str]) -> tuple[Decision, ...]:
    """Remove the decisions on some clips; return the others. Raises FileError for a clip without a decision."""
    with atomic.only_writer(path):
        there = read_decisions(path)
        strange = sorted(set(clips) - {each.clip for each in there})
        if strange:
            raise FileError(path, f"there is no decision on '{strange[0]}'.", "Load the page again.")
        return _write(path, tuple(each for each in there if each.clip not in set(clips)))


def _write(path: Path, decisions: tuple[Decision, ...]) -> tuple[Decision, ...]:
    """Replace the block of decisions.

    Raises SettingsError if the new text differs in other settings or is too long to be read again.
    """
    text = path.read_text(encoding="utf-8")
    kept = _without_block(text)
    new, rows = kept.rstrip("\n") + "\n", [dataclasses.asdict(each) for each in decisions]
    if decisions:
        new += f"\n{REMARK}" + yaml.safe_dump({KEY: rows}, sort_keys=False, allow_unicode=True, width=1000)
    before, after = yaml.safe_load(text), yaml.safe_load(new)
    stated = after.pop(KEY, []) if isinstance(after, dict) else None
    rest = {key: value for key, value in before.items() if key != KEY}
    if after != rest or stated != rows or KEY in (yaml.safe_load(kept) or {}):
        raise SettingsError(path, f"the key '{KEY}' can't be replaced.", f"Move '{KEY}:' to the end of the file.")
    if len(new.encode()) > settings.MAX_BYTES:
        problem = f"with {len(decisions)} decisions the file would be larger than {settings.MAX_BYTES} bytes."
        raise SettingsError(path, problem, "Exclude recordings or windows instead, or a pattern of 'excluded_clips'.")
    atomic.write_text(path, new)
    return decisions


def _without_block(text: str) -> str:
    """The text without the top-level key `decisions`, its value and the comment above it."""
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
