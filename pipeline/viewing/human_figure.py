"""A human motion as a figure of capsules between joint positions; only the head uses its orientation."""

import itertools

import numpy as np
from jaxtyping import Float

from pipeline import rotation
from pipeline.clips.human_clip import BODIES, HumanClip, body
from pipeline.errors import ClipError
from pipeline.quality.planar_motion import facing_of
from pipeline.robot.legs import mirrored_name
from pipeline.viewing.figure import Color, Figure, Part, Shape

SKIN: Color = (0.87, 0.68, 0.53)
SHIRT: Color = (0.25, 0.45, 0.70)
TROUSERS: Color = (0.30, 0.32, 0.38)
SHOE: Color = (0.55, 0.25, 0.20)

BONES: tuple[tuple[str, str, float, Color], ...] = (
    ("left_hip", "right_hip", 0.085, TROUSERS),
    ("pelvis", "chest", 0.105, SHIRT),
    ("left_shoulder", "right_shoulder", 0.060, SHIRT),
    ("chest", "neck", 0.080, SHIRT),
    ("neck", "head", 0.050, SKIN),
    ("left_hip", "left_knee", 0.068, TROUSERS),
    ("left_knee", "left_ankle", 0.048, TROUSERS),
    ("left_ankle", "left_toe", 0.038, SHOE),
    ("right_hip", "right_knee", 0.068, TROUSERS),
    ("right_knee", "right_ankle", 0.048, TROUSERS),
    ("right_ankle", "right_toe", 0.038, SHOE),
    ("left_shoulder", "left_elbow", 0.043, SHIRT),
    ("left_elbow", "left_wrist", 0.036, SKIN),
    ("right_shoulder", "right_elbow", 0.043, SHIRT),
    ("right_elbow", "right_wrist", 0.036, SKIN),
)
"""From joint, to joint, radius [m] for a person with leg length `LEG`, colour. The radii are chosen by appearance."""

LEG = 0.84
"""Thigh plus shank [m] of the person with these radii: 0.491 of 1.71 m (Drillis and Contini 1966)."""

HEAD_RADIUS, HEAD_ABOVE = 0.10, 0.09
"""Radius of the head and height of its centre above the head's joint, along the head's z [m]."""

_FOOT = {"left_ankle": 0, "right_ankle": 1}


def human_figure(clip: HumanClip) -> Figure:
    """The figure of a human clip. A bone with a missing joint is not drawn. Raises ClipError for a missing leg."""
    scale, facing_w = _leg(clip) / LEG, facing_of(clip)
    parts, pos, quat = [], [], []
    for start, stop, radius, color in BONES:
        from_w, to_w = clip.body_pos_w[:, body(start)], clip.body_pos_w[:, body(stop)]
        half = _median_length(to_w - from_w) / 2
        shape = Shape(kind="capsule", size=(radius * scale, half), color=color, name=f"{start}-{stop}")
        parts.append(Part(name=shape.name, shapes=(shape,), foot=_FOOT.get(start)))
        pos.append((from_w + to_w) / 2)
        quat.append(_along(to_w - from_w))
    head = Shape(kind="sphere", size=(HEAD_RADIUS * scale,), color=SKIN, name="head", pos=(0, 0, HEAD_ABOVE * scale))
    parts.append(Part(name="head", shapes=(head,)))
    pos.append(clip.pos("head"))
    quat.append(clip.quat("head"))
    return Figure(
        name="human",
        fps=clip.fps,
        parts=tuple(parts),
        pos_w=np.stack(pos, axis=1),
        quat_w=np.stack(quat, axis=1),
        root_pos_w=clip.pos("pelvis"),
        heading=np.arctan2(facing_w[:, 1], facing_w[:, 0]),
        contacts=clip.contacts,
    )


def mirrored(clip: HumanClip) -> HumanClip:
    """The clip mirrored in the plane y = 0, for the `~mirror` variant of a robot clip."""
    index = [body(mirrored_name(name, [("left", "right")])) for name in BODIES]
    return HumanClip(
        name=clip.name,
        fps=clip.fps,
        body_pos_w=clip.body_pos_w[:, index] * np.array([1.0, -1.0, 1.0]),
        body_quat_w=clip.body_quat_w[:, index] * np.array([1.0, -1.0, 1.0, -1.0]),
        contacts=None if clip.contacts is None else clip.contacts[:, ::-1].copy(),
    )


def _leg(clip: HumanClip) -> float:
    """Thigh plus shank [m], mean of both sides; thigh and shank may be recorded in different frames."""
    total = 0.0
    for side, (start, stop) in itertools.product(("left", "right"), (("hip", "knee"), ("knee", "ankle"))):
        bone = _median_length(clip.pos(f"{side}_{stop}") - clip.pos(f"{side}_{start}"))
        if bone == 0.0:
            raise ClipError(clip.name, "missing", f"there is no frame with {side} {start} and {stop}.")
        total += bone / 2
    return total


def _median_length(vectors: Float[np.ndarray, "t 3"]) -> float:
    """Median length [m] over the known frames; 0 without any."""
    length = np.linalg.norm(vectors, axis=1)
    length = length[np.isfinite(length)]
    return float(np.median(length)) if len(length) else 0.0


def _along(direction: Float[np.ndarray, "t 3"]) -> Float[np.ndarray, "t 4"]:
    """The shortest rotation of z onto each direction, wxyz: (1 + a.b, a x b), normalised; NaN stays NaN."""
    unit = rotation.normalize(direction)
    quat = np.stack([1.0 + unit[:, 2], -unit[:, 1], unit[:, 0], np.zeros(len(unit))], axis=1)
    down = unit[:, 2] < -1.0 + 1e-9
    return np.where(down[:, None], np.array([0.0, 1.0, 0.0, 0.0]), rotation.normalize(quat))
