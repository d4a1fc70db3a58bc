"""Evaluate all criteria of KP5 on one motion."""

import functools
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool

from pipeline.feasibility.command_space import command_seconds_text
from pipeline.feasibility.criterion import MOTION, Result, Skipped, Verdict, results
from pipeline.feasibility.gait_signature import gait_signature_text
from pipeline.feasibility.motion import Motion
from pipeline.feasibility.settings import FeasibilitySettings


@dataclass(frozen=True, kw_only=True)
class Assessment:
    """Verdicts of all criteria on a motion, passed and failed."""

    motion: Motion
    verdicts: tuple[Verdict, ...]
    skipped: tuple[Skipped, ...]
    """Criteria that do not apply to the motion."""

    @property
    def holds(self) -> bool:
        return all(verdict.holds for verdict in self.verdicts)

    @property
    def broken(self) -> tuple[Verdict, ...]:
        return tuple(verdict for verdict in self.verdicts if not verdict.holds)

    @property
    def bad(self) -> Bool[np.ndarray, " t"]:
        """Frames that are marked as bad by failed criteria."""
        bad = np.zeros(self.motion.clip.frame_count, dtype=bool)
        for verdict in self.broken:
            if verdict.bad is not None:
                bad |= verdict.bad
        return bad

    @functools.cached_property
    def numbers(self) -> dict[str, float | bool | str]:
        """One number per criterion, the mean velocity in the form of a command, `command_seconds` (seconds in each box
        of the command space) and `gait_signature`."""
        found = {verdict.code: verdict.value for verdict in self.verdicts}
        motion = self.motion
        spent = command_seconds_text(motion.commands, motion.clip.fps)
        signature = gait_signature_text(motion.clip, motion.robot)
        texts = {"command_seconds": spent, "gait_signature": signature}
        return {**found, **vars(motion.velocity), **texts}


def assess(motion: Motion, settings: FeasibilitySettings) -> Assessment:
    """Verdicts of all criteria of a motion, in a fixed order."""
    verdicts, skipped = parted(tuple(results(motion, settings, MOTION)))
    return Assessment(motion=motion, verdicts=verdicts, skipped=skipped)


def parted(found: Sequence[Result]) -> tuple[tuple[Verdict, ...], tuple[Skipped, ...]]:
    """Split results into verdicts and skipped criteria."""
    verdicts = tuple(each for each in found if isinstance(each, Verdict))
    return verdicts, tuple(each for each in found if isinstance(each, Skipped))
