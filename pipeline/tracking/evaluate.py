"""Nominal rollouts of many clips in parallel processes."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from pathlib import Path

from pipeline.batch.pool import ClipPool
from pipeline.clips.robot_clip import RobotClip
from pipeline.robot import Robot
from pipeline.simulation.torque_envelope import TorqueEnvelope
from pipeline.tracking.nominal_rollout import NominalRollout, nominal_rollout
from pipeline.tracking.settings import TrackingSettings


def nominal_rollouts(
    clips: Sequence[RobotClip],
    robot: Robot,
    envelope: TorqueEnvelope,
    tracker: Path,
    settings: TrackingSettings,
    pool: ClipPool,
) -> list[NominalRollout]:
    """The nominal rollout of each clip, in the clips' order."""
    work = partial(nominal_rollout, settings=settings, robot=robot, envelope=envelope, tracker=tracker)
    return list(pool.map(work, [(clip,) for clip in clips]))
