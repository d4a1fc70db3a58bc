"""A robot motion at another speed, and numbers of earlier stages as they are then and in a mirror."""

import dataclasses

import numpy as np

from pipeline import rotation, time_series
from pipeline.clips.outcome import Number, Numbers
from pipeline.clips.robot_clip import RobotClip

_POWERS = {"_m_s": 1, "_rad_s": 1, "_rad_s3": 3, "seconds": -1}
"""How a number goes with the playing speed, by the unit that its name ends in."""


def time_scale_clip(clip: RobotClip, scale: float, name: str) -> RobotClip:
    """The same path at `scale` times the speed and at the same rate.

    Frame k of the result is the motion at the clip's time scale * k / fps, by cubic splines: linear
    interpolation would put all acceleration at the old frames. The last frame is the last one inside.
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
    """Numbers of earlier stages, as they are at `scale` times the speed: speeds, seconds and jerk scale."""
    scaled = dict(numbers)
    for name, value in numbers.items():
        power = next((power for ending, power in _POWERS.items() if name.endswith(ending)), 0)
        if power and isinstance(value, (int, float)):
            scaled[name] = value * scale**power
    return scaled


_ODD_NUMBERS = ("lateral_m_s", "yaw_rate_rad_s", "heading_rad", "origin_y_m")
"""Numbers that change their sign in a mirror."""


def mirror_skill(skill: str) -> str:
    """The skill's name in a mirror: `turn_left` becomes `turn_right`, `walk` stays."""
    if skill.endswith("_left"):
        return skill.removesuffix("left") + "right"
    if skill.endswith("_right"):
        return skill.removesuffix("right") + "left"
    return skill


def mirror_numbers(numbers: Numbers) -> dict[str, Number]:
    """Numbers of earlier stages, as they are for the mirrored clip."""
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
