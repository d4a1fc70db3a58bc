"""ASF of Acclaim: the bones of a skeleton, their directions, lengths, axes and degrees of freedom."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from pipeline import rotation
from pipeline.errors import FileError
from pipeline.readers.text_file import read_lines, read_number

MAX_BONES = 500


@dataclass
class Bone:
    """A bone of an ASF while the file is read."""

    name: str
    line: int
    direction: np.ndarray = field(default_factory=lambda: np.zeros(3))
    length: float = 0.0
    axis_deg: np.ndarray = field(default_factory=lambda: np.zeros(3))
    axis_order: str = "xyz"
    dof: tuple[str, ...] = ()
    parent: str | None = None


def read_asf(path: Path) -> dict[str, Bone]:
    """Bones by name, the root among them."""
    bones = {"root": Bone(name="root", line=1)}
    section, current = "", None
    for line, text in enumerate(read_lines(path), start=1):
        words = text.split("#")[0].replace("(", " ").replace(")", " ").split()
        if not words:
            continue
        if words[0].startswith(":"):
            section, current = words[0].lower(), None
        elif section == ":root":
            _root_entry(path, bones["root"], words, line)
        elif section == ":bonedata":
            current = _bone_entry(path, bones, current, words, line)
        elif section == ":hierarchy" and words[0] not in ("begin", "end"):
            _hierarchy_entry(path, bones, words, line)
    if len(bones) < 2:
        raise FileError(path, "the ASF has no bones.", "It was cut off or is another kind of file.")
    return bones


def _root_entry(path: Path, root: Bone, words: list[str], line: int) -> None:
    key = words[0].lower()
    if key == "order":
        root.dof = tuple(word.lower() for word in words[1:])
        if sorted(root.dof) != ["rx", "ry", "rz", "tx", "ty", "tz"]:
            raise FileError(path, f"the root's order is '{' '.join(words[1:])}', wanted TX TY TZ RX RY RZ.", line=line)
    elif key == "axis":
        root.axis_order = _order(path, words[1:], line)
    elif key in ("position", "orientation"):
        values = [read_number(path, word, line, f"the root's {key}") for word in words[1:4]]
        if any(values):
            raise FileError(path, f"a root {key} other than zero is not supported.", line=line)


def _bone_entry(path: Path, bones: dict[str, Bone], bone: Bone | None, words: list[str], line: int) -> Bone | None:
    key = words[0].lower()
    if key == "begin":
        return Bone(name="", line=line)
    if bone is None:
        return None
    if key == "name" and len(words) == 2:
        if words[1] in bones or len(bones) > MAX_BONES:
            raise FileError(path, f"the bone '{words[1][:40]}' is there twice, or there are too many.", line=line)
        bone.name = words[1]
        bones[bone.name] = bone
    elif key in ("direction", "length", "axis"):
        count = 1 if key == "length" else 3
        if len(words) < 1 + count:
            raise FileError(path, f"'{key}' wants {count} numbers.", line=line)
        values = np.array([read_number(path, word, line, key) for word in words[1 : 1 + count]])
        if key == "axis":
            bone.axis_deg, bone.axis_order = values, _order(path, words[4:], line)
        elif key == "length":
            bone.length = float(values[0])
        else:
            bone.direction = rotation.normalize(values)
    elif key == "dof":
        bone.dof = tuple(word.lower() for word in words[1:])
        if set(bone.dof) - {"rx", "ry", "rz"} or len(set(bone.dof)) < len(bone.dof):
            raise FileError(path, f"degrees of freedom '{' '.join(words[1:])}', wanted rx, ry, rz.", line=line)
    elif key == "end":
        return None
    return bone


def _order(path: Path, words: list[str], line: int) -> str:
    order = words[0].lower() if words else ""
    if sorted(order) != ["x", "y", "z"]:
        raise FileError(path, f"the axis order is '{order}', wanted such as XYZ.", line=line)
    return order


def _hierarchy_entry(path: Path, bones: dict[str, Bone], words: list[str], line: int) -> None:
    for name in words:
        if name not in bones:
            raise FileError(path, f"the hierarchy names the bone '{name[:40]}', which has no data.", line=line)
    for name in words[1:]:
        if bones[name].parent is not None or name == "root":
            raise FileError(path, f"the bone '{name[:40]}' has two parents.", line=line)
        bones[name].parent = words[0]


def ordered(path: Path, bones: dict[str, Bone]) -> list[str]:
    """Names with parents before children."""
    order = ["root"]
    for name in order:
        order.extend(child for child, bone in bones.items() if bone.parent == name and child not in order)
    loose = sorted(set(bones) - set(order))
    if loose:
        raise FileError(path, f"bones that hang on nothing: {', '.join(loose)}.")
    return order
