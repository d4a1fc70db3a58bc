"""Error of the robot's pelvis path relative to the human's, scaled to the robot."""

import numpy as np
from jaxtyping import Float

from pipeline import rotation, time_series
from pipeline.clips.human_clip import FEET, HumanClip
from pipeline.robot import Kinematics, LinkPoses, Robot

SCALE_TOLERANCE = 0.1
"""Retargeters scale a path by the ratio of leg lengths within this share; the scale itself is not an error."""

CUTOFF_HZ = 10.0
"""Zero-phase low pass before accelerations are compared [Hz], as in KP5's criteria on the root."""

LEAST_PEAK = 5.0
"""Lower bound of the scaled human's peak acceleration in the ratio [m/s^2], since at rest it is noise."""


def pelvis_path(
    human: HumanClip, kinematics: Kinematics, poses: LinkPoses, robot: Robot
) -> dict[str, Float[np.ndarray, " n"]]:
    """Samples of the pelvis path; the pelvis is the midpoint of the hips in both bodies.

    `pelvis_velocity_error_m_s`: length of the difference of horizontal velocities, one per frame [m/s].
    `pelvis_acceleration_ratio`: peak acceleration of the robot over that of the scaled human, one per clip.
    Human and robot have the same rate and length.
    """
    fps, tree = human.fps, robot.human
    human_w = np.mean([human.pos(f"{side}_hip") for side in FEET], axis=0)
    robot_w = kinematics.site_pos_w(poses, [tree[f"{side}_hip"] for side in FEET]).mean(axis=1)
    velocity = time_series.derivative(human_w[:, :2], fps)
    robot_velocity = time_series.derivative(robot_w[:, :2], fps)
    scale = _scale(velocity, robot_velocity, _leg_ratio(human, kinematics, poses, robot))
    peak, scaled_peak = _peak_acceleration(robot_w, fps), scale * _peak_acceleration(human_w, fps)
    return {
        "pelvis_velocity_error_m_s": np.linalg.norm(robot_velocity - scale * velocity, axis=1),
        "pelvis_acceleration_ratio": np.array([peak / max(scaled_peak, LEAST_PEAK)]),
    }


def _leg_ratio(human: HumanClip, kinematics: Kinematics, poses: LinkPoses, robot: Robot) -> float:
    """Length of the robot's legs (hip to knee to ankle) over the human's, medians over the clip."""
    lengths = np.zeros(2)
    for side in FEET:
        names = [f"{side}_{joint}" for joint in ("hip", "knee", "ankle")]
        joints = (
            np.stack([human.pos(name) for name in names], axis=1),
            kinematics.site_pos_w(poses, [robot.human[name] for name in names]),
        )
        lengths += [np.median(rotation.length(np.diff(each, axis=1)).sum(axis=1)) for each in joints]
    return float(lengths[1] / lengths[0])


def _scale(velocity: Float[np.ndarray, "t 2"], robot_velocity: Float[np.ndarray, "t 2"], leg_ratio: float) -> float:
    """Scale of the human's velocity that fits the robot's best, within `SCALE_TOLERANCE` of the leg ratio."""
    power = float(np.sum(velocity * velocity))
    best = float(np.sum(velocity * robot_velocity)) / power if power > 0.0 else leg_ratio
    return float(np.clip(best, (1.0 - SCALE_TOLERANCE) * leg_ratio, (1.0 + SCALE_TOLERANCE) * leg_ratio))


def _peak_acceleration(pos_w: Float[np.ndarray, "t 3"], fps: float) -> float:
    """Largest acceleration of a point, low-passed at `CUTOFF_HZ` [m/s^2]; 0 below three frames."""
    if len(pos_w) < 3:
        return 0.0
    smooth = time_series.smooth(pos_w, fps, CUTOFF_HZ)
    return float(np.linalg.norm(np.diff(smooth, n=2, axis=0), axis=1).max()) * fps**2
