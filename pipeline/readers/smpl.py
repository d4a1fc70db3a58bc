"""SMPL bodies: pose as rotation vectors, on a mean human skeleton or on the user's own body model.

SMPL, SMPL-H and SMPL-X, with or without DMPL: the root and 21 body joints come first in all of them; hands, jaw, eyes
and soft tissue are not read. The pose is one array (`poses`, `pose_aa`: t x 66, 72, 156, 165 or t x joints x 3) or two
(`root_orient` and `pose_body`, `global_orient` and `body_pose`); `trans` or `transl` (t, 3) [m] moves the root.
"""

import math
from pathlib import Path

import numpy as np
from jaxtyping import Float

from pipeline import rotation
from pipeline.clips.outcome import Reason
from pipeline.errors import FileError
from pipeline.files.array_file import ArrayFile, finite_rows
from pipeline.files.npz import read_npz_header
from pipeline.readers.raw_motion import RawMotion, TreePoses, parent_indices

PARENTS: dict[str, str | None] = {
    "pelvis": None,
    "left_hip": "pelvis",
    "right_hip": "pelvis",
    "spine1": "pelvis",
    "left_knee": "left_hip",
    "right_knee": "right_hip",
    "spine2": "spine1",
    "left_ankle": "left_knee",
    "right_ankle": "right_knee",
    "spine3": "spine2",
    "left_foot": "left_ankle",
    "right_foot": "right_ankle",
    "neck": "spine3",
    "left_collar": "spine3",
    "right_collar": "spine3",
    "head": "neck",
    "left_shoulder": "left_collar",
    "right_shoulder": "right_collar",
    "left_elbow": "left_shoulder",
    "right_elbow": "right_shoulder",
    "left_wrist": "left_elbow",
    "right_wrist": "right_elbow",
}
"""The 22 joints that all SMPL models share, in their order, and their parents."""

JOINTS, PARENT = tuple(PARENTS), parent_indices(PARENTS)

MEAN_STATURE = 1.70
"""[m], near the mean of adults of both sexes (NCD-RisC 2016: men 1.71, women 1.59 worldwide, taller in mocap)."""

_LEFT_OFFSETS: dict[str, tuple[float, float, float]] = {
    # x left, y up, z forward at rest (T-pose), in parts of the stature. From Drillis and Contini (1966) as in Winter,
    # Biomechanics and Motor Control of Human Movement (2009), fig. 4.1: thigh .245, shank .246, upper arm .186,
    # forearm .146, shoulder half-breadth .129, hip height .530, shoulder height .818. Hip joint centres lie .72 of the
    # distance of the front iliac spines apart, .24 m (Bell et al., J. Biomech. 23, 1990). Taken here, not in the
    # figure: the ball of the foot at .72 and the ankle at .25 of the foot's length .152, the joints along the spine.
    "left_hip": (0.050, -0.045, 0.0),
    "spine1": (0.0, 0.065, 0.0),
    "left_knee": (0.0, -0.245, 0.0),
    "spine2": (0.0, 0.075, 0.0),
    "left_ankle": (0.0, -0.246, 0.0),
    "spine3": (0.0, 0.035, 0.0),
    "left_foot": (0.0, -0.030, 0.071),
    "neck": (0.0, 0.120, 0.0),
    "left_collar": (0.045, 0.065, 0.0),
    "head": (0.0, 0.052, 0.015),
    "left_shoulder": (0.065, 0.003, 0.0),
    "left_elbow": (0.186, 0.0, 0.0),
    "left_wrist": (0.146, 0.0, 0.0),
}


def mean_skeleton() -> Float[np.ndarray, "22 3"]:
    """Rest offsets of the shared joints from their parents [m], of a person of the mean stature."""
    offsets = {"pelvis": (0.0, 0.0, 0.0), **_LEFT_OFFSETS}
    mirrored = {f"right{name[4:]}": (-x, y, z) for name, (x, y, z) in _LEFT_OFFSETS.items() if name.startswith("left")}
    return MEAN_STATURE * np.array([{**offsets, **mirrored}[name] for name in JOINTS])


WHOLE = ("poses", "pose_aa", "smpl_poses")
"""Names of the array with root and body."""
ROOTS = ("root_orient", "global_orient")
BODIES = ("pose_body", "body_pose")
TRANSLATIONS = ("trans", "transl", "trans_orig", "root_trans_offset")
RATES = ("mocap_framerate", "mocap_frame_rate", "mocap_fps", "fps", "framerate")
SHAPES = ("betas", "beta", "shape")

COLUMNS = (66, 72, 156, 165)
"""Three for each joint of the root and the body (66), with SMPL's hands, SMPL-H's and SMPL-X's fingers and face."""
BODY_COLUMNS = (63, 69, 153, 162)
"""Numbers of columns without the root."""


def is_smpl(arrays: ArrayFile) -> bool:
    """Whether arrays are an SMPL motion."""
    posed = arrays.first(*WHOLE) or (arrays.first(*ROOTS) and arrays.first(*BODIES))
    return bool(posed) and arrays.first(*TRANSLATIONS) is not None


def read_smpl(arrays: ArrayFile, body_model: Path | None = None, assumed_fps: float | None = None) -> RawMotion:
    """Read an SMPL motion. `assumed_fps`: known rate of the program that wrote it [Hz]. Raises FileError."""
    translation, shape = arrays.first(*TRANSLATIONS), arrays.first(*SHAPES)
    assert translation is not None
    trans = arrays.stored_numbers(translation, None, 3)
    turns = _turns(arrays, len(trans), translation)
    betas = arrays.array(shape).reshape(-1) if shape is not None else np.zeros(0)
    notes: tuple[Reason, ...] = ()
    if body_model is None:
        offsets = mean_skeleton()
        text = "The body is a mean human skeleton: the shape in the file needs a body model (`body_model:`)."
        notes = (Reason(code="mean_skeleton", text=text, effect="noted"),)
    else:
        offsets = read_body_model(body_model, betas)
    return RawMotion(
        format="smpl",
        joint_names=JOINTS,
        parents=PARENT,
        rest_offset=np.where(np.array(PARENT)[:, None] < 0, 0.0, offsets),
        poses=_poses(trans, turns, offsets),
        fps=arrays.optional_number(*RATES),
        assumed_fps=assumed_fps,
        files=(arrays.path,) if body_model is None else (arrays.path, body_model),
        unit="m",
        notes=notes,
    )


def _poses(trans: np.ndarray, turns: tuple[np.ndarray, ...], offsets: Float[np.ndarray, "22 3"]) -> TreePoses:
    """Poses from translations (t, 3) [m] and rotation vectors [rad] in one or two arrays, computed as needed."""

    def local(start: int, stop: int) -> tuple[np.ndarray, np.ndarray]:
        rows = np.concatenate([finite_rows(each, start, stop) for each in turns], axis=1)
        vectors = rows[:, : 3 * len(JOINTS)].reshape(len(rows), len(JOINTS), 3)
        return finite_rows(trans, start, stop) + offsets[0], rotation.from_rotvec(vectors)

    return TreePoses(parents=PARENT, offsets=offsets, rows=(trans, *turns), local=local)


def _turns(arrays: ArrayFile, frames: int, translation: str) -> tuple[np.ndarray, ...]:
    """Rotation vectors of the root and the body's joints [rad] as stored in the file. Raises FileError."""
    whole, root, body = arrays.first(*WHOLE), arrays.first(*ROOTS), arrays.first(*BODIES)
    if whole is not None:
        poses = _rows(arrays, whole)
        if poses.shape[1] not in COLUMNS or len(poses) != frames or not frames:
            problem = (
                f"{whole} are {len(poses)}×{poses.shape[1]} and {translation} {frames}×3, expected the same frames"
            )
            raise FileError(arrays.path, f"{problem} and 66, 72, 156 or 165 columns.")
        return (poses,)
    assert root is not None and body is not None
    turn, rest = _rows(arrays, root), _rows(arrays, body)
    if turn.shape[1] != 3 or rest.shape[1] not in BODY_COLUMNS or {len(turn), len(rest)} != {frames} or not frames:
        problem = (
            f"{root} is {len(turn)}×{turn.shape[1]}, {body} {len(rest)}×{rest.shape[1]} and {translation} {frames}×3, "
            "expected the same frames, 3 columns and 63 or 69."
        )
        raise FileError(arrays.path, problem)
    return (turn, rest)


def _rows(arrays: ArrayFile, name: str) -> np.ndarray:
    """Rotation vectors with all joints in one row per frame; stored like that or as (t, joints, 3)."""
    shape = (None, None, 3) if len(arrays.shapes[name]) == 3 else (None, None)
    rows = arrays.stored_numbers(name, *shape)
    return rows.reshape(len(rows), math.prod(rows.shape[1:]))


def read_body_model(path: Path, betas: Float[np.ndarray, " b"]) -> Float[np.ndarray, "22 3"]:
    """Rest offsets of the shared joints [m] of a body model in a `.npz`; the root's is its position in the model.

    Takes joints (`J_template`, `J`), or `J_regressor` and `v_template` with `shapedirs` for the shape `betas`. Raises
    FileError.
    """
    header = read_npz_header(path)
    if header.has("J_regressor", "v_template"):
        vertices = header.numbers("v_template", None, 3)
        if header.has("shapedirs"):
            directions = header.numbers("shapedirs", len(vertices), 3, None)
            count = min(len(betas), directions.shape[2])
            vertices = vertices + directions[:, :, :count] @ betas[:count]
        joints = header.numbers("J_regressor", None, len(vertices)) @ vertices
    elif (name := header.first("J_template", "J")) is not None:
        joints = header.numbers(name, None, 3)
    else:
        raise FileError(path, "a body model needs J_template, or J_regressor with v_template.", "Only .npz is read.")
    if len(joints) < len(JOINTS):
        raise FileError(path, f"the body model has {len(joints)} joints, expected at least {len(JOINTS)}.")
    joints = joints[: len(JOINTS)]
    offsets = joints - joints[list(PARENT)]
    offsets[0] = joints[0]
    return offsets
