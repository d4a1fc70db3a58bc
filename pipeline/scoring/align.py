"""Align human and robot in time: equal start, the human resampled to the robot's rate.

The thresholds are those of the published comparison of retargeting onto T1, so that figures are comparable.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool

from pipeline import rotation, time_series
from pipeline.clips.human_clip import FEET, HumanClip
from pipeline.clips.robot_clip import RobotClip
from pipeline.errors import ClipError
from pipeline.robot import Kinematics, Robot

LOW_PERCENTILE = 5.0
"""Percentile of a toe's height that counts as the ground."""

VERTICAL_SPEED_M_S = 0.4
"""Vertical speed above which a toe is not in stance."""

MEDIAN_S = 5.0 / 30.0
"""Width of the median that labels are smoothed with [s]: five frames at 30 Hz."""


@dataclass(frozen=True, kw_only=True)
class Strictness:
    """Limits below which a toe is in stance."""

    height: float
    """Height over the toe's `LOW_PERCENTILE` [m]."""
    speed_m_s: float
    """Horizontal speed [m/s]."""


STRICTNESSES = {
    "strict": Strictness(height=0.015, speed_m_s=0.20),
    "middle": Strictness(height=0.025, speed_m_s=0.45),
    "loose": Strictness(height=0.04, speed_m_s=0.8),
}


def stance_labels(human: HumanClip) -> dict[str, Bool[np.ndarray, "t 2"]]:
    """Frames in stance of the left and right foot by `STRICTNESSES`: toe low and slow, then a median over time."""
    half = round((MEDIAN_S * human.fps - 1.0) / 2.0)
    columns: dict[str, list[np.ndarray]] = {name: [] for name in STRICTNESSES}
    for side in FEET:
        toe_w = human.pos(f"{side}_toe")
        velocity = time_series.derivative(toe_w, human.fps)
        low = np.percentile(toe_w[:, 2], LOW_PERCENTILE)
        speed, steady = np.linalg.norm(velocity[:, :2], axis=1), np.abs(velocity[:, 2]) < VERTICAL_SPEED_M_S
        for name, limits in STRICTNESSES.items():
            label = (toe_w[:, 2] < low + limits.height) & (speed < limits.speed_m_s) & steady
            columns[name].append(_median(label, half))
    return {name: np.stack(labels, axis=1) for name, labels in columns.items()}


def _median(label: Bool[np.ndarray, " t"], half: int) -> Bool[np.ndarray, " t"]:
    """Median of 2 `half` + 1 frames; near the ends of fewer, as many on both sides of the frame.

    A window that reaches further inward than outward would extend a stance over the landing or take-off at the end.
    """
    total = np.concatenate([[0], np.cumsum(label)])
    index = np.arange(len(label))
    reach = np.minimum(half, np.minimum(index, len(label) - 1 - index))
    return 2 * (total[index + reach + 1] - total[index - reach]) > 2 * reach + 1


TOLERANCE_S = 0.05
"""Largest difference of their durations in addition to one frame of each [s], for rounding at two rates."""

MAX_TURNED_DEG = 60.0
"""Mean heading difference above which both are in different worlds [deg]; the worst measured retargeting is 20 degrees
off."""


def same_length(human: HumanClip, clip: RobotClip) -> bool:
    """Whether the lengths are those of the same motion."""
    slack_s = TOLERANCE_S + 1.0 / human.fps + 1.0 / clip.fps
    return abs(human.duration_s - clip.duration_s) <= slack_s


def aligned(human: HumanClip, clip: RobotClip, robot: Robot) -> tuple[HumanClip, RobotClip]:
    """Both at the robot clip's rate and equally long.

    Raises ClipError for clips of different lengths, and for a robot that faces another way than the human: then it was
    made from the recorded motion, not from the repaired one (moved to the origin, facing +x).
    """
    if not same_length(human, clip):
        problem = f"it is {clip.duration_s:.2f} s long, the human '{human.name}' {human.duration_s:.2f} s."
        raise ClipError(clip.name, "length", problem)
    human = human.resampled(clip.fps)
    frames = min(human.frame_count, clip.frame_count)
    human, clip = human.cut(0, frames, human.name), clip.cut(0, frames, clip.name)
    turned_deg = _turned_deg(human, clip, robot)
    if turned_deg > MAX_TURNED_DEG:
        problem = (
            f"the robot faces {turned_deg:.0f} degrees away from the human on average, {MAX_TURNED_DEG:.0f} allowed; "
        )
        raise ClipError(clip.name, "placement", problem + "retarget the human's motion as repair hands it on.")
    return human, clip


def _turned_deg(human: HumanClip, clip: RobotClip, robot: Robot) -> float:
    """Angle between the headings of the robot's pelvis and the human's hips, circular mean, without its sign [deg]."""
    poses = Kinematics(robot).forward(clip.root_pos_w, clip.root_quat_w, clip.joint_pos)
    hip_line_w = human.pos("left_hip") - human.pos("right_hip")
    heading = np.arctan2(-hip_line_w[:, 0], hip_line_w[:, 1])
    turned = rotation.yaw_of(poses.quat_w[:, robot.link(robot.human["pelvis"])]) - heading
    return float(np.abs(np.rad2deg(np.arctan2(np.sin(turned).mean(), np.cos(turned).mean()))))
