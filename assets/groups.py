"""The group of each asset in Dagster's graph: KP1 to KP5 by name; training and validation apart from the motions."""

from __future__ import annotations

from assets.plan import EXPORTS

HARDWARE = "hardware_feedback"

_SHARED = {
    "raw_motions": "sources",
    "motion_catalog": "sources",
    "selected_motions": "KP1_selection",
    "approved_windows": "KP1_selection",
    "repaired_motions": "KP2_repair",
}

_OF_ROBOT = {
    "robot": (
        *("robot_model", "actuator_measurements", "actuator_calibration", "adapted_robot"),
        "approved_limits",
    ),
    "KP3_retargeting": ("retargeted_motions",),
    "KP4_augmentation": ("motion_variants", "approved_variants", "tracking_policy", "augmented_motions"),
    "KP5_feasibility": ("reference_motions", "feasible_motions", "approved_weights"),
    "database": ("expert_db", *EXPORTS.values()),
    "training": ("amp_policy", "approved_randomization", "augmentation_ablation"),
    "validation": (
        *("exported_policy", "mujoco_validation", "cross_engine_validation", "webots_validation"),
        *("limit_cycles", "release_report"),
    ),
}

_BY_NAME = {name: group for group, names in _OF_ROBOT.items() for name in names}


def group_of(name: str, robot: str | None = None) -> str:
    """Group of an asset by the last part of its key.

    Args:
        robot: whose asset it is; None for one that all robots share
    """
    return _SHARED.get(name, HARDWARE) if robot is None else f"{robot}_{_BY_NAME[name]}"
