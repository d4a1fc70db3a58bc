"""AMASS-style SMPL: pose as rotation vectors, on a mean human skeleton or on the user's own body model.

`poses` (t, 72 | 156 | 165): the root and 21 body joints come first in SMPL, SMPL-H and SMPL-X alike;
hands, jaw and eyes are not read. `trans` (t, 3) [m] moves the root.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from jaxtyping import Float

from pipeline import rotation
from pipeline.clips.outcome import Reason
from pipeline.errors import FileError
from pipeline.readers.npz_file import NpzHeader, open_npz
from pipeline.readers.poses import StoredPoses
from pipeline.readers.raw_motion import RawMotion, forward_kinematics

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

JOINTS = tuple(PARENTS)

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


def is_smpl(header: NpzHeader) -> bool:
    """An archive that holds an AMASS-style motion."""
    return header.has("poses", "trans")


def read_smpl(path: Path, body_model: Path | None = None) -> RawMotion:
    """An AMASS-style motion. Raises FileError."""
    header = open_npz(path)
    poses, trans = header.numbers("poses", None, None), header.numbers("trans", None, 3)
    if poses.shape[1] not in (72, 156, 165) or len(poses) != len(trans) or not len(poses):
        problem = f"poses are {poses.shape[0]}×{poses.shape[1]} and trans {trans.shape[0]}×3, wanted the same frames"
        raise FileError(path, f"{problem} and 72, 156 or 165 columns.")
    betas = header.array("betas").reshape(-1) if header.has("betas") else np.zeros(0)
    notes: tuple[Reason, ...] = ()
    if body_model is None:
        offsets = mean_skeleton()
        text = "The body is a mean human skeleton: the shape in the file needs a body model (`body_model:`)."
        notes = (Reason(code="mean_skeleton", text=text, effect="noted"),)
    else:
        offsets = read_body_model(body_model, betas)
    parents = tuple(-1 if parent is None else JOINTS.index(parent) for parent in PARENTS.values())
    local_pos = np.broadcast_to(offsets, (len(poses), len(JOINTS), 3)).copy()
    local_pos[:, 0] = trans + offsets[0]
    local_quat = rotation.from_rotvec(poses[:, : 3 * len(JOINTS)].reshape(len(poses), len(JOINTS), 3))
    pos, quat = forward_kinematics(parents, local_pos, local_quat)
    return RawMotion(
        format="smpl",
        joint_names=JOINTS,
        parents=parents,
        rest_offset=np.where(np.array(parents)[:, None] < 0, 0.0, offsets),
        poses=StoredPoses(pos_w=pos, quat_w=quat),
        fps=_declared_fps(header),
        files=(path,) if body_model is None else (path, body_model),
        unit="m",
        notes=notes,
    )


def _declared_fps(header: NpzHeader) -> float | None:
    for name in ("mocap_framerate", "mocap_frame_rate", "fps"):
        if header.has(name):
            return header.number(name)
    return None


def read_body_model(path: Path, betas: Float[np.ndarray, " b"]) -> Float[np.ndarray, "22 3"]:
    """Rest offsets of the shared joints [m] of a body model in a `.npz`; the root's is its place in the model.

    Takes joints (`J_template`, `J`), or `J_regressor` and `v_template` with `shapedirs` for the shape `betas`. Raises
    FileError.
    """
    header = open_npz(path)
    if header.has("J_regressor", "v_template"):
        vertices = header.numbers("v_template", None, 3)
        if header.has("shapedirs"):
            directions = header.numbers("shapedirs", len(vertices), 3, None)
            count = min(len(betas), directions.shape[2])
            vertices = vertices + directions[:, :, :count] @ betas[:count]
        joints = header.numbers("J_regressor", None, len(vertices)) @ vertices
    elif header.has("J_template") or header.has("J"):
        joints = header.numbers("J_template" if header.has("J_template") else "J", None, 3)
    else:
        raise FileError(path, "a body model needs J_template, or J_regressor with v_template.", "Only .npz is read.")
    if len(joints) < len(JOINTS):
        raise FileError(path, f"the body model has {len(joints)} joints, wanted at least {len(JOINTS)}.")
    joints = joints[: len(JOINTS)]
    parents = [0 if parent is None else JOINTS.index(parent) for parent in PARENTS.values()]
    offsets = joints - joints[parents]
    offsets[0] = joints[0]
    return offsets
