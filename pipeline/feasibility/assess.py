"""All criteria of KP5 on one motion."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool

from pipeline.feasibility import (
    collision_criteria,
    foot_criteria,
    joint_criteria,
    root_criteria,
    torque_criteria,
    tracking_criteria,
)
from pipeline.feasibility.command_seconds import command_seconds_text
from pipeline.feasibility.gait_signature import gait_signature_text
from pipeline.feasibility.motion import Motion
from pipeline.feasibility.settings import FeasibilitySettings
from pipeline.feasibility.verdict import Verdict


@dataclass(frozen=True, kw_only=True)
class Assessment:
    """Every verdict on a motion, whether it holds or not."""

    motion: Motion
    verdicts: tuple[Verdict, ...]

    @property
    def holds(self) -> bool:
        return all(verdict.holds for verdict in self.verdicts)

    @property
    def broken(self) -> tuple[Verdict, ...]:
        return tuple(verdict for verdict in self.verdicts if not verdict.holds)

    @property
    def bad(self) -> Bool[np.ndarray, " t"]:
        """Frames that broken criteria blame."""
        bad = np.zeros(self.motion.clip.frame_count, dtype=bool)
        for verdict in self.broken:
            if verdict.bad is not None:
                bad |= verdict.bad
        return bad

    def numbers(self) -> dict[str, float | bool | str]:
        """One number a criterion, the robot's velocity as a command has it (its mean, and as `command_seconds` the
        seconds in each cell of the command space) and its `gait_signature`."""
        found = {verdict.code: verdict.value for verdict in self.verdicts}
        motion = self.motion
        spent = command_seconds_text(motion.commands, motion.clip.fps)
        signature = gait_signature_text(motion.clip, motion.robot)
        texts = {"command_seconds": spent, "gait_signature": signature}
        return {**found, **vars(motion.velocity), **texts}


def assess(motion: Motion, settings: FeasibilitySettings) -> Assessment:
    """Verdicts of all criteria, in a fixed order."""
    joints, feet, root = settings.joints, settings.feet, settings.root
    verdicts = (
        joint_criteria.joint_limits(motion, joints),
        *joint_criteria.joint_speeds(motion, joints),
        joint_criteria.joint_acceleration(motion, joints, root.cutoff_hz),
        *torque_criteria.recorded_forces(motion, settings.torque),
        *foot_criteria.foot_slip(motion, feet),
        *foot_criteria.gliding(motion, feet),
        *foot_criteria.penetration(motion, feet),
        foot_criteria.floating(motion, feet),
        foot_criteria.flight(motion, feet),
        *foot_criteria.label_disagreement(motion, feet),
        *collision_criteria.collisions(motion, settings.collision),
        *root_criteria.root_height(motion, root),
        root_criteria.root_tilt(motion, root),
        *root_criteria.root_speeds(motion, root),
        root_criteria.root_jerk(motion, root),
        *tracking_criteria.tracking(motion, settings.tracking),
    )
    return Assessment(motion=motion, verdicts=verdicts)
