"""How well a tracker follows references: nominal rollouts of many clips in parallel processes."""

from __future__ import annotations

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
    """Share that survives, and mean errors weighted by length."""
    seconds = np.array([each.seconds for each in rollouts])
    body = np.array([each.body_error_m for each in rollouts])
    joint = np.array([each.joint_error_rad for each in rollouts])
    return {
        "clips": float(len(rollouts)),
        "survived": float(np.mean([each.survived for each in rollouts])),
        "body_error_cm": round(float(100.0 * np.average(body, weights=seconds)), 3),
        "joint_error_deg": round(float(np.degrees(np.average(joint, weights=seconds))), 3),
        "worst_body_error_cm": round(float(100.0 * body.max()), 3),
    }


def _nominal(
    clip: RobotClip, *, settings: TrackingSettings, robot: Robot, envelope: TorqueEnvelope, tracker: Path
) -> NominalRollout:
    numbers = process(
        clip, {"variant": ""}, settings=settings.nominal(), robot=robot, envelope=envelope, tracker=tracker
    ).numbers
    return NominalRollout(
        clip=clip.name,
        survived=bool(numbers["survived"]),
        body_error_m=float(numbers["body_error_m"] or 0.0),
        joint_error_rad=float(numbers["joint_error_rad"] or 0.0),
        seconds=clip.duration_s,
    )
