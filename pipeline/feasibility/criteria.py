"""Every criterion of KP5: the group it belongs to, and which number of `data/feasibility.yaml` it is held against."""

from __future__ import annotations

from pipeline.feasibility.likeness_criteria import FIGURES

LENGTH = "too_short"
"""The criterion of a clip's own length."""

GROUPS: dict[str, dict[str, str]] = {
    "tracking stability": {
        "tracking_followed": "tracking.followed",
        "tracking_joint_p95": "tracking.joint_p95",
        "tracking_joint_worst": "tracking.joint_worst",
        "tracking_body_p95": "tracking.body_p95",
        "tracking_body_worst": "tracking.body_worst",
        "tracking_growth": "tracking.growth",
        "tracking_away_s": "tracking.away_s",
        "tracking_root_height": "tracking.root_height",
        "tracking_gravity": "tracking.gravity",
        "tracking_end_height": "tracking.end_height",
    },
    "root motion": {
        "root_height_min": "root.height",
        "root_height_max": "root.height",
        "root_tilt_deg": "root.tilt_deg",
        "root_speed": "root.speed",
        "root_turn_speed": "root.turn_speed",
        "root_acceleration": "root.acceleration",
    },
    "joint and speed limits": {
        "joint_limit_excess": "joints.limit_excess",
        "joint_speed_ratio": "joints.speed_ratio",
        "joint_speed_over_share": "joints.speed_over_share",
        "joint_speed_over_run_s": "joints.speed_over_run_s",
    },
    "torque": {
        "torque_saturation_share": "torque.saturation_share",
        "torque_saturation_run_s": "torque.saturation_run_s",
    },
    "contact consistency": {
        "floating_contact": "feet.floating",
        "flight_s": "feet.flight_s",
        "contact_disagreement": "feet.disagreement",
    },
    "foot slip": {
        "foot_slip_mean": "feet.slip_mean",
        "foot_told_slip_mean": "feet.told_slip_mean",
        "foot_slip_p95": "feet.slip_p95",
        "foot_glide_s": "feet.glide_s",
    },
    "penetration": {
        "penetration_p95": "feet.penetration_p95",
        "penetration_max": "feet.penetration_max",
    },
    "self-collision": {
        "self_collision_depth": "collision.depth",
        "self_collision_share": "collision.share",
    },
    "contact forces": {"force_residual": "torque.force_residual"},
    "smoothness": {
        "joint_acceleration_p99": "joints.acceleration_p99",
        "root_jerk": "root.jerk",
    },
    "likeness to the person": {name: f"likeness.{name}" for name in FIGURES},
    "length": {LENGTH: "cut.min_seconds"},
}
"""Group -> criterion -> name of its threshold."""

GROUP_OF = {code: group for group, codes in GROUPS.items() for code in codes}
"""Criterion -> its group, in a fixed order."""


def threshold_of(code: str) -> str:
    """Name of a criterion's threshold in `data/feasibility.yaml`."""
    return GROUPS[GROUP_OF[code]][code]
