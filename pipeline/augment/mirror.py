"""Time scaling of a robot motion, and conversion of earlier stages' numbers for time scaling and mirroring."""

import dataclasses

import numpy as np

from pipeline import rotation, time_series
from pipeline.clips.outcome import Number, Numbers
from pipeline.clips.robot_clip import RobotClip

_POWERS = {"_m_s": 1, "_rad_s": 1, "_rad_s3": 3, "seconds": -1}
"""Exponent of the time scale in a number, by the unit suffix of its name."""


def time_scale_clip(clip: RobotClip, scale: float, name: str) -> RobotClip:
    """The same path at `scale` times the speed and at the same rate.

    Frame k of the result is the motion at time scale * k / fps of the clip, by cubic splines: linear interpolation
    would concentrate all acceleration at the old frames. The last frame is the last one within the clip.
    """
    last_s = (clip.frame_count - 1) / clip.fps
    count = int(np.floor(last_s * clip.fps / scale + 1e-6)) + 1
    times_s = np.minimum(np.arange(count) * scale / clip.fps, last_s)
    columns = [clip.root_pos_w, rotation.make_continuous(clip.root_quat_w), clip.joint_pos]
    moved = time_series.resample_cubic(np.concatenate(columns, axis=1), clip.fps, times_s)
    return dataclasses.replace(
        clip,
        name=name,
        root_pos_w=moved[:, :3].copy(),
        root_quat_w=rotation.normalize(moved[:, 3:7]),
        joint_pos=moved[:, 7:].copy(),
        contacts=None if clip.contacts is None else time_series.resample_nearest(clip.contacts, clip.fps, times_s),
    )


def time_scale_numbers(numbers: Numbers, scale: float) -> dict[str, Number]:
    """Convert numbers of earlier stages to `scale` times the speed: velocities, seconds and jerk."""
    scaled = dict(numbers)
    for name, value in numbers.items():
        power = next((power for ending, power in _POWERS.items() if name.endswith(ending)), 0)
        if power and isinstance(value, (int, float)):
            scaled[name] = value * scale**power
    return scaled


_ODD_NUMBERS = ("lateral_m_s", "yaw_rate_rad_s", "heading_rad", "origin_y_m")
"""Numbers that change their sign under mirroring."""


def mirror_skill(skill: str) -> str:
    """The skill of the mirrored motion: `turn_left` becomes `turn_right`, `walk` is unchanged."""
    if skill.endswith("_left"):
        return skill.removesuffix("left") + "right"
    if skill.endswith("_right"):
        return skill.removesuffix("right") + "left"
    return skill


def mirror_numbers(numbers: Numbers) -> dict[str, Number]:
    """Convert numbers of earlier stages to the mirrored clip."""
    mirrored = dict(numbers)
    for name in _ODD_NUMBERS:
        value = mirrored.get(name)
        if isinstance(value, (int, float)):
            mirrored[name] = -value if value else value
    sides = ("contact_share_left", "contact_share_right")
    mirrored |= {name: numbers[other] for name, other in zip(sides, sides[::-1], strict=True) if other in numbers}
    skill = mirrored.get("skill")
    if isinstance(skill, str):
        mirrored["skill"] = mirror_skill(skill)
    return mirrored
