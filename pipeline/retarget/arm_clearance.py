"""Arms kept out of the thigh of their side and of the trunk: both are capsules, the forearm a row of points."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float
from scipy.ndimage import gaussian_filter1d

from pipeline import rotation
from pipeline.clips.human_clip import FEET
from pipeline.retarget.foot_spacing import faded
from pipeline.retarget.settings import ClearanceSettings
from pipeline.robot import Kinematics, LinkPoses, Robot

ARM_POINTS = (0.0, 0.35, 0.7, 1.0)
"""Points along the forearm, as shares of the way from elbow to hand."""

SHORTEST_LEVER = 0.1
"""[m] Points closer to the shoulder than this are turned as if they were this far."""


def turn_of(
    side: int, kinematics: Kinematics, poses: LinkPoses, robot: Robot, settings: ClearanceSettings, spread: float
) -> Float[np.ndarray, "t 3"]:
    """Rotation vectors [rad], world frame, about the shoulder that take the arm out of the body, smooth over time.

    Args:
        spread: frames over which a turn comes and goes
    """
    name, human = FEET[side], robot.human
    sites = [human[f"{name}_{part}"] for part in ("shoulder", "elbow", "hip", "knee")]
    sites += [robot.hands[side], human["left_shoulder"], human["right_shoulder"], human["left_hip"], human["right_hip"]]
    places_w = np.moveaxis(kinematics.site_pos_w(poses, sites), 1, 0)
    shoulder_w, elbow_w, hip_w, knee_w, hand_w = places_w[:5]
    top_w, bottom_w = places_w[5:7].mean(axis=0), places_w[7:9].mean(axis=0)
    trunk_quat_w = poses.quat_w[:, robot.link(human["trunk"])]
    outward_w = rotation.rotate(trunk_quat_w, np.array([0.0, 1.0 - 2.0 * side, 0.0]))
    turn = np.zeros_like(hip_w)
    for share in ARM_POINTS:
        point_w = elbow_w + share * (hand_w - elbow_w)
        away_w = point_w - _closest_on_segment(point_w, hip_w, knee_w)
        ways = [way_out(away_w, outward_w, settings.arm_distance)[:, None] * outward_w]
        if share > 0.5:
            away_w = point_w - _closest_on_segment(point_w, bottom_w, top_w)
            direction_w = rotation.normalize(away_w)
            ways.append(way_out(away_w, direction_w, settings.trunk_distance)[:, None] * direction_w)
        for way_w in ways:
            turn = _larger(turn, _turn_by(point_w - shoulder_w, way_w))
    size = faded(rotation.length(turn), spread)
    return size[:, None] * rotation.normalize(gaussian_filter1d(turn, 2.0 * spread, axis=0, mode="nearest"))


def way_out(
    away: Float[np.ndarray, "t 3"], direction: Float[np.ndarray, "t 3"], distance: float
) -> Float[np.ndarray, " t"]:
    """Way s >= 0 [m] with |away + s direction| = `distance` where |away| is less than that; `direction` is unit."""
    along = np.sum(away * direction, axis=-1)
    lacking = distance**2 - np.sum(away * away, axis=-1)
    return np.where(lacking > 0.0, np.sqrt(np.maximum(along**2 + lacking, 0.0)) - along, 0.0)


def _turn_by(arm: Float[np.ndarray, "t 3"], way: Float[np.ndarray, "t 3"]) -> Float[np.ndarray, "t 3"]:
    """Rotation vector [rad] that moves the end of `arm` [m] by `way` [m], to first order."""
    lever = np.maximum(rotation.length(arm)[:, None], SHORTEST_LEVER)
    return rotation.cross(arm, way) / lever**2


def _larger(a: Float[np.ndarray, "t 3"], b: Float[np.ndarray, "t 3"]) -> Float[np.ndarray, "t 3"]:
    first = rotation.length(a) >= rotation.length(b)
    return np.where(first[:, None], a, b)


def _closest_on_segment(
    point: Float[np.ndarray, "t 3"], start: Float[np.ndarray, "t 3"], stop: Float[np.ndarray, "t 3"]
) -> Float[np.ndarray, "t 3"]:
    line = stop - start
    share = np.clip(np.sum((point - start) * line, axis=-1) / np.sum(line * line, axis=-1), 0.0, 1.0)
    return start + share[:, None] * line
