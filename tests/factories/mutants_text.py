"""Faults of ASF/AMC, DeepMimic and robot CSV files, planted into clean ones."""

from __future__ import annotations

import copy
import json
import re
from collections.abc import Callable, Mapping

import numpy as np

from pipeline.cli.retarget_command import encode_csv
from pipeline.robot import load_robot
from tests.factories import motion_files as files
from tests.factories.mutant import Mutant, flagged, refused, understood
from tests.factories.robot_clips import standing

AMC_FRAMES, JSON_FRAMES, CSV_FRAMES = 60, 60, 60
ASF = files.asf()
AMC = files.amc([{}] * AMC_FRAMES, [[0.0, 17.0, 0.02 * index, 0.0, 0.0, 0.0] for index in range(AMC_FRAMES)])
BESIDE = {"07.asf": ASF.encode()}
MOTION = files.deepmimic(JSON_FRAMES)


def amc_mutants() -> list[Mutant]:
    """Of motions and of skeletons."""
    line = "lfemur 0.0 0.0 0.0"
    frame = AMC[AMC.index("\n30\n") + 1 : AMC.index("\n31\n") + 1]
    texts = {f"cut at {share:.0%}": AMC[: int(share * len(AMC))] for share in (0.01, 0.3, 0.503, 0.75, 0.995)}
    texts |= {
        "empty": "",
        "a frame left out": AMC.replace(frame, ""),
        "a frame twice": AMC.replace(frame, frame + frame),
        "a bone twice": AMC.replace(line, f"{line}\n{line}", 1),
        "a bone left out": AMC.replace(f"{line}\n", "", 1),
        "an unknown bone": AMC.replace(line, f"tail 0\n{line}", 1),
        "a number too few": AMC.replace(line, "lfemur 0.0 0.0", 1),
        "a number too many": AMC.replace(line, f"{line} 0.0", 1),
        "radians": AMC.replace(":DEGREES", ":RADIANS"),
        "no frame numbers": re.sub(r"\n\d+\n", "\n", AMC),
        "UTF-16": AMC.encode("utf-16"),
    }
    texts |= {
        f"the number {word}": AMC.replace(line, f"lfemur {word} 0.0 0.0", 1) for word in ("nan", "x", "1,5", "1_0")
    }
    mutants = refused("07_01.amc", r"line \d+|frame \d+|frames|text|empty|begins", texts, beside=BESIDE)
    return mutants + refused("07_01.amc", "ASF", {"no skeleton": AMC}) + _asf_mutants() + _amc_as_before()


def _amc_as_before() -> list[Mutant]:
    texts = {
        "CRLF": AMC.replace("\n", "\r\n"),
        "comments": AMC.replace("\n30\n", "\n# a comment\n30\n"),
        "byte order mark": b"\xef\xbb\xbf" + AMC.encode(),
    }
    return understood("07_01.amc", texts, beside=BESIDE)


def _asf_mutants() -> list[Mutant]:
    turned = {
        "empty": "",
        "cut": ASF[:700],
        "bone twice": ASF.replace("name lfemur", "name rfemur"),
        "length nan": ASF.replace("length 7.4", "length nan"),
        "length missing": ASF.replace("length 7.4", "length"),
        "direction of two numbers": re.sub(r"direction (\S+) (\S+) \S+", r"direction \1 \2", ASF, count=1),
        "unknown degree of freedom": ASF.replace("dof rx ry rz", "dof rx ry rw", 1),
        "axis order": ASF.replace("0 0 20 XYZ", "0 0 20 XXZ"),
        "two parents": ASF.replace("lowerback upperback", "lowerback upperback\n    ltibia upperback"),
        "a ring": ASF.replace("root lhipjoint", "root").replace("lfoot ltoes", "lfoot ltoes lhipjoint"),
        "unknown child": ASF.replace("lfoot ltoes", "lfoot ltoes tail"),
        "root moved": ASF.replace("position 0 0 0", "position 0 1 0"),
        "root order": ASF.replace("order TX TY TZ RX RY RZ", "order TX TY RX RY RZ"),
        "zero bytes": ASF.encode().replace(b"length", b"len\0th", 1),
    }
    # the motion is requested, the message names the skeleton's file
    return [
        mutant
        for name, text in turned.items()
        for mutant in refused(
            "07_01.amc",
            r"07\.asf|frame 1|no size|leg|axes",
            {f"ASF {name}": AMC},
            beside={"07.asf": text if isinstance(text, bytes) else text.encode()},
        )
    ]


def deepmimic_mutants() -> list[Mutant]:
    """Of JSON and of what it says."""
    text = json.dumps(MOTION)
    texts = {f"cut at {share:.0%}": text[: int(share * len(text))] for share in (0.02, 0.3, 0.7, 0.999)}
    texts |= {
        "empty": "",
        "lists 100,000 deep": "{" + '"Frames": ' + "[" * 100_000 + "]" * 100_000 + "}",
        "objects 100,000 deep": '{"a":' * 100_000 + "1" + "}" * 100_000,
        "no Frames": '{"Loop": "none"}',
        "Frames of a text": '{"Frames": "many"}',
        "Frames of an object": '{"Frames": {"0": []}}',
        "Frames twice": text[:-1] + ', "Frames": []}',
        "no frames": '{"Frames": []}',
        "one frame": json.dumps(files.deepmimic(1)),
        "UTF-16": text.encode("utf-16"),
        "a comment": "// motion\n" + text,
        "a comma too many": text[:-2] + ",]}",
        "single quotes": text.replace('"', "'"),
    }
    for name, value in _wrong_values().items():
        motion = copy.deepcopy(MOTION)
        motion["Frames"][30][20] = value
        texts[f"the value {name}"] = json.dumps(motion)
    for name, token in {"400 digits": "9" * 400, "5,000 digits": "9" * 5000}.items():
        texts[f"a number of {name}"] = text.replace("[0.0333", f"[{token}, 0.0333", 1).replace(", 0.0333", "", 1)
    for name, changes in _wrong_frames().items():
        motion = copy.deepcopy(MOTION)
        changes(motion["Frames"])
        texts[name] = json.dumps(motion)
    mutants = refused("walk.txt", r"line \d+|frame|Frames|text|empty|JSON|unit|rate|lasts", texts)
    bare = {"all on one line or many": json.dumps(MOTION, indent=1), "byte order mark": b"\xef\xbb\xbf" + text.encode()}
    bare |= {"another key": json.dumps({"Comment": "x", **MOTION}), "whole numbers": text.replace("0.0,", "0,")}
    marked = text.replace("0.02", "NaN", 1)
    return mutants + understood("walk.txt", bare) + flagged("walk.txt", {"NaN in one number": marked})


def _wrong_values() -> dict[str, object]:
    return {"of a text": "1.0", "null": None, "true": True, "of a list": [1.0], "of an object": {}}


def _wrong_frames() -> Mapping[str, Callable[[list], object]]:
    def long(frames):
        frames[7] = [*frames[7], 0.0]

    def short(frames):
        frames[7] = frames[7][:-1]

    def quaternion(frames):
        for frame in frames:
            frame[4:8] = [2.0, 0.0, 0.0, 0.0]

    def still(frames):
        for frame in frames:
            frame[0] = 0.0

    def backwards(frames):
        for frame in frames:
            frame[0] = -frame[0]

    def uneven(frames):
        frames[7][0] = 0.5

    named = {"a frame too long": long, "a frame too short": short, "a frame that is no list": lambda f: f.insert(3, 5)}
    return named | {
        "quaternions of length 2": quaternion,
        "frames of no duration": still,
        "frames of negative duration": backwards,
        "frames of two durations": uneven,
    }


def csv_mutants() -> list[Mutant]:
    """Of a robot's table."""
    clean = robot_csv()
    head, names, *rows = clean.splitlines()
    texts = {f"cut at {share:.0%}": clean[: int(share * len(clean))] for share in (0.02, 0.305, 0.7003)}
    texts |= {
        "empty": "",
        "no rows": f"{head}\n{names}\n",
        "one row": f"{head}\n{names}\n{rows[0]}\n",
        "a cell too many": "\n".join([head, names, *rows[:9], f"{rows[9]},0.1", *rows[10:]]),
        "a cell too few": "\n".join([head, names, *rows[:9], rows[9].rsplit(",", 1)[0], *rows[10:]]),
        "a joint left out": "\n".join(line.rsplit(",", 1)[0] if "," in line else line for line in clean.splitlines()),
        "a joint twice": clean.replace("Left_Elbow_Yaw", "Right_Elbow_Yaw", 1),
        "an unknown joint": clean.replace("Left_Elbow_Yaw", "Tail", 1),
        "quaternion columns": clean.replace("quat_w", "quat_x", 1),
        "no root": "\n".join(",".join(line.split(",")[7:]) if "," in line else line for line in clean.splitlines()),
        "no rate": clean.replace(head + "\n", ""),
        "quaternions of length 2": _csv_rows(lambda v: _times(v, slice(3, 7), 2.0)),
        "quaternions wxyz under the names xyzw": _csv_rows(_rolled),
        "degrees": _csv_rows(lambda v: _times(v, slice(7, None), 180.0 / np.pi)),
        "UTF-16": clean.encode("utf-16"),
        "semicolons": clean.replace(",", ";"),
    }
    words = ("x", "1_0", "0x1", "١", "1 2", "=A1", "", "--1")
    texts |= {f"the cell '{word}'": clean.replace(rows[5], _cell(rows[5], word)) for word in words}
    texts |= {f"fps {rate}": clean.replace(head, f"# fps: {rate}") for rate in ("0", "-50", "nan", "1e9", "x")}
    mutants = refused("robot.csv", r"line \d+|frame|joint|column|rate|quaternion|tilted|text|empty|fps", texts)
    same = {
        "CRLF": clean.replace("\n", "\r\n"),
        "blanks around commas": clean.replace(",", " , "),
        "comments": f"# by me\n{clean}",
        "signs of quaternions flipped": _csv_rows(_flipped),
    }
    marked = {f"the cell {word}": clean.replace(rows[5], _cell(rows[5], word)) for word in ("nan", "inf", "1e999")}
    marked["a teleport"] = _csv_rows(lambda v: _moved(v, 0.7))
    return mutants + understood("robot.csv", same) + flagged("robot.csv", marked)


def _cell(row: str, word: str) -> str:
    cells = row.split(",")
    return ",".join([*cells[:12], word, *cells[13:]])


def robot_csv() -> str:
    """A T1 that sways, with header and rate."""
    clip = standing(load_robot("t1"), seconds=CSV_FRAMES / 50.0)
    wave = 0.1 * np.sin(np.arange(CSV_FRAMES) / 9.0)[:, None]
    clip.joint_pos[:] += wave
    return encode_csv(clip, {}).replace(f"# robot: {clip.robot}\n", "")


def _csv_rows(change) -> str:
    head, names, *rows = robot_csv().splitlines()
    values = change(np.array([[float(cell) for cell in row.split(",")] for row in rows]))
    return "\n".join([head, names, *(",".join(f"{value:.8f}" for value in row) for row in values)]) + "\n"


def _times(values: np.ndarray, columns: slice, factor: float) -> np.ndarray:
    values[:, columns] *= factor
    return values


def _rolled(values: np.ndarray) -> np.ndarray:
    values[:, 3:7] = np.roll(values[:, 3:7], 1, axis=1)
    return values


def _flipped(values: np.ndarray) -> np.ndarray:
    values[1::2, 3:7] *= -1.0
    return values


def _moved(values: np.ndarray, way: float) -> np.ndarray:
    values[30:, 0] += way
    return values
