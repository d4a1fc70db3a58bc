"""Motion files of text by plain means: what is before the frames, the frames, and what contradicts itself."""

from __future__ import annotations

import json
import re
from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class Described:
    """A text file by plain means: what is before the frames, the frames, and what is wrong in itself."""

    head: bytes
    frames: list[bytes]
    faults: list[str]


def described(file: str, content: bytes) -> Described:
    content = content.removeprefix(b"\xef\xbb\xbf").replace(b"\r\n", b"\n").replace(b"\r", b"\n")
    describe = {"walk.bvh": _bvh, "07_01.amc": _amc, "walk.txt": _deepmimic, "robot.csv": _csv}[file]
    return describe(content)


def _plain(word: bytes) -> bool:
    return re.fullmatch(rb"[-+]?(\d+\.?\d*|\.\d+)([eE][-+]?\d+)?", word) is not None


def _bvh(content: bytes) -> Described:
    head, _, body = content.partition(b"MOTION")
    lines = [line.split() for line in body.splitlines() if line.strip()]
    declared = int(lines[0][-1]) if lines and lines[0][-1].isdigit() else -1
    rows, faults = lines[2:], []
    channels = 0
    for match in re.finditer(rb"CHANNELS\s+(\d+)((?:\s+[XYZ](?:position|rotation))*)", head):
        channels += int(match[1])
        if int(match[1]) != len(match[2].split()):
            faults.append("CHANNELS is not the number of names after it")
    if declared != len(rows):
        faults.append(f"{declared} frames declared, {len(rows)} rows")
    if any(len(row) != channels for row in rows):
        faults.append("a row has not one number a channel")
    if head.count(b"{") != head.count(b"}"):
        faults.append("braces do not match")
    if not all(_plain(word) for row in rows for word in row):
        faults.append("a word in a row is no number")
    return Described(head + b" ".join(b" ".join(line) for line in lines[:2]), [b" ".join(row) for row in rows], faults)


def _amc(content: bytes) -> Described:
    lines = [line.split() for line in content.splitlines() if line.strip() and not line.strip().startswith(b"#")]
    head = [line for line in lines if line[0].startswith(b":")]
    frames: list[list[list[bytes]]] = []
    numbers, faults = [], []
    for line in lines:
        if len(line) == 1 and line[0].isdigit():
            numbers.append(int(line[0]))
            frames.append([])
        elif not line[0].startswith(b":") and frames:
            frames[-1].append(line)
    if numbers != list(range(1, len(numbers) + 1)):
        faults.append("frame numbers are not 1, 2, 3, ...")
    shapes = {tuple((line[0], len(line)) for line in sorted(frame)) for frame in frames}
    if len(shapes) > 1:
        faults.append("frames have other bones or another number of values")
    if not all(_plain(word) for frame in frames for line in frame for word in line[1:]):
        faults.append("a value is no number")
    joined = [b"\n".join(sorted(b" ".join(line) for line in frame)) for frame in frames]
    return Described(b"\n".join(b" ".join(line) for line in head), joined, faults)


def _deepmimic(content: bytes) -> Described:
    pairs: list[tuple[str, object]] = []

    def noted(found: list[tuple[str, object]]) -> dict[str, object]:
        pairs.extend(found)
        return dict(found)

    value = json.loads(content, object_pairs_hook=noted)
    frames, faults = value["Frames"], []
    if len({name for name, _ in pairs}) != len(pairs):
        faults.append("a key stands twice")
    if len({len(frame) for frame in frames}) > 1:
        faults.append("frames of unequal length")
    elif any(not isinstance(number, (int, float)) or isinstance(number, bool) for frame in frames for number in frame):
        faults.append("a value is no number")
    else:
        table = np.array(frames, dtype=float)
        for start in (4, 8, 12, 16, 21, 25, 30, 35, 39):
            if (
                start + 4 <= table.shape[1]
                and np.abs(np.linalg.norm(table[:, start : start + 4], axis=1) - 1).max() > 0.05
            ):
                faults.append(f"the quaternion in column {start} is not of length 1")
    head = json.dumps({name: each for name, each in value.items() if name != "Frames"}).encode()
    return Described(head, [json.dumps(frame).encode() for frame in frames], faults)


def _csv(content: bytes) -> Described:
    lines = [line.strip() for line in content.splitlines() if line.strip()]
    comments = [line for line in lines if line.startswith(b"#")]
    header, *rows = [line.split(b",") for line in lines if not line.startswith(b"#")]
    faults = []
    names = [word.strip() for word in header]
    if any(len(row) != len(names) for row in rows):
        faults.append("a row has not one cell a column")
    elif not all(_plain(word.strip()) for row in rows for word in row):
        faults.append("a cell is no number")
    elif rows:
        columns = [names.index(b"quat_" + each) for each in (b"x", b"y", b"z", b"w") if b"quat_" + each in names]
        quat = np.array([[float(row[column]) for column in columns] for row in rows])
        if len(columns) != 4 or np.abs(np.linalg.norm(quat, axis=1) - 1.0).max() > 0.05:
            faults.append("a quaternion is not of length 1")
    if len(set(names)) != len(names):
        faults.append("a column stands twice")
    head = b"\n".join([*comments, b",".join(names)])
    return Described(head, [b",".join(word.strip() for word in row) for row in rows], faults)
