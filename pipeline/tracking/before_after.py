"""Compare a reference with its tracked rollout: quality figures of both, tracking errors, contacts.

A reference has no torques, so saturation is reported for the rollout only. Speed and drift are included because the
tracking errors are relative to the robot's position and heading, so they do not show a wrong speed.
"""

from dataclasses import dataclass

import numpy as np
import pandas as pd
from jaxtyping import Bool, Float

from pipeline import rotation, time_series
from pipeline.clips.outcome import Number
from pipeline.clips.robot_clip import RobotClip
from pipeline.quality.retargeting import joint_jerk
from pipeline.quality.sole import lowest_corner_slip, sole_motion
from pipeline.robot import Kinematics, Robot

ROUNDING = 1e-6
"""Relative tolerance for a torque at its limit throughout the control step."""

CHORD_S = 0.5
"""Duration of the chords along which the root's speed is measured, about a step, so that sway does not count [s]."""

MATCHED_S = 0.2
"""Largest time between matched touchdowns of rollout and reference [s]."""


@dataclass(frozen=True, kw_only=True)
class TrackingError:
    """Errors of each frame."""

    body: Float[np.ndarray, " t"]
    """Mean distance of the key links from the reference, which is moved to the robot's place and heading [m]."""
    joint: Float[np.ndarray, " t"]
    """Mean absolute error of the controlled joints [rad]."""
    path: Float[np.ndarray, " t"]
    """Horizontal distance of the root from the reference's root [m]."""


def tracking_error(clip: RobotClip, reference: RobotClip, robot: Robot) -> TrackingError:
    """Error of a rollout at each frame against the same frame of its reference.

    The distance is mjlab's root-relative mean per-keybody position error (`compute_root_relative_mpkpe`): the reference
    is moved horizontally to the robot's root and rotated to its heading; its height is kept.
    """
    links, kinematics = [robot.link(name) for name in robot.key_links], Kinematics(robot)
    here, there = (
        kinematics.forward(each.root_pos_w, each.root_quat_w, each.joint_pos).pos_w[:, links]
        for each in (clip, reference)
    )
    turn = rotation.about_z(rotation.yaw_of(clip.root_quat_w) - rotation.yaw_of(reference.root_quat_w))
    away = rotation.rotate(turn[:, None], there - reference.root_pos_w[:, None])
    anchor = np.concatenate([clip.root_pos_w[:, :2], reference.root_pos_w[:, 2:]], axis=1)
    moved = robot.controlled_index
    return TrackingError(
        body=np.linalg.norm(here - anchor[:, None] - away, axis=2).mean(axis=1),
        joint=np.abs(clip.joint_pos - reference.joint_pos)[:, moved].mean(axis=1),
        path=np.linalg.norm((clip.root_pos_w - reference.root_pos_w)[:, :2], axis=1),
    )


def before_after(reference: RobotClip, rollout: RobotClip, robot: Robot) -> dict[str, Number]:
    """Figures of a rollout and of the same frames of its reference; None where there is nothing to measure.

    `speed_*_m_s`: horizontal speed of the root along its path
    `drift_m`: horizontal distance of the root from the reference at the last frame; both begin at the same place
    `slip_*_m_s`: 95th percentile of the horizontal speed of the lowest sole corner of feet in contact
    `penetration_*_m`: largest depth of a sole corner below the ground
    `jerk_*_rad_s3`: mean over frames and controlled joints of the absolute third difference
    `saturated_after`: share of frames at the torque limit throughout, of the joint with the largest share
    `contact_changed`: share of foot-frames whose contact differs from the reference's label
    `touchdown_shift_s`: mean of how much later (or earlier, below 0) the rollout's feet touch down
    """
    found: dict[str, Number] = {}
    for when, clip in (("before", reference), ("after", rollout)):
        found[f"speed_{when}_m_s"] = path_speed(clip.root_pos_w, clip.fps)
        sole = sole_motion(clip, robot)
        slip = None if clip.contacts is None else lowest_corner_slip(sole, clip.contacts)[1]
        found[f"slip_{when}_m_s"] = slip
        found[f"penetration_{when}_m"] = max(0.0, -float(sole.height.min()))
        found[f"jerk_{when}_rad_s3"] = joint_jerk(clip, robot.controlled)
    found["drift_m"] = float(np.linalg.norm((rollout.root_pos_w[-1] - reference.root_pos_w[-1])[:2]))
    found["saturated_after"] = _saturated(rollout, robot)
    found["contact_changed"], found["touchdown_shift_s"] = None, None
    if reference.contacts is not None and rollout.contacts is not None:
        found["contact_changed"] = float(np.mean(reference.contacts != rollout.contacts))
        shifts = touchdown_shifts(reference.contacts, rollout.contacts, rollout.fps)
        found["touchdown_shift_s"] = float(np.mean(shifts)) if shifts else None
    return found


def path_speed(root_pos_w: Float[np.ndarray, "t 3"], fps: float) -> float:
    """Mean horizontal speed along chords of `CHORD_S` [m/s]; frames after the last whole chord are left out."""
    frames = min(round(CHORD_S * fps), len(root_pos_w) - 1)
    if frames < 1:
        return 0.0
    chords = np.diff(root_pos_w[::frames, :2], axis=0)
    return float(np.linalg.norm(chords, axis=1).mean() * fps / frames)


def by_skill(references: pd.DataFrame) -> pd.DataFrame:
    """Mean speeds and drift of each skill.

    Args:
        references: one row a reference with `skill`, `speed_before_m_s`, `speed_after_m_s` and `drift_m`
    """
    columns = ["speed_before_m_s", "speed_after_m_s", "drift_m"]
    means = references.groupby("skill")[columns].mean()
    means.insert(0, "references", references.groupby("skill").size())
    return means.reset_index()


def touchdown_shifts(reference: Bool[np.ndarray, "t 2"], rollout: Bool[np.ndarray, "t 2"], fps: float) -> list[float]:
    """Delay of the rollout's touchdown [s] for each touchdown of the reference with a matching one."""
    shifts: list[float] = []
    for side in range(2):
        wanted, found = (_touchdowns(contacts[:, side]) for contacts in (reference, rollout))
        for frame in wanted:
            away = (found - frame) / fps
            near = away[np.abs(away) <= MATCHED_S]
            if len(near):
                shifts.append(float(near[np.argmin(np.abs(near))]))
    return shifts


def _touchdowns(contact: Bool[np.ndarray, " t"]) -> np.ndarray:
    """First frame of each contact that begins within the clip."""
    return np.array([start for start, _ in time_series.runs(contact) if start > 0], dtype=int)


def _saturated(rollout: RobotClip, robot: Robot) -> float | None:
    if rollout.forces is None:
        return None
    at_limit = np.abs(rollout.forces.joint_torque) >= (1.0 - ROUNDING) * robot.torque_limit
    return float(at_limit.mean(axis=0).max())
