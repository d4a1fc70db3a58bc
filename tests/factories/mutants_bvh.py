"""Faults of BVH files, planted into one clean file."""

from __future__ import annotations

import gzip
import re

import numpy as np

from tests.factories import motion_files as files
from tests.factories.mutant import Mutant, flagged, refused, understood

FRAMES = 90
Z_UP = np.array([[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
"""From a world whose y axis is up and whose z axis is ahead to one whose x axis is."""
CLEAN = files.bvh(files.upright(FRAMES, seed=1))
HEAD, BODY = CLEAN.split("MOTION\n")
ROWS = BODY.splitlines()[2:]
COLUMNS = len(ROWS[0].split())


def with_rows(rows: list[str], frames: int | None = None, time: str = "0.0166667") -> str:
    """The clean hierarchy over other rows."""
    lines = [f"Frames: {len(rows) if frames is None else frames}", f"Frame Time: {time}", *rows]
    return f"{HEAD}MOTION\n" + "\n".join(lines) + "\n"


def with_head(pattern: str, replacement: str) -> str:
    """The clean file with a part of its hierarchy replaced."""
    changed = re.sub(pattern, replacement, HEAD, count=1)
    assert changed != HEAD, pattern
    return f"{changed}MOTION\n{BODY}"


def with_word(word: str) -> str:
    """One number written in another way."""
    rows = [line.split() for line in ROWS]
    rows[40][20] = word
    return with_rows([" ".join(line) for line in rows])


def with_values(change) -> str:
    """The rows after `change(values)` in place."""
    values = np.array([[float(word) for word in line.split()] for line in ROWS])
    values = change(values)
    return with_rows([" ".join(f"{value:.9f}" for value in row) for row in values])


def nested(joints: int, wide: bool = False) -> str:
    """A hierarchy of many joints, each in the other or all in the root."""
    block = "OFFSET 0 1 0\nCHANNELS 3 Zrotation Xrotation Yrotation\n"
    inner = "".join(f"JOINT j{index}\n{{\n{block}" + ("}\n" if wide else "") for index in range(joints))
    return f"HIERARCHY\nROOT r\n{{\n{block}{inner}" + ("" if wide else "}\n" * joints) + f"}}\nMOTION\n{BODY}"


def bvh_mutants() -> list[Mutant]:
    """All of them."""
    return [*_cut_off(), *_numbers_of_the_header(), *_hierarchies(), *_rows(), *_encodings(), *_same(), *_flagged()]


def _cut_off() -> list[Mutant]:
    shares = {f"hierarchy cut at {share:.0%}": HEAD[: int(share * len(HEAD))] for share in (0.05, 0.2, 0.5, 0.8, 0.99)}
    cuts = {
        "cut after MOTION": f"{HEAD}MOTION\n",
        "cut after Frames": f"{HEAD}MOTION\nFrames: {FRAMES}\n",
        "cut after Frame Time": f"{HEAD}MOTION\nFrames: {FRAMES}\nFrame Time: 0.0166667\n",
        "last row missing": with_rows(ROWS[:-1], FRAMES),
        "first row missing": with_rows(ROWS[1:], FRAMES),
        "half of the rows missing": with_rows(ROWS[::2], FRAMES),
        "cut in a row": with_rows([*ROWS[:-1], ROWS[-1][:100]], FRAMES),
        "last number missing": with_rows([*ROWS[:-1], ROWS[-1].rsplit(" ", 1)[0]], FRAMES),
        "one frame": with_rows(ROWS[:1]),
        "no frame": with_rows([]),
        "empty": "",
        "blank": " \n\n\t\n",
    }
    return refused("walk.bvh", r"line \d+|empty|1 frame|HIERARCHY|MOTION", {**shares, **cuts})


def _numbers_of_the_header() -> list[Mutant]:
    counts = ("1000000000", "-5", "nan", "inf", "90.5", "91", "ninety", "", "1e300", "9" * 400)
    times = ("0", "nan", "-0.0166", "inf", "10", "1e-9", "abc", "", "0,0166667", "1e400", "0.01_6")
    texts = {f"Frames: {count[:12]}": CLEAN.replace(f"Frames: {FRAMES}", f"Frames: {count}") for count in counts}
    texts |= {f"Frame Time: {time}": with_rows(ROWS, time=time) for time in times}
    texts["Frames twice"] = CLEAN.replace("Frame Time:", "Frames:")
    texts["no Frames"] = re.sub(r"Frames: \d+\n", "", CLEAN)
    return refused("walk.bvh", r"Frame|frames", texts)


def _hierarchies() -> list[Mutant]:
    channels = "CHANNELS 3 Zrotation Xrotation Yrotation"
    offsets = ("nan 0 0", "inf 0 0", "1 2", "1 2 3 4", "a b c", "1e999 0 0", "", "1_0 0 0")
    others = ("CHANNELS", "CHANNELS 3", "CHANNELS -3 Zrotation", "CHANNELS 1000000000 Zrotation")
    others += ("CHANNELS 4 Zrotation Xrotation Yrotation", "CHANNELS 3 Zrotation Zrotation Xrotation")
    others += ("CHANNELS 3 Wrotation Xrotation Yrotation", "CHANNELS 1 " + "Z" * 100_000)
    texts = {f"OFFSET {offset}": with_head(r"OFFSET [^\n]*", f"OFFSET {offset}") for offset in offsets}
    texts |= {other[:40]: with_head(channels, other) for other in others}
    texts |= {
        "100,000 joints deep": nested(100_000),
        "201 joints deep": nested(201),
        "1,001 joints wide": nested(1_001, wide=True),
        "joint named twice": HEAD.replace("JOINT LeftLeg", "JOINT RightLeg") + f"MOTION\n{BODY}",
        "joint without a name": with_head("JOINT LeftLeg", "JOINT"),
        "no OFFSET": with_head(r"OFFSET [^\n]*\n", ""),
        "bracket missing": with_head(r"\}", ""),
        "bracket too many": f"{HEAD}}}\nMOTION\n{BODY}",
        "all brackets missing": HEAD.replace("}", "") + f"MOTION\n{BODY}",
        "second ROOT": with_head("JOINT LeftUpLeg", "ROOT LeftUpLeg"),
        "JOINT outside": HEAD.replace("ROOT", "JOINT") + f"MOTION\n{BODY}",
        "no HIERARCHY": CLEAN.replace("HIERARCHY\n", ""),
        "no MOTION": HEAD + BODY,
        "joint in an End Site": with_head("End Site\n", "End Site\n{\nJOINT x\n"),
        "End Site outside": with_head("ROOT", "End Site\n{\n}\nROOT"),
        "junk line": with_head("OFFSET", "\x01\x02\x03\nOFFSET"),
        "line of 5 MB": with_head("OFFSET", "x" * 5_000_000 + "\nOFFSET"),
        "mirrored": _exchanged(),
        "unknown skeleton": HEAD.replace("LeftUpLeg", "Tail") + f"MOTION\n{BODY}",
        "no size that a person has": files.bvh(files.upright(FRAMES, seed=1), files.BvhStyle(metres_per_unit=0.0001)),
    }
    return refused("walk.bvh", r"line \d+|skeleton|unit|left|leg|person|hierarchy", texts)


def _exchanged() -> str:
    """Every left joint named right, and the reverse."""
    return re.sub(r"(JOINT) (Left|Right)", lambda m: f"{m[1]} {'Right' if m[2] == 'Left' else 'Left'}", CLEAN)


def _rows() -> list[Mutant]:
    words = ("abc", "1,5", "0x10", "1_0", "١٢", "--1", "1..2", "1e", "None", "12.5f", "½", "")
    texts = {f"the number '{word}'": with_word(word) for word in words}
    texts["commas for points"] = with_rows([row.replace(".", ",") for row in ROWS])
    texts["a number too many"] = with_rows([*ROWS[:30], ROWS[30] + " 1.0", *ROWS[31:]])
    texts["two rows in one"] = with_rows([*ROWS[:30], f"{ROWS[30]} {ROWS[31]}", *ROWS[32:]])
    texts["a row in two"] = with_rows(
        [*ROWS[:30], *ROWS[30].rsplit(" ", 9)[0:1], " ".join(ROWS[30].split()[-9:]), *ROWS[31:]]
    )
    mutants = refused("walk.bvh", r"line \d+", texts)
    nothing = {"all numbers nan": with_rows([" ".join(["nan"] * COLUMNS)] * FRAMES)}
    return mutants + refused("walk.bvh", "up axis", nothing)


def _encodings() -> list[Mutant]:
    coded = {name: CLEAN.encode(name) for name in ("utf-16", "utf-16-le", "utf-16-be", "utf-32")}
    foreign = {
        "gzip": gzip.compress(CLEAN.encode(), mtime=0),
        "PNG": b"\x89PNG\r\n\x1a\n" + bytes(100),
        "a web page": "<!DOCTYPE html><html><body>404 Not Found</body></html>",
        "zero bytes in the middle": CLEAN[:2000].encode() + bytes(50) + CLEAN[2050:].encode(),
    }
    pointer = {"a large-file pointer": "version https://git-lfs.github.com/spec/v1\noid sha256:0\nsize 1\n"}
    mutants = refused("walk.bvh", "not text|zero bytes|HIERARCHY", {**coded, **foreign})
    return mutants + refused("walk.bvh", "it is a Git LFS pointer: .* Run `git lfs pull`", pointer)


def _same() -> list[Mutant]:
    texts = {
        "byte order mark": b"\xef\xbb\xbf" + CLEAN.encode(),
        "CRLF": CLEAN.replace("\n", "\r\n"),
        "CR": CLEAN.replace("\n", "\r"),
        "tabs": CLEAN.replace(" ", "\t"),
        "blanks at line ends": CLEAN.replace("\n", "   \n"),
        "blank lines between rows": with_rows([line for row in ROWS for line in (row, "")], FRAMES),
        "small letters": HEAD.replace("OFFSET", "offset").replace("CHANNELS", "channels") + f"MOTION\n{BODY}",
        "brackets on the joint's line": re.sub(r"\n\s*\{", " {", HEAD) + f"MOTION\n{BODY}",
        "no end of the last line": CLEAN.rstrip(),
        "Frames: 9e1": CLEAN.replace(f"Frames: {FRAMES}", "Frames: 9e1"),
        "plus signs and powers": with_values(lambda v: v).replace(" 0.", " +0."),
        "a turn of 360 degrees more": with_values(_wound),
        "millimetres": files.bvh(files.upright(FRAMES, seed=1), files.BvhStyle(metres_per_unit=0.001)),
        "metres": files.bvh(files.upright(FRAMES, seed=1), files.BvhStyle(metres_per_unit=1.0)),
        "inches": files.bvh(files.upright(FRAMES, seed=1), files.BvhStyle(metres_per_unit=0.0254)),
        "six channels in every joint": files.bvh(files.upright(FRAMES, seed=1), files.BvhStyle(all_positions=True)),
        "z up": files.bvh(files.upright(FRAMES, seed=1), files.BvhStyle(frame_turn=Z_UP)),
        "other orders": files.bvh(files.upright(FRAMES, seed=1), files.BvhStyle(orders=("XYZ", "YZX"))),
    }
    return [*understood("walk.bvh", texts), *understood("WALK.BVH", {"suffix in capitals": CLEAN})]


def _wound(values: np.ndarray) -> np.ndarray:
    values[30:, 9] += 360.0
    return values


def _changed(rows: slice, columns: slice | int, value: float | None = None, add: float = 0.0):
    def change(values: np.ndarray) -> np.ndarray:
        values[rows, columns] = values[rows, columns] + add if value is None else value
        return values

    return change


def _flagged() -> list[Mutant]:
    every = slice(None)
    texts = {
        "nan in one number": with_word("nan"),
        "inf in one number": with_word("-inf"),
        "1e999 in one number": with_word("1e999"),
        "a frame of nan": with_rows([*ROWS[:40], " ".join(["nan"] * COLUMNS), *ROWS[41:]]),
        "a second of nan": with_rows([*ROWS[:20], *[" ".join(["nan"] * COLUMNS)] * 60, *ROWS[80:]]),
        "a frame of zeros": with_values(_changed(slice(40, 41), every, 0.0)),
        "ten frames of zeros": with_values(_changed(slice(40, 50), every, 0.0)),
        "elsewhere from a frame on": with_values(_changed(slice(45, None), slice(0, 1), add=60.0)),
        "turned from a frame on": with_values(_changed(slice(45, None), 5, add=90.0)),
        "one joint jumps for a frame": with_values(_changed(slice(45, 46), 12, add=80.0)),
        "all joints stand still for half a second": with_rows([*ROWS[:40], *[ROWS[40]] * 30, *ROWS[70:]]),
        "each frame twice": with_rows([row for row in ROWS for _ in range(2)], time="0.00833333"),
        "each frame three times": with_rows([row for row in ROWS for _ in range(3)], time="0.00555556"),
        "a metre over the floor": with_values(_changed(every, 1, add=100.0)),
        "declares no frames": with_rows(ROWS, 0),
        "declares a frame less": with_rows(ROWS, FRAMES - 1),
    }
    return flagged("walk.bvh", texts)
