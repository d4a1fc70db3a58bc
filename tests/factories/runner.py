"""A runner who falls with gravity between his steps, written at any rate."""

from __future__ import annotations

import numpy as np

from pipeline.clips.human_clip import BODIES, HumanClip, body
from pipeline.physics import GRAVITY
from tests.factories.human_clips import OFFSETS

STANCE_S, FLIGHT_S = 0.24, 0.12
STEP_S = STANCE_S + FLIGHT_S
"""A cadence of 167 steps a minute."""
HIP_HEIGHT = 0.88
SPEED_M_S = 2.8


def runner(fps: float, seconds: float = 4.0) -> HumanClip:
    """Runs along +x. Feet are fixed while they stand; trunk and head fall freely while neither does."""
    times = np.arange(round(seconds * fps)) / fps
    trunk = np.stack([SPEED_M_S * times, np.zeros_like(times), HIP_HEIGHT + _bounce(times)], axis=1)
    pos = np.zeros((len(times), len(BODIES), 3))
    pos[:, body("pelvis")] = trunk
    for name, offset in OFFSETS.items():
        parent = {"spine": "pelvis", "chest": "spine", "neck": "chest", "head": "neck"}.get(name)
        if parent is not None:
            pos[:, body(name)] = pos[:, body(parent)] + np.array(offset)
    for side, sign in (("left", 1.0), ("right", -1.0)):
        for joint in ("shoulder", "elbow", "wrist"):
            parent = {"shoulder": "chest", "elbow": f"{side}_shoulder", "wrist": f"{side}_elbow"}[joint]
            pos[:, body(f"{side}_{joint}")] = pos[:, body(parent)] + np.array(OFFSETS[f"{side}_{joint}"])
        pos[:, body(f"{side}_hip")] = trunk + np.array([0.0, 0.09 * sign, 0.0])
        ankle = _ankle(times, 0.0 if sign > 0.0 else 1.0)
        ankle[:, 1] = 0.09 * sign
        pos[:, body(f"{side}_ankle")] = ankle
        pos[:, body(f"{side}_toe")] = ankle + np.array([0.14, 0.0, -0.06])
        pos[:, body(f"{side}_knee")] = 0.5 * (pos[:, body(f"{side}_hip")] + ankle) + np.array([0.03, 0.0, 0.0])
    quat = np.zeros((len(times), len(BODIES), 4))
    quat[..., 0] = 1.0
    return HumanClip(name="test/run", fps=fps, body_pos_w=pos, body_quat_w=quat)


def _bounce(times: np.ndarray) -> np.ndarray:
    """Height over that of touchdown [m]: half a sine in a stance, a parabola in a flight, velocity continuous."""
    phase = times % STEP_S
    speed = GRAVITY * FLIGHT_S / 2.0
    stance = -speed * STANCE_S / np.pi * np.sin(np.pi * phase / STANCE_S)
    flown = phase - STANCE_S
    return np.where(phase < STANCE_S, stance, speed * flown - 0.5 * GRAVITY * flown**2)


def _ankle(times: np.ndarray, offset: float) -> np.ndarray:
    """Ankle of a foot that stands in every second step, from step `offset` on; slowest when it leaves and lands."""
    stride = 2.0 * STEP_S
    count = np.floor((times - offset * STEP_S) / stride)
    since = times - offset * STEP_S - count * stride
    planted = SPEED_M_S * (offset * STEP_S + count * stride + STANCE_S / 2.0)
    swing = np.clip((since - STANCE_S) / (stride - STANCE_S), 0.0, 1.0)
    place = np.zeros((len(times), 3))
    eased = swing - 0.5 * np.sin(2.0 * np.pi * swing) / (2.0 * np.pi)
    place[:, 0] = planted + SPEED_M_S * stride * eased
    place[:, 2] = 0.08 + 0.25 * np.sin(np.pi * swing)
    return place
