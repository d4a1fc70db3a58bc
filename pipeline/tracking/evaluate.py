"""How well a tracker follows references: nominal rollouts of many clips in parallel processes."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np

from pipeline.batch.pool import ClipPool
from pipeline.clips.robot_clip import RobotClip
from pipeline.robot import Robot
from pipeline.simulation.torque_envelope import TorqueEnvelope
from pipeline.tracking.process import process
from pipeline.tracking.settings import TrackingSettings


@dataclass(frozen=True, kw_only=True)
class NominalRollout:
    """One clip's nominal rollout."""

    clip: str
    survived: bool
    """From the first frame to the last."""
    body_error_m: float
    joint_error_rad: float
    path_error_m: float
    seconds: float


def nominal_rollouts(
    clips: Sequence[RobotClip],
    robot: Robot,
    envelope: TorqueEnvelope,
    tracker: Path,
    settings: TrackingSettings,
    pool: ClipPool,
) -> list[NominalRollout]:
    """The nominal rollout of each clip, in the clips' order."""
    work = partial(_nominal, settings=settings, robot=robot, envelope=envelope, tracker=tracker)
    return list(pool.map(work, [(clip,) for clip in clips]))


def figures(rollouts: Sequence[NominalRollout]) -> dict[str, float]:
    """Share that survives, and errors: mean over clips, mean over all frames, and the worst clip's."""
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


def _nominal(
    clip: RobotClip, *, settings: TrackingSettings, robot: Robot, envelope: TorqueEnvelope, tracker: Path
) -> NominalRollout:
    needed = {"settings": settings.nominal(), "robot": robot, "envelope": envelope, "tracker": tracker}
    numbers = process(clip, {"variant": ""}, **needed).numbers
    errors = {name: float(numbers[name] or 0.0) for name in ("body_error_m", "joint_error_rad", "path_error_m")}
    return NominalRollout(clip=clip.name, survived=bool(numbers["survived"]), seconds=clip.duration_s, **errors)
