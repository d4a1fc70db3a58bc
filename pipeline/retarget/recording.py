"""What needs no retargeting: recordings of the robot itself. They pass; those of other robots do not."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from pipeline.clips.human_clip import HumanClip
from pipeline.clips.outcome import Clip, Outcome, Piece, Reason
from pipeline.retarget.process import process
from pipeline.retarget.report import velocity_of
from pipeline.retarget.settings import RetargetSettings
from pipeline.robot import Robot


def onto_robot(clip: Clip, numbers: Mapping[str, Any], *, settings: RetargetSettings, robot: Robot) -> Outcome:
    """A human clip retargeted; a recording of this robot at the database's rate; nothing for another robot's."""
    if isinstance(clip, HumanClip):
        return process(clip, numbers, settings=settings, robot=robot)
    if clip.robot != robot.name or clip.joint_names != robot.joint_names:
        text = f"'{clip.name}' is a recording of the robot '{clip.robot}', not of '{robot.name}'."
        return Outcome(reasons=(Reason(code="other_robot", text=text, effect="rejected"),))
    resampled = clip.resampled(settings.fps)
    measured = {"seconds": resampled.duration_s, "leg_ratio": 1.0, **velocity_of(resampled)}
    return Outcome(pieces=(Piece(clip=resampled, numbers=measured),))
