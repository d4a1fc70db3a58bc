"""Tracking quality by nominal rollouts, i.e. without disturbance. Uses only packages of a GPU host."""

import dataclasses
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pipeline.clips.robot_clip import RobotClip
from pipeline.robot import Robot
from pipeline.tracking.bundle import Motions
from pipeline.tracking.process import Setup, process
from pipeline.tracking.task import CONTROL_HZ


@dataclass(frozen=True, kw_only=True)
class NominalRollout:
    """Result of one clip's nominal rollout."""

    clip: str
    survived: bool
    """Whether the rollout follows the clip from the first to the last frame."""
    body_error_m: float
    joint_error_rad: float
    path_error_m: float
    seconds: float


def clips_of(motions: Motions, robot: Robot) -> list[RobotClip]:
    """The motions of a bundle as clips."""
    arrays = (motions.root_pos_w, motions.root_quat_w, motions.joint_pos)
    return [
        robot.clip(name, CONTROL_HZ, *(values[start:stop] for values in arrays))
        for name, start, stop in zip(motions.names, motions.clip_start[:-1], motions.clip_start[1:], strict=True)
    ]


def nominal_rollout(clip: RobotClip, *, setup: Setup) -> NominalRollout:
    """Roll out a reference without disturbance. Raises the errors of `pipeline.tracking.process.process`."""
    undisturbed = dataclasses.replace(setup, settings=setup.settings.nominal())
    numbers = process(clip, {"variant": ""}, setup=undisturbed).numbers
    errors = {name: float(numbers[name] or 0.0) for name in ("body_error_m", "joint_error_rad", "path_error_m")}
    return NominalRollout(clip=clip.name, survived=bool(numbers["survived"]), seconds=clip.duration_s, **errors)


def figures(rollouts: Sequence[NominalRollout]) -> dict[str, float]:
    """Survival rate, and errors: mean over clips, mean over all frames, and worst clip."""
    seconds = np.array([each.seconds for each in rollouts])
    body_cm = np.array([100.0 * each.body_error_m for each in rollouts])
    path_cm = np.array([100.0 * each.path_error_m for each in rollouts])
    joint_deg = np.degrees([each.joint_error_rad for each in rollouts])
    values = {
        "clips": float(len(rollouts)),
        "survived": np.mean([each.survived for each in rollouts]),
        "body_error_cm": body_cm.mean(),
        "body_error_cm_over_frames": np.average(body_cm, weights=seconds),
        "body_error_cm_worst_clip": body_cm.max(),
        "joint_error_deg": joint_deg.mean(),
        "joint_error_deg_over_frames": np.average(joint_deg, weights=seconds),
        "path_error_cm": path_cm.mean(),
        "path_error_cm_worst_clip": path_cm.max(),
    }
    return {name: round(float(value), 3) for name, value in values.items()}
