"""Score of one robot motion against the human motion that it reproduces."""

import numpy as np
from jaxtyping import Bool, Float

from pipeline import time_series
from pipeline.clips.human_clip import HumanClip
from pipeline.clips.robot_clip import RobotClip
from pipeline.quality import retargeting
from pipeline.quality.sole import inner_contacts
from pipeline.robot import Kinematics, LinkPoses, Robot
from pipeline.scoring.align import aligned, stance_labels
from pipeline.scoring.figures import Score
from pipeline.scoring.pelvis_path import pelvis_path
from pipeline.simulation.mujoco_plant import self_collision

COLLISION_DEPTH = 0.002
"""Least overlap that counts as self-collision [m]."""

DEEP = 0.01
"""Depth of a sole below the ground from which a frame counts as too deep [m]."""

Samples = dict[str, Float[np.ndarray, " n"]]


def score(human: HumanClip, clip: RobotClip, robot: Robot) -> Score:
    """The samples of every figure of `FIGURES`, at the robot clip's rate.

    Both must start at the same time in the same world frame (`aligned`). Raises ClipError if they can't be compared.
    """
    human, clip = aligned(human, clip, robot)
    samples = samples_without_collisions(human, clip, robot)
    depth = self_collision(clip, robot).depth
    samples["self_collision_percent"] = 100.0 * (depth > COLLISION_DEPTH)
    samples["self_collision_max_cm"] = 100.0 * depth
    return Score(frames=clip.frame_count, samples=samples)


def score_without_collisions(human: HumanClip, clip: RobotClip, robot: Robot) -> Score:
    """Score of two frame-aligned clips without self-collision, which takes longest; its figures are NaN."""
    samples = samples_without_collisions(human, clip, robot)
    nothing = {key: np.zeros(0) for key in ("self_collision_percent", "self_collision_max_cm")}
    return Score(frames=clip.frame_count, samples=samples | nothing)


def samples_without_collisions(human: HumanClip, clip: RobotClip, robot: Robot) -> Samples:
    """All samples except self-collision; both motions at one rate and equally long."""
    kinematics = Kinematics(robot)
    poses = kinematics.forward(clip.root_pos_w, clip.root_quat_w, clip.joint_pos)
    samples = _limits(clip, robot) | _feet(human, clip.fps, kinematics, poses, robot)
    samples |= pelvis_path(human, kinematics, poses, robot)
    return samples | _smoothness(clip, robot) | _likeness(human, poses, robot)


def _limits(clip: RobotClip, robot: Robot) -> Samples:
    """Exact position limits; speeds between consecutive frames, including the head."""
    outside = (clip.joint_pos < robot.joint_lower) | (clip.joint_pos > robot.joint_upper)
    speed = np.abs(np.diff(clip.joint_pos, axis=0)) * clip.fps
    return {
        "position_limit_percent": 100.0 * np.any(outside, axis=1),
        "speed_limit_percent": 100.0 * np.any(speed > robot.retarget_speed_limit, axis=1),
    }


def _feet(human: HumanClip, fps: float, kinematics: Kinematics, poses: LinkPoses, robot: Robot) -> Samples:
    """Slip and drift of the sole's centre; depth of the lowest corner after the clip's one height shift."""
    soles_w = kinematics.site_pos_w(poses, robot.feet)
    corners_w = kinematics.site_pos_w(poses, (*robot.sole_corners[0], *robot.sole_corners[1]))
    lowest = corners_w[..., 2].reshape(len(corners_w), 2, -1).min(axis=2)
    speed = np.linalg.norm(time_series.derivative(soles_w[..., :2], fps), axis=-1)
    labels = stance_labels(human)
    samples = {f"slip_{name}_m_s": speed[inner_contacts(label)] for name, label in labels.items()}
    shift = height_shift(lowest, labels["middle"])
    depth = np.maximum(shift - lowest.min(axis=1), 0.0)
    drifts = [retargeting.stance_drifts(soles_w[:, side], labels["middle"][:, side]) for side in range(2)]
    return samples | {
        "drift_cm": 100.0 * np.concatenate(drifts),
        "penetration_max_cm": 100.0 * depth,
        "penetration_over_1cm_percent": 100.0 * (depth > DEEP),
        "height_shift_mm": np.array([1000.0 * abs(shift)]),
    }


def height_shift(lowest: Float[np.ndarray, "t 2"], stance: Bool[np.ndarray, "t 2"]) -> float:
    """Ground height [m] of the motion: median height of the lowest corner of soles in stance.

    0 without any stance.
    """
    return float(np.median(lowest[stance])) if stance.any() else 0.0


def _smoothness(clip: RobotClip, robot: Robot) -> Samples:
    third = np.abs(np.diff(clip.joint_pos[:, robot.controlled_index], n=3, axis=0)).mean(axis=1) * clip.fps**3
    return {"jerk_rad_s3": third, "jump_percent": 100.0 * retargeting.jump_frames(clip)}


def _likeness(human: HumanClip, poses: LinkPoses, robot: Robot) -> Samples:
    limbs = np.rad2deg(retargeting.limb_direction_error(human, poses, robot))
    return {
        "limb_error_deg": limbs.mean(axis=1),
        "thigh_error_deg": limbs[:, 0:2].mean(axis=1),
        "shank_error_deg": limbs[:, 2:4].mean(axis=1),
        "trunk_error_deg": np.rad2deg(retargeting.trunk_orientation_error(human, poses, robot)),
        "heading_error_deg": np.rad2deg(retargeting.pelvis_heading_error(human, poses, robot)),
        "pelvis_tilt_error_deg": np.rad2deg(retargeting.pelvis_tilt_error(human, poses, robot)),
    }
