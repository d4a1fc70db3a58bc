"""Many different clips from the shipped motions: segments cut at different frames, each shifted differently.

No two have the same content, so neither memo nor blob store can reuse results between them.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from pipeline.files.settings import read_yaml

STRETCH_S = 2.5
"""Length of a clip."""
START_STEP = 7
"""Frames between the starts of two clips of one motion; the starts wrap at its end."""
SHIFT_CM = 0.1
"""Shift between clips of one motion, or a multiple of it (the shipped files are in cm)."""
ROOT_CHANNELS = "CHANNELS 6 Xposition Yposition Zposition"
COPY_SHIFT_CM = 10.0
"""Shift between copies of a recording, or a multiple of it."""


@dataclass(frozen=True, kw_only=True)
class Motion:
    """A BVH file as text."""

    name: str
    head: str
    """Text before the line `Frames:`."""
    frame_time_s: float
    frames: tuple[str, ...]

    @property
    def stretch(self) -> int:
        """Frames of a clip cut from the motion."""
        return round(STRETCH_S / self.frame_time_s) + 1

    def clip(self, number: int, shift_cm: float) -> str:
        """BVH text of one segment, shifted along the file's x axis."""
        start = (number * START_STEP) % (len(self.frames) - self.stretch + 1)
        lines = [_moved(line, shift_cm) for line in self.frames[start : start + self.stretch]]
        return f"{self.head}Frames: {len(lines)}\nFrame Time: {self.frame_time_s:.9f}\n" + "\n".join(lines) + "\n"


def write_moved(motion: Motion, folder: Path) -> None:
    """Write a whole motion under its own name, shifted."""
    lines = [_moved(line, SHIFT_CM) for line in motion.frames]
    head = f"{motion.head}Frames: {len(lines)}\nFrame Time: {motion.frame_time_s:.9f}\n"
    (folder / f"{motion.name}.bvh").write_text(head + "\n".join(lines) + "\n")


def write_copies(recordings: Path, seconds: float, folder: Path) -> tuple[int, float]:
    """Write shifted copies of all BVH recordings of a folder until they have a total length [s].

    Returns the number of files, and their length [s].
    """
    folder.mkdir(parents=True, exist_ok=True)
    motions, written, count = [_read(path) for path in sorted(recordings.glob("*.bvh"))], 0.0, 0
    while written < seconds:
        motion, copy = motions[count % len(motions)], count // len(motions)
        lines = [_moved(line, COPY_SHIFT_CM * copy) for line in motion.frames]
        head = f"{motion.head}Frames: {len(lines)}\nFrame Time: {motion.frame_time_s:.9f}\n"
        (folder / f"{motion.name.lower()}_{copy:03d}.bvh").write_text(head + "\n".join(lines) + "\n")
        written, count = written + len(lines) * motion.frame_time_s, count + 1
    return count, written


def sound_motions(folder: Path) -> list[Motion]:
    """The shipped motions whose sidecars list no planted defect, by name. Raises ValueError for an unknown head."""
    paths = sorted(path for path in folder.glob("*.bvh") if "defects" not in read_yaml(path.with_suffix(".yaml")))
    return [_read(path) for path in paths]


def file_name(motions: list[Motion], index: int) -> str:
    """Name of the clip with a number among many."""
    return f"{motions[index % len(motions)].name}_{index // len(motions):03d}.bvh"


def write_clip(motions: list[Motion], index: int, folder: Path, *, changed: bool = False) -> None:
    """Write the clip with a number; `changed` shifts it to a position of no other clip."""
    number = index // len(motions)
    shift_cm = -SHIFT_CM if changed else SHIFT_CM * number
    (folder / file_name(motions, index)).write_text(motions[index % len(motions)].clip(number, shift_cm))


def write_clips(motions: list[Motion], count: int, folder: Path) -> float:
    """Write `count` different clips, cycling through the motions; return their total length [s]."""
    folder.mkdir(parents=True, exist_ok=True)
    for index in range(count):
        write_clip(motions, index, folder)
    turns = [motions[index % len(motions)] for index in range(count)]
    return sum(motion.stretch * motion.frame_time_s for motion in turns)


def _read(path: Path) -> Motion:
    head, found, rest = path.read_text().partition("Frames:")
    if not found or ROOT_CHANNELS not in head:
        raise ValueError(f"{path}: expected '{ROOT_CHANNELS}' at the root")
    lines = rest.splitlines()
    frame_time_s = float(lines[1].partition(":")[2])
    return Motion(
        name=path.stem, head=head, frame_time_s=frame_time_s, frames=tuple(line for line in lines[2:] if line)
    )


def _moved(line: str, shift_cm: float) -> str:
    first, _, rest = line.strip().partition(" ")
    return f"{float(first) + shift_cm:.6f} {rest}"
