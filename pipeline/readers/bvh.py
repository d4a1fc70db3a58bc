"""BVH of any skeleton: hierarchy, channels in any order, rows of numbers.

A line-by-line parser without recursion; everything is capped before memory is taken. A position
channel replaces that component of the joint's OFFSET (files with six channels in every joint repeat
the offset there); rotations are intrinsic, in the order of the channels.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from jaxtyping import Float

from pipeline import rotation
from pipeline.errors import FileError
from pipeline.readers.raw_motion import RawMotion, forward_kinematics
from pipeline.readers.text_file import MAX_FRAMES, MAX_NUMBERS, read_lines, read_number, read_rows

MAX_JOINTS = 1000
MAX_DEPTH = 200

CHANNELS = ("Xposition", "Yposition", "Zposition", "Xrotation", "Yrotation", "Zrotation")


@dataclass
class _Joint:
    """A joint while its block is being read."""

    name: str
    parent: int
    line: int
    offset: tuple[float, float, float] | None = None
    channels: tuple[str, ...] = ()


@dataclass
class _Header:
    """State of the hierarchy's parser: joints so far and the blocks that are open."""

    path: Path
    joints: list[_Joint] = field(default_factory=list)
    open: list[int] = field(default_factory=list)
    """Index of the joint of each open block; -1 for an End Site."""
    pending: int | None = None
    """The joint whose `{` comes next."""

    def fail(self, problem: str, line: int, do: str = "") -> FileError:
        return FileError(self.path, problem, do, line)

    def take(self, words: list[str], line: int) -> None:
        """One line of the hierarchy."""
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
    lines = read_lines(path)
    joints, motion_line = _read_hierarchy(path, lines)
    fps, frames, first = _read_motion_header(path, lines, motion_line)
    columns = sum(len(joint.channels) for joint in joints)
    if frames * columns > MAX_NUMBERS:
        raise FileError(
            path, f"{frames} frames of {columns} numbers are more than the {MAX_NUMBERS} allowed.", "Split it."
        )
    rows = sum(1 for line in lines[first:] if line.strip())
    if rows != frames:
        problem = f"the header declares {frames} frames, the file holds {rows}."
        raise FileError(path, problem, "It was cut off or edited; export it again.", first + 1)
    values = read_rows(path, lines[first:], first + 1, columns)
    local_pos, local_quat = _local_transforms(joints, values)
    parents = tuple(joint.parent for joint in joints)
    pos, quat = forward_kinematics(parents, local_pos, local_quat)
    return RawMotion(
        format="bvh",
        joint_names=tuple(joint.name for joint in joints),
        parents=parents,
        rest_offset=np.array([joint.offset for joint in joints], dtype=float),
        joint_pos_w=pos,
        joint_quat_w=quat,
        fps=fps,
        files=(path,),
    )


def _read_hierarchy(path: Path, lines: list[str]) -> tuple[list[_Joint], int]:
    """Joints, and the index of the line MOTION."""
    header = _Header(path=path)
    started = False
    for index, line in enumerate(lines):
        for part in line.replace("{", "\n{\n").replace("}", "\n}\n").split("\n"):
            words = part.split()
            if not words:
                continue
            if not started:
                if words[0].upper() != "HIERARCHY":
                    raise FileError(path, "a BVH file begins with HIERARCHY.", line=index + 1)
                started = True
            elif words[0].upper() == "MOTION":
                return _checked(header, index), index
            else:
                header.take(words, index + 1)
    raise FileError(path, "there is no MOTION section.", "The file was cut off; export it again.", len(lines))


def _checked(header: _Header, index: int) -> list[_Joint]:
    if header.open or header.pending is not None:
        raise header.fail("MOTION begins before the hierarchy is closed: a '}' is missing.", index + 1)
    if not header.joints:
        raise header.fail("the hierarchy has no joints.", index + 1)
    for joint in header.joints:
        if joint.offset is None:
            raise header.fail(f"joint '{joint.name[:40]}' has no OFFSET.", joint.line)
    if not any(joint.channels for joint in header.joints):
        raise header.fail("no joint has CHANNELS.", index + 1)
    return header.joints


def _read_motion_header(path: Path, lines: list[str], motion_line: int) -> tuple[float, int, int]:
    """Rate [Hz], number of frames and the index of the first row."""
    found: dict[str, tuple[str, int]] = {}
    index = motion_line + 1
    while index < len(lines) and len(found) < 2:
        key, colon, value = lines[index].partition(":")
        if lines[index].strip():
            name = " ".join(key.split()).lower()
            if not colon or name not in ("frames", "frame time") or name in found:
                raise FileError(path, "MOTION is followed by 'Frames:' and 'Frame Time:'.", line=index + 1)
            found[name] = (value.strip(), index + 1)
        index += 1
    if len(found) < 2:
        raise FileError(path, "'Frames:' or 'Frame Time:' is missing.", line=len(lines))
    count = read_number(path, *found["frames"], "Frames")
    if count != int(count) or not 0 <= count <= MAX_FRAMES:
        raise FileError(path, f"Frames is {found['frames'][0]}, wanted 1 to {MAX_FRAMES}.", line=found["frames"][1])
    if count == 0:
        raise FileError(path, "the file has no frames.", line=found["frames"][1])
    frame_time_s = read_number(path, *found["frame time"], "Frame Time")
    if not 1e-4 <= frame_time_s <= 1.0:
        problem = f"Frame Time is {found['frame time'][0]} s, wanted 0.0001 to 1."
        raise FileError(path, problem, "Correct it, or state `fps:` for the file.", found["frame time"][1])
    return 1.0 / frame_time_s, int(count), index


def _local_transforms(
    joints: list[_Joint], values: Float[np.ndarray, "t c"]
) -> tuple[Float[np.ndarray, "t j 3"], Float[np.ndarray, "t j 4"]]:
    """Place and orientation of each joint in its parent's frame; joints of the same channels are done together."""
    pos = np.broadcast_to(np.array([joint.offset for joint in joints]), (len(values), len(joints), 3)).copy()
    quat = np.broadcast_to(rotation.IDENTITY, (len(values), len(joints), 4)).copy()
    starts = np.cumsum([0] + [len(joint.channels) for joint in joints])
    for channels in sorted({joint.channels for joint in joints}):
        group = [index for index, joint in enumerate(joints) if joint.channels == channels]
        turns = []
        for place, channel in enumerate(channels):
            column, axis = values[:, starts[group] + place], CHANNELS.index(channel) % 3
            if channel.endswith("position"):
                pos[:, group, axis] = column
            else:
                turns.append((axis, np.deg2rad(column)))
        if turns:
            quat[:, group] = rotation.from_euler(turns)
    return pos, quat
