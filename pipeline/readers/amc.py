"""ASF/AMC of Acclaim: a skeleton file and a motion file. CMU convention: lengths in 1/`length` inch.

A bone has a direction and a length in the world axes of the rest pose, and an `axis` frame for its degrees of
freedom: R = C R(dof) C^-1. Euler angles XYZ mean Rz Ry Rx. A bone's joint is at its parent's end.
"""

import re
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from jaxtyping import Float

from pipeline import rotation
from pipeline.clips.outcome import Reason
from pipeline.errors import AmbiguousFileError, FileError
from pipeline.files import page_memory
from pipeline.readers.raw_motion import RawMotion, TreePoses, parent_indices
from pipeline.readers.text_file import MAX_FRAMES, open_text, read_number

MAX_BONES = 500


@dataclass
class Bone:
    """A bone of an ASF while the file is read."""

    name: str
    direction: np.ndarray = field(default_factory=lambda: np.zeros(3))
    length: float = 0.0
    axis_deg: np.ndarray = field(default_factory=lambda: np.zeros(3))
    axis_order: str = "xyz"
    dof: tuple[str, ...] = ()
    parent: str | None = None


def read_asf(path: Path) -> dict[str, Bone]:
    """Read the bones by name, including the root."""
    bones = {"root": Bone(name="root")}
    section, current = "", None
    for line, text in enumerate(open_text(path).lines(), start=1):
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
            raise FileError(
                path, f"the root's order is '{' '.join(words[1:])}', expected TX TY TZ RX RY RZ.", line=line
            )
    elif key == "axis":
        root.axis_order = _order(path, words[1:], line)
    elif key in ("position", "orientation"):
        values = [read_number(path, word, line, f"the root's {key}") for word in words[1:4]]
        if any(values):
            raise FileError(path, f"a root {key} other than zero is not supported.", line=line)


def _bone_entry(path: Path, bones: dict[str, Bone], bone: Bone | None, words: list[str], line: int) -> Bone | None:
    key = words[0].lower()
    if key == "begin":
        return Bone(name="")
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
            raise FileError(path, f"degrees of freedom '{' '.join(words[1:])}', expected rx, ry, rz.", line=line)
    elif key == "end":
        return None
    return bone


def _order(path: Path, words: list[str], line: int) -> str:
    order = words[0].lower() if words else ""
    if sorted(order) != ["x", "y", "z"]:
        raise FileError(path, f"the axis order is '{order}', expected for example XYZ.", line=line)
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


CMU_RATE_HZ = 120.0
"""Rate of the CMU recordings (mocap.cs.cmu.edu); an AMC names none."""

CMU_BONES = ("lhipjoint", "lowerback", "upperback", "thorax", "lowerneck", "upperneck", "lclavicle")
"""Bones that identify the skeletons of the CMU recordings."""


def read_amc(path: Path, stated_asf: str | None = None) -> RawMotion:
    """Read a motion and its skeleton. Raises FileError with the line."""
    asf = find_asf(path, stated_asf)
    bones = read_asf(asf)
    order = ordered(asf, bones)
    columns, first = {}, 0
    for name, bone in bones.items():
        if bone.dof:
            columns[name] = slice(first, first + len(bone.dof))
            first += len(bone.dof)
    rows = _read_frames(path, columns)
    parents = parent_indices({name: bones[name].parent for name in order})
    ends = {name: bone.direction * bone.length for name, bone in bones.items()}  # positions of the children's joints
    offsets = np.array([ends.get(bones[name].parent or "", np.zeros(3)) for name in order])
    place = [columns["root"].start + bones["root"].dof.index(f"t{axis}") for axis in "xyz"]

    def local(start: int, stop: int) -> tuple[np.ndarray, np.ndarray]:
        part = rows[start:stop]
        nothing = slice(0, 0)
        turns = [_local_quat(bones[name], part[:, columns.get(name, nothing)]) for name in order]
        return part[:, place], np.stack(turns, axis=1)

    return RawMotion(
        format="amc",
        joint_names=tuple(order),
        parents=parents,
        rest_offset=offsets,
        poses=TreePoses(
            parents=parents,
            offsets=offsets,
            rows=(rows,),
            local=local,
        ),
        fps=None,
        assumed_fps=CMU_RATE_HZ if set(CMU_BONES) <= set(order) else None,
        files=(path, asf),
        notes=_subject_note(path, asf),
    )


def find_asf(path: Path, stated: str | None) -> Path:
    """The ASF of an AMC: stated, with the same name, with the same subject number, or the only one in the folder."""
    if stated is not None:
        if not (path.parent / stated).is_file():
            raise FileError(path, f"the stated ASF '{stated}' does not exist.")
        return path.parent / stated
    beside = sorted(entry for entry in path.parent.iterdir() if entry.suffix.lower() == ".asf")
    for stem in (path.stem, path.stem.split("_")[0]):
        for asf in beside:
            if asf.stem.lower() == stem.lower():
                return asf
    if len(beside) == 1:
        return beside[0]
    found = ", ".join(asf.name for asf in beside) or "none"
    do = "Put the subject's .asf beside it, or state `asf:` in data/sources.yaml."
    raise AmbiguousFileError(path, f"an AMC needs its skeleton, an ASF file; beside it: {found}.", do)


def _subject_note(path: Path, asf: Path) -> tuple[Reason, ...]:
    """A rejection if the subject numbers in the file names differ."""
    motion, skeleton = (re.match(r"\d+", file.stem) for file in (path, asf))
    if motion is None or skeleton is None or int(motion.group()) == int(skeleton.group()):
        return ()
    text = (
        f"{path.name} is of subject {motion.group()}, {asf.name} of subject {skeleton.group()}: the bone lengths are "
        f"another person's, so feet slide. Put {motion.group()}.asf beside it."
    )
    return (Reason(code="skeleton_mismatch", text=text, effect="rejected"),)


def _euler(angles: np.ndarray, order: str) -> np.ndarray:
    """Quaternions of angles (t, 3) [rad] given in `order`; the first is applied first (order xyz: Rz Ry Rx)."""
    return rotation.from_euler([("xyz".index(axis), angles[..., place]) for place, axis in enumerate(order)][::-1])


def _local_quat(bone: Bone, values: np.ndarray) -> np.ndarray:
    """Rotation of a bone in its parent's frame (t, 4) from its degrees of freedom (t, n) [deg]."""
    angles = np.zeros((len(values), 3))
    for column, name in enumerate(bone.dof):
        if name.startswith("r"):
            angles[:, bone.axis_order.index(name[1])] = np.deg2rad(values[:, column])
    frame = _euler(np.deg2rad(bone.axis_deg), bone.axis_order)
    return rotation.multiply(rotation.multiply(frame, _euler(angles, bone.axis_order)), rotation.conjugate(frame))


def _read_frames(path: Path, columns: dict[str, slice]) -> Float[np.ndarray, "t c"]:
    """One row of values per frame, in degrees and the file's unit. Raises FileError with the line."""
    text = open_text(path)
    width = max(each.stop for each in columns.values())
    most = min(text.line_count, path.stat().st_size // (2 * width) + 1, MAX_FRAMES + 1)
    rows, count, seen = page_memory.empty((most, width)), 0, set[str]()
    for line, words in ((line, each.split("#")[0].split()) for line, each in enumerate(text.lines(), start=1)):
        if not words:
            continue
        if words[0].startswith(":"):
            if words[0].upper() == ":RADIANS":
                raise FileError(path, "angles in radians are not supported.", line=line)
        elif len(words) == 1 and words[0].isdigit():
            _check_whole(path, count, seen, columns, line)
            if words[0].lstrip("0") != str(count + 1) or count >= min(MAX_FRAMES, most):
                raise FileError(path, f"frame {words[0][:12]} follows frame {count}.", line=line)
            count, seen = count + 1, set()
        elif not count:
            raise FileError(path, "an AMC begins with its frame 1.", line=line)
        else:
            _bone_values(path, rows[count - 1], seen, columns, words, line)
    if not count:
        raise FileError(path, "the file has no frames.")
    _check_whole(path, count, seen, columns, None)
    return rows[:count]


def _check_whole(path: Path, count: int, seen: set[str], columns: dict[str, slice], line: int | None) -> None:
    """Check the last frame. Raises FileError if it lacks bones."""
    missing = sorted(set(columns) - seen)
    if count and missing:
        problem = f"frame {count} lacks: {', '.join(missing)}."
        raise FileError(path, problem, "It was cut off, or the ASF is another.", line)


def _bone_values(
    path: Path, row: Float[np.ndarray, " c"], seen: set[str], columns: dict[str, slice], words: list[str], line: int
) -> None:
    """Write the values of one line into its frame's row. Raises FileError."""
    name = words[0]
    if name not in columns:
        raise FileError(path, f"the bone '{name[:40]}' does not move in the ASF, or is not in it.", line=line)
    wanted = columns[name].stop - columns[name].start
    if len(words) - 1 != wanted or name in seen:
        raise FileError(path, f"'{name}' has {len(words) - 1} numbers, expected {wanted} once a frame.", line=line)
    row[columns[name]] = [read_number(path, word, line, name) for word in words[1:]]
    seen.add(name)
