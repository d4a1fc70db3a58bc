"""What left KP5, held against KP5's own file once more, from its stored bytes alone."""

from __future__ import annotations

from pipeline.clips.outcome import Numbers, Outcome
from pipeline.clips.robot_clip import RobotClip
from pipeline.feasibility.assess import assess
from pipeline.feasibility.likeness_criteria import likeness
from pipeline.feasibility.motion import at_database_rate, motion_of
from pipeline.feasibility.reference import References, no_references, reference_of
from pipeline.feasibility.settings import FeasibilitySettings
from pipeline.feasibility.tracking_criteria import followed
from pipeline.robot import Robot


def recheck(
    clip: RobotClip,
    numbers: Numbers,
    *,
    settings: FeasibilitySettings,
    robot: Robot,
    references: References = no_references,
) -> Outcome:
    """Nothing goes on; the reasons are the criteria that the clip breaks, none for what KP5 should have let pass."""
    reference = reference_of(at_database_rate(clip), numbers, robot, references)
    found = assess(motion_of(clip, robot, settings, reference), settings)
    of_clip = (*likeness(numbers, settings.likeness), *followed(numbers, settings.tracking))
    broken = [*found.broken, *(verdict for verdict in of_clip if not verdict.holds)]
    reasons = tuple(verdict.reason(clip.fps, 0.0, clip.duration_s) for verdict in broken)
    return Outcome(reasons=reasons, numbers={"holds": not broken})
