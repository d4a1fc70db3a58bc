"""Small human clips whose truth is known: a standing person and an analytic walker.

The walker's feet stand still by construction: it rolls from the heel over the flat foot to the ball, the
legs follow by two-bone inverse kinematics, pelvis, trunk and arms swing with the gait.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float
from scipy.interpolate import PchipInterpolator

from pipeline import rotation
from pipeline.clips.human_clip import BODIES, PARENTS, HumanClip, body

PELVIS_HEIGHT = 0.93
THIGH, SHANK = 0.45, 0.44
HIP_HALF = 0.09
ANKLE_HEIGHT, BALL_HEIGHT = 0.08, 0.02
"""Ankle and ball of the foot over the sole [m]."""
FOOT = np.array([0.14, 0.0, BALL_HEIGHT - ANKLE_HEIGHT])
"""Ball of the foot in the ankle's frame [m]."""
HEEL = np.array([-0.05, 0.0, -ANKLE_HEIGHT])
"""Heel in the ankle's frame [m]."""

OFFSETS: dict[str, tuple[float, float, float]] = {
    "spine": (0.0, 0.0, 0.10),
    "chest": (0.0, 0.0, 0.20),
    "neck": (0.0, 0.0, 0.25),
    "head": (0.02, 0.0, 0.10),
    "left_shoulder": (0.0, 0.17, 0.19),
    "right_shoulder": (0.0, -0.17, 0.19),
    "left_elbow": (0.0, 0.0, -0.29),
    "right_elbow": (0.0, 0.0, -0.29),
    "left_wrist": (0.0, 0.0, -0.25),
    "right_wrist": (0.0, 0.0, -0.25),
}


@dataclass(frozen=True, kw_only=True)
class Gait:
    """What the walker does."""

    speed_m_s: float = 1.2
    stride_s: float = 1.1
    """Time of one stride: two steps."""
    stance_share: float = 0.62
    bounce: float = 0.02
    """Amplitude of the pelvis' height [m]; twice a stride."""
    slide_m_s: float = 0.0
    """Speed at which standing feet slide forward [m/s]; 0 is sound."""


def walker(
    name: str = "walker",
    *,
    seconds: float = 8.0,
    fps: float = 60.0,
    gait: Gait | None = None,
    noise: float = 0.0,
    seed: int = 0,
) -> HumanClip:
    """A person walking along +x on z = 0, with true contacts. `noise` [m] shakes every joint."""
    gait = gait or Gait()
    time_s = np.arange(round(seconds * fps)) / fps
    phase = time_s / gait.stride_s
    pos, quat = np.zeros((len(time_s), len(BODIES), 3)), np.zeros((len(time_s), len(BODIES), 4))
    quat[..., 0] = 1.0
    contacts = np.zeros((len(time_s), 2), dtype=bool)
    sway = 0.02 * np.sin(2 * np.pi * phase)
    height = PELVIS_HEIGHT - 0.035 + gait.bounce * np.cos(4 * np.pi * phase)
    pos[:, 0] = np.stack([gait.speed_m_s * time_s, sway, height], axis=-1)
    quat[:, 0] = rotation.from_axis_angle(np.array([0.0, 0.0, 1.0]), 0.08 * np.sin(2 * np.pi * phase))
    for side, sign in (("left", 1.0), ("right", -1.0)):
        contacts[:, 0 if sign > 0 else 1] = _leg(pos, quat, side, sign, phase + (0.0 if sign > 0 else 0.5), gait)
    _upper_body(pos, quat, phase)
    if noise > 0.0:
        pos += np.random.default_rng(seed).normal(0.0, noise, pos.shape)
    return HumanClip(name=name, fps=fps, body_pos_w=pos, body_quat_w=quat, contacts=contacts)


def standing(name: str = "stand", *, seconds: float = 4.0, fps: float = 60.0) -> HumanClip:
    """A person who stands, breathes and sways a little (2 mm)."""
    time_s = np.arange(round(seconds * fps)) / fps
    still = walker(name, seconds=seconds, fps=fps, gait=Gait(speed_m_s=0.0, stance_share=0.999, bounce=0.0))
    pos = np.repeat(still.body_pos_w[:1], len(time_s), axis=0)
    quat = np.repeat(still.body_quat_w[:1], len(time_s), axis=0)
    upper = [index for index, each in enumerate(BODIES) if not each.endswith(("ankle", "toe"))]
    pos[:, upper, 0] += 0.002 * np.sin(2 * np.pi * 0.3 * time_s)[:, None]
    pos[:, upper, 1] += 0.002 * np.sin(2 * np.pi * 0.4 * time_s)[:, None]
    return HumanClip(
        name=name, fps=fps, body_pos_w=pos, body_quat_w=quat, contacts=np.ones((len(time_s), 2), dtype=bool)
    )


def turned(clip: HumanClip, yaw: float, shift: tuple[float, float, float], name: str | None = None) -> HumanClip:
    """The clip turned by `yaw` [rad] about the world's z, then moved by `shift` [m]."""
    turn = rotation.about_z(yaw)
    return HumanClip(
        name=name or clip.name,
        fps=clip.fps,
        body_pos_w=rotation.rotate(turn, clip.body_pos_w) + np.array(shift),
        body_quat_w=rotation.multiply(turn, clip.body_quat_w),
        contacts=clip.contacts,
    )


def _leg(pos: np.ndarray, quat: np.ndarray, side: str, sign: float, phase: np.ndarray, gait: Gait) -> np.ndarray:
    """Fill one leg; the true contact of each frame (t,)."""
    stride = np.floor(phase)
    share = phase - stride
    stance = share < gait.stance_share
    pitch = _pitch(share, gait.stance_share)
    foot_quat = rotation.from_axis_angle(np.array([0.0, 1.0, 0.0]), pitch)
    ankle_w = _ankle(stride, share, pitch, foot_quat, sign, gait)
    hip_w = pos[:, 0] + rotation.rotate(quat[:, 0], np.array([0.0, sign * HIP_HALF, -0.06]))
    ahead = rotation.rotate(quat[:, 0], np.array([1.0, 0.0, 0.0]))
    knee_w, ankle_w = _knee(hip_w, ankle_w, ahead)
    pos[:, body(f"{side}_hip")], pos[:, body(f"{side}_knee")], pos[:, body(f"{side}_ankle")] = hip_w, knee_w, ankle_w
    pos[:, body(f"{side}_toe")] = ankle_w + rotation.rotate(foot_quat, FOOT)
    quat[:, body(f"{side}_hip")] = _limb_frame(hip_w - knee_w, ahead)
    quat[:, body(f"{side}_knee")] = _limb_frame(knee_w - ankle_w, ahead)
    quat[:, body(f"{side}_ankle")] = foot_quat
    quat[:, body(f"{side}_toe")] = rotation.from_axis_angle(np.array([0.0, 1.0, 0.0]), np.minimum(pitch, 0.0))
    return stance


def _pitch(share: np.ndarray, stance: float) -> np.ndarray:
    """Foot pitch [rad], toes down positive: heel strike, flat, heel rise, swing."""
    swing = 1.0 - stance
    knots = [*(np.array([0.0, 0.12, 0.55, 0.8, 1.0]) * stance), stance + 0.5 * swing, 1.0]
    levels = [-0.3, 0.0, 0.0, 0.15, 0.7, 0.1, -0.3]
    return PchipInterpolator(knots, levels)(share)


def _ankle(
    stride: np.ndarray, share: np.ndarray, pitch: np.ndarray, foot_quat: np.ndarray, sign: float, gait: Gait
) -> np.ndarray:
    length = gait.speed_m_s * gait.stride_s
    phase_offset = 0.0 if sign > 0 else 0.5
    foothold = (stride - phase_offset + gait.stance_share / 2) * length - 0.05
    flat = np.stack([foothold, np.full_like(foothold, sign * HIP_HALF), np.full_like(foothold, ANKLE_HEIGHT)], axis=-1)
    in_stance = _rolled(flat, foot_quat, pitch)
    flat[:, 0] += gait.slide_m_s * share * gait.stride_s
    in_stance[:, 0] += gait.slide_m_s * share * gait.stride_s
    swing = np.clip((share - gait.stance_share) / (1 - gait.stance_share), 0.0, 1.0)
    blend = swing**3 * (10 - 15 * swing + 6 * swing**2)
    following = flat + np.array([length, 0.0, 0.0])
    last = _rolled(flat, *_posed(0.7, len(flat)))
    first = _rolled(following, *_posed(-0.3, len(flat)))
    in_swing = last + (first - last) * blend[:, None]
    in_swing[:, 2] += 0.06 * np.sin(np.pi * swing) ** 2
    return np.where((share < gait.stance_share)[:, None], in_stance, in_swing)


def _posed(pitch: float, count: int) -> tuple[np.ndarray, np.ndarray]:
    angles = np.full(count, pitch)
    return rotation.from_axis_angle(np.array([0.0, 1.0, 0.0]), angles), angles


def _rolled(flat: np.ndarray, foot_quat: np.ndarray, pitch: np.ndarray) -> np.ndarray:
    """Ankle when the foot that stood flat turns about its heel (toes up) or its ball (heel up)."""
    ball = np.array([FOOT[0], 0.0, -ANKLE_HEIGHT])
    pivot = np.where(pitch[:, None] < 0.0, HEEL, ball)
    return flat + pivot - rotation.rotate(foot_quat, pivot)


def _knee(hip_w: np.ndarray, ankle_w: np.ndarray, ahead: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Two-bone inverse kinematics, knee to the front; the ankle is drawn in where the leg is too short."""
    reach = ankle_w - hip_w
    length = np.linalg.norm(reach, axis=-1, keepdims=True)
    allowed = np.minimum(length, 0.999 * (THIGH + SHANK))
    down = reach / length
    along = (THIGH**2 - SHANK**2 + allowed**2) / (2 * allowed)
    out = np.sqrt(THIGH**2 - along**2)
    front = rotation.normalize(ahead - down * np.sum(ahead * down, axis=-1, keepdims=True))
    return hip_w + down * along + front * out, hip_w + down * allowed


def _limb_frame(up: np.ndarray, ahead: np.ndarray) -> np.ndarray:
    z = rotation.normalize(up)
    x = rotation.normalize(ahead - z * np.sum(ahead * z, axis=-1, keepdims=True))
    return rotation.from_matrix(np.stack([x, np.cross(z, x), z], axis=-1))


def _upper_body(pos: np.ndarray, quat: np.ndarray, phase: Float[np.ndarray, " t"]) -> None:
    swing = 0.4 * np.sin(2 * np.pi * phase)
    turns = {
        "left_shoulder": swing,
        "right_shoulder": -swing,
        "left_elbow": 0.2 * swing - 0.4,
        "right_elbow": -0.2 * swing - 0.4,
    }
    for name in OFFSETS:
        parent = body(PARENTS[name])
        pos[:, body(name)] = pos[:, parent] + rotation.rotate(quat[:, parent], np.array(OFFSETS[name]))
        turn = rotation.from_axis_angle(np.array([0.0, 1.0, 0.0]), turns.get(name, np.zeros(len(phase))))
        if name == "chest":
            turn = rotation.about_z(-0.1 * np.sin(2 * np.pi * phase))
        quat[:, body(name)] = rotation.multiply(quat[:, parent], turn)
