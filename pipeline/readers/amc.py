"""ASF/AMC of Acclaim: a skeleton file and a motion file. CMU convention: lengths in 1/`length` inch.

A bone has a direction and a length in the axes of the world at rest, and an `axis` frame that its degrees
of freedom turn about: R = C R(dof) C^-1. Euler angles XYZ mean Rz Ry Rx. A bone's joint lies at its
parent's end.
"""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np

from pipeline import rotation
from pipeline.clips.outcome import Reason
from pipeline.errors import AmbiguousFileError, FileError
from pipeline.readers.asf import Bone, ordered, read_asf
from pipeline.readers.poses import StoredPoses
from pipeline.readers.raw_motion import RawMotion, forward_kinematics
from pipeline.readers.text_file import MAX_FRAMES, read_lines, read_number

CMU_RATE_HZ = 120.0
"""Rate of the CMU recordings (mocap.cs.cmu.edu); an AMC names none."""

CMU_BONES = ("lhipjoint", "lowerback", "upperback", "thorax", "lowerneck", "upperneck", "lclavicle")
"""Bones that the skeletons of the CMU recordings have."""

_AXES = {"x": 0, "y": 1, "z": 2}


def read_amc(path: Path, stated_asf: str | None = None) -> RawMotion:
    """A motion and its skeleton. Raises FileError with the line."""
    asf = find_asf(path, stated_asf)
    bones = read_asf(asf)
    order = ordered(asf, bones)
    frames = _read_frames(path, bones)
    parents = tuple(-1 if (parent := bones[name].parent) is None else order.index(parent) for name in order)
    offsets = np.array([_joint_offset(bones, name) for name in order])
    local_pos = np.broadcast_to(offsets, (len(frames["root"]), len(order), 3)).copy()
    local_quat = np.stack([_local_quat(bones[name], frames[name]) for name in order], axis=1)
    local_pos[:, 0] = frames["root"][:, [bones["root"].dof.index(f"t{axis}") for axis in "xyz"]]
    pos, quat = forward_kinematics(parents, local_pos, local_quat)
    return RawMotion(
        format="amc",
        joint_names=tuple(order),
        parents=parents,
        rest_offset=offsets,
        poses=StoredPoses(pos_w=pos, quat_w=quat),
        fps=None,
        assumed_fps=CMU_RATE_HZ if set(CMU_BONES) <= set(order) else None,
        files=(path, asf),
        notes=_subject_note(path, asf),
    )


def find_asf(path: Path, stated: str | None) -> Path:
    """The ASF of an AMC: stated, of the same name, of the same subject number, or the only one beside it."""
    if stated is not None:
        asf = path.parent / stated
        if not asf.is_file():
            raise FileError(path, f"the stated ASF '{stated}' does not exist.")
        return asf
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
    """A rejection when the numbers in the names say that the skeleton is another person's."""
    motion, skeleton = (re.match(r"\d+", file.stem) for file in (path, asf))
    if motion is None or skeleton is None or int(motion.group()) == int(skeleton.group()):
        return ()
    text = (
        f"{path.name} is of subject {motion.group()}, {asf.name} of subject {skeleton.group()}: the bone lengths are "
        f"another person's, so feet slide. Put {motion.group()}.asf beside it."
    )
    return (Reason(code="skeleton_mismatch", text=text, effect="rejected"),)


def _joint_offset(bones: dict[str, Bone], name: str) -> np.ndarray:
    """Place of a bone's joint in its parent's frame: the parent's end."""
    parent = bones[name].parent
    return np.zeros(3) if parent is None else bones[parent].direction * bones[parent].length


def _euler(angles: np.ndarray, order: str) -> np.ndarray:
    """Quaternions of angles (t, 3) [rad] given in `order`; the first is applied first (order xyz: Rz Ry Rx)."""
    turn = rotation.IDENTITY
    for column, axis in enumerate(order):
        turn = rotation.multiply(rotation.from_axis_angle(np.eye(3)[_AXES[axis]], angles[..., column]), turn)
    return turn


def _local_quat(bone: Bone, values: np.ndarray) -> np.ndarray:
    """Rotation of a bone in its parent's frame (t, 4) from its degrees of freedom (t, n) [deg]."""
    angles = np.zeros((len(values), 3))
    for column, name in enumerate(bone.dof):
        if name.startswith("r"):
            angles[:, bone.axis_order.index(name[1])] = np.deg2rad(values[:, column])
    frame = _euler(np.deg2rad(bone.axis_deg), bone.axis_order)
    return rotation.multiply(rotation.multiply(frame, _euler(angles, bone.axis_order)), rotation.conjugate(frame))


def _read_frames(path: Path, bones: dict[str, Bone]) -> dict[str, np.ndarray]:
    """Values (t, n) of each bone's degrees of freedom, degrees and the file's unit."""
    moving = {name: len(bone.dof) for name, bone in bones.items() if bone.dof}
    frames: list[dict[str, list[float]]] = []
    numbers_start = False
    for line, text in enumerate(read_lines(path), start=1):
        words = text.split("#")[0].split()
        if not words:
            continue
        if words[0].startswith(":"):
            if words[0].upper() == ":RADIANS":
                raise FileError(path, "angles in radians are not supported.", line=line)
        elif len(words) == 1 and words[0].isdigit():
            _finish(path, frames, moving, line)
            numbers_start = True
            if int(words[0]) != len(frames) + 1 or len(frames) >= MAX_FRAMES:
                raise FileError(path, f"frame {words[0][:12]} follows frame {len(frames)}.", line=line)
            frames.append({})
        elif not numbers_start:
            raise FileError(path, "an AMC begins with its frame 1.", line=line)
        else:
            _bone_values(path, frames[-1], moving, words, line)
    if not frames:
        raise FileError(path, "the file has no frames.")
    _finish(path, frames, moving, None)
    zero = np.zeros((len(frames), 0))
    return {name: np.array([frame[name] for frame in frames]) if name in moving else zero for name in bones}


def _finish(path: Path, frames: list[dict[str, list[float]]], moving: dict[str, int], line: int | None) -> None:
    """The last frame is whole."""
    if frames and len(frames[-1]) != len(moving):
        missing = ", ".join(sorted(set(moving) - set(frames[-1])))
        raise FileError(path, f"frame {len(frames)} lacks: {missing}.", "It was cut off, or the ASF is another.", line)


def _bone_values(
    path: Path, frame: dict[str, list[float]], moving: dict[str, int], words: list[str], line: int
) -> None:
    name = words[0]
    if name not in moving:
        raise FileError(path, f"the bone '{name[:40]}' does not move in the ASF, or is not in it.", line=line)
    if len(words) - 1 != moving[name] or name in frame:
        problem = f"'{name}' has {len(words) - 1} numbers, wanted {moving[name]} once a frame."
        raise FileError(path, problem, line=line)
    frame[name] = [read_number(path, word, line, name) for word in words[1:]]
