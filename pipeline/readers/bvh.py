"""BVH of any skeleton: hierarchy, channels in any order, rows of numbers.

A line-by-line parser without recursion; sizes are limited before memory is allocated, and the text is never in memory
as a whole. A position channel replaces that component of the joint's OFFSET (files with six channels in every joint
repeat the offset there); rotations are intrinsic, in the order of the channels.
"""

from collections.abc import Iterator
from dataclasses import dataclass, field
from itertools import chain
from pathlib import Path
from typing import NamedTuple

import numpy as np

from pipeline.clips.outcome import Reason
from pipeline.errors import FileError
from pipeline.readers.raw_motion import CHANNELS, ChannelPoses, RawMotion
from pipeline.readers.text_file import MAX_FRAMES, check_numbers, open_text, read_number, read_table, to_float
from pipeline.readers.velocity_rate import printed_rate

MAX_JOINTS = 1000
MAX_DEPTH = 200


@dataclass
class _Joint:
    """A joint while its block is being read."""

    name: str
    parent: int
    line: int
    offset: tuple[float, float, float] | None = None
    channels: tuple[str, ...] = ()
    tip: tuple[float, float, float] | None = None
    """Offset of its End Site."""


@dataclass
class _Header:
    """State of the hierarchy's parser: joints so far and the blocks that are open."""

    path: Path
    joints: list[_Joint] = field(default_factory=list)
    open: list[int] = field(default_factory=list)
    """Index of the joint of each open block; -1 for an End Site."""
    pending: int | None = None
    """Index of the joint whose `{` is expected next."""

    def fail(self, problem: str, line: int) -> FileError:
        return FileError(self.path, problem, line=line)

    def take(self, words: list[str], line: int) -> None:
        """Parse one line of the hierarchy."""
        key = words[0].upper()
        if self.pending is not None and key != "{":
            raise self.fail(f"'{words[0][:40]}' where a '{{' was expected.", line)
        if key == "{":
            self._open(line)
        elif key == "}":
            if not self.open:
                raise self.fail("a '}' without its '{'.", line)
            self.open.pop()
        elif key in ("ROOT", "JOINT"):
            self._add(key, " ".join(words[1:]), line)
        elif key == "END":
            self._site(line)
        elif key == "OFFSET":
            self._offset(words[1:], line)
        elif key == "CHANNELS":
            self._channels(words[1:], line)
        else:
            raise self.fail(f"'{words[0][:40]}' is not part of a BVH hierarchy.", line)

    def _open(self, line: int) -> None:
        if self.pending is None:
            raise self.fail("a '{' that belongs to no joint.", line)
        if len(self.open) >= MAX_DEPTH:
            raise self.fail(f"the hierarchy is deeper than {MAX_DEPTH} joints.", line)
        self.open.append(self.pending)
        self.pending = None

    def _add(self, key: str, name: str, line: int) -> None:
        parent = self.open[-1] if self.open else -1
        if key == "ROOT" and (self.joints or self.open):
            raise self.fail("a second ROOT; a file holds one skeleton.", line)
        if (key == "JOINT") == (not self.open) or (self.open and parent == -1):
            raise self.fail(f"{key} '{name[:40]}' is at the wrong place in the hierarchy.", line)
        if not name:
            raise self.fail(f"{key} without a name.", line)
        if any(joint.name == name for joint in self.joints):
            raise self.fail(f"the joint name '{name[:40]}' is used twice.", line)
        if len(self.joints) >= MAX_JOINTS:
            raise self.fail(f"more than {MAX_JOINTS} joints.", line)
        self.joints.append(_Joint(name=name, parent=parent, line=line))
        self.pending = len(self.joints) - 1

    def _site(self, line: int) -> None:
        if not self.open or self.open[-1] == -1:
            raise self.fail("an End Site outside a joint.", line)
        self.pending = -1

    def _offset(self, words: list[str], line: int) -> None:
        if not self.open or len(words) != 3:
            raise self.fail("OFFSET wants three numbers inside a joint.", line)
        offset = tuple(read_number(self.path, word, line, "the offset") for word in words)
        if self.open[-1] >= 0:
            self.joints[self.open[-1]].offset = offset
        elif len(self.open) > 1:
            self.joints[self.open[-2]].tip = offset

    def _channels(self, words: list[str], line: int) -> None:
        names = {name.lower(): name for name in CHANNELS}
        if not self.open or self.open[-1] < 0:
            raise self.fail("CHANNELS outside a joint.", line)
        if not words or words[0] != str(len(words) - 1):
            raise self.fail(f"CHANNELS says '{' '.join(words[:1])}' and names {max(len(words) - 1, 0)}.", line)
        unknown = [word for word in words[1:] if word.lower() not in names]
        if unknown:
            raise self.fail(f"unknown channel '{unknown[0][:40]}'; there are: {', '.join(CHANNELS)}.", line)
        channels = tuple(names[word.lower()] for word in words[1:])
        if len(set(channels)) < len(channels):
            raise self.fail("a channel is named twice.", line)
        self.joints[self.open[-1]].channels = channels


def read_bvh(path: Path) -> RawMotion:
    """A BVH file as joints in its own unit and axes. Raises FileError with the line."""
    text = open_text(path)
    lines = enumerate(text.lines(), start=1)
    joints = _read_hierarchy(path, lines)
    parents = tuple(joint.parent for joint in joints)
    offsets = np.array([joint.offset for joint in joints], dtype=float)
    frames, rate, lines = _read_motion_header(path, lines)
    columns = sum(len(joint.channels) for joint in joints)
    check_numbers(path, frames.count, columns)
    values = read_table(path, lines, text.line_count, columns)
    return RawMotion(
        format="bvh",
        joint_names=tuple(joint.name for joint in joints),
        parents=parents,
        rest_offset=offsets,
        poses=ChannelPoses(
            parents=parents, offsets=offsets, channels=tuple(joint.channels for joint in joints), rows=(values,)
        ),
        fps=rate.fps,
        rate_fault=rate.fault,
        files=(path,),
        tips={joint.name: joint.tip for joint in joints if joint.tip is not None and any(joint.tip)},
        notes=rate.notes + _frame_count(path, frames, len(values)),
    )


def _read_hierarchy(path: Path, lines: Iterator[tuple[int, str]]) -> list[_Joint]:
    """Parse the joints, up to and including the line MOTION."""
    header = _Header(path=path)
    started, number = False, 0
    for number, line in lines:
        for part in line.replace("{", "\n{\n").replace("}", "\n}\n").split("\n"):
            words = part.split()
            if not words:
                continue
            if not started:
                if words[0].upper() != "HIERARCHY":
                    raise FileError(path, "a BVH file begins with HIERARCHY.", line=number)
                started = True
            elif words[0].upper() == "MOTION":
                return _checked(header, number)
            else:
                header.take(words, number)
    raise FileError(path, "there is no MOTION section.", "The file was cut off; export it again.", max(number, 1))


def _checked(header: _Header, line: int) -> list[_Joint]:
    if header.open or header.pending is not None:
        raise header.fail("MOTION begins before the hierarchy is closed: a '}' is missing.", line)
    if not header.joints:
        raise header.fail("the hierarchy has no joints.", line)
    for joint in header.joints:
        if joint.offset is None:
            raise header.fail(f"joint '{joint.name[:40]}' has no OFFSET.", joint.line)
    if not any(joint.channels for joint in header.joints):
        raise header.fail("no joint has CHANNELS.", line)
    return header.joints


class _Frames(NamedTuple):
    """Number of frames as declared, and the line that declares it."""

    count: int
    line: int


class _Rate(NamedTuple):
    """Frames per second as declared [Hz], or the error in it."""

    fps: float | None = None
    fault: FileError | None = None
    notes: tuple[Reason, ...] = ()


def _read_motion_header(
    path: Path, lines: Iterator[tuple[int, str]]
) -> tuple[_Frames, _Rate, Iterator[tuple[int, str]]]:
    """Declared number of frames and rate, and the lines that follow."""
    found: dict[str, tuple[str, int]] = {}
    expected, number, rest = "MOTION is followed by 'Frames:' and 'Frame Time:'.", 0, lines
    for number, line in lines:
        key, colon, value = line.partition(":")
        name = " ".join(key.split()).lower()
        if not name:
            continue
        if not colon and set(found) == {"frames"} and name[0] in "+-.0123456789n":
            rest = chain([(number, line)], lines)
            break
        if not colon or name not in ("frames", "frame time") or name in found:
            raise FileError(path, expected, line=number)
        found[name] = (value.strip(), number)
        if len(found) == 2:
            break
    if "frames" not in found or (len(found) < 2 and rest is lines):
        raise FileError(path, "'Frames:' or 'Frame Time:' is missing.", line=max(number, 1))
    count = read_number(path, *found["frames"], "Frames")
    if count != int(count) or not 0 <= count <= MAX_FRAMES:
        raise FileError(path, f"Frames is {found['frames'][0]}, expected 1 to {MAX_FRAMES}.", line=found["frames"][1])
    frames = _Frames(int(count), found["frames"][1])
    do = "Correct it, or state `fps:` for the file."
    if "frame time" not in found:
        fault = FileError(path, f"there is no Frame Time. {expected}", do, number)
        return frames, _Rate(fault=fault), rest
    printed, line = found["frame time"]
    try:
        frame_time_s = to_float(printed)
    except ValueError:
        frame_time_s = np.nan
    if not 1e-4 <= frame_time_s <= 1.0:
        fault = FileError(path, f"Frame Time is '{printed[:40]}', expected 0.0001 to 1 s.", do, line)
        return frames, _Rate(fault=fault), rest
    fps, notes = printed_rate(printed)
    return frames, _Rate(fps=fps, notes=notes), rest


def _frame_count(path: Path, declared: _Frames, rows: int) -> tuple[Reason, ...]:
    """A note if more rows than declared were read. Raises FileError for fewer or none."""
    if rows < declared.count:
        problem = f"the header declares {declared.count} frames, the file holds {rows}."
        raise FileError(path, problem, "It was cut off or edited; export it again.", declared.line)
    if rows == 0:
        raise FileError(path, "the file has no frames.", line=declared.line)
    if rows == declared.count:
        return ()
    text = f"the header declares {declared.count} frames, the file holds {rows} whole rows; all of them are read"
    limit = float(declared.count)
    return (Reason(code="frame_count", text=text, effect="noted", value=float(rows), limit=limit),)
