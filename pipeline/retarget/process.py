"""The stage: a human clip in, the robot's clip and its numbers out."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from pipeline import time_series
from pipeline.clips.human_clip import BODIES, HumanClip
from pipeline.clips.outcome import Outcome, Piece
from pipeline.clips.robot_clip import RobotClip
from pipeline.errors import ClipError
from pipeline.retarget.clearance import cleared
from pipeline.retarget.report import numbers_of
from pipeline.retarget.settings import RetargetSettings
from pipeline.retarget.solver import Trajectory, solver_for
from pipeline.retarget.stance import contacts_of
from pipeline.retarget.targets import Targets, plan_targets
from pipeline.robot import Kinematics, Robot


def process(clip: HumanClip, numbers: Mapping[str, Any], *, settings: RetargetSettings, robot: Robot) -> Outcome:
    """The robot's motion for a repaired human clip, one piece under the clip's name.

    Raises ClipError for a clip with missing samples, without a person's legs, or that the solver fails on.
    """
    _refuse_missing(clip)
    human = clip.resampled(settings.fps)
    targets, trajectory = retarget(human, settings, robot)
    result = RobotClip(
        name=clip.name,
        fps=settings.fps,
        robot=robot.name,
        joint_names=robot.joint_names,
        root_pos_w=trajectory.root_pos_w,
        root_quat_w=trajectory.root_quat_w,
        joint_pos=trajectory.joint_pos,
        contacts=targets.contacts,
    )
    measured = numbers_of(result, human, targets.leg_ratio, robot)
    return Outcome(pieces=(Piece(clip=result, numbers=measured),), numbers={"seconds": clip.duration_s})


def retarget(human: HumanClip, settings: RetargetSettings, robot: Robot) -> tuple[Targets, Trajectory]:
    """Targets and the trajectory that follows them, for a clip without missing samples at the robot's rate.

    Two passes: the first follows the targets alone; the second is drawn to the first one's joint motion after a
    zero-phase low pass, which takes the jitter out of what the targets leave free.
    """
    solver = solver_for(robot)
    targets = plan_targets(human, contacts_of(human, settings.stance), solver.body, settings)
    rest = np.tile(robot.default_joint_pos, (human.frame_count, 1))
    first = solver.solve(human.name, targets, rest, settings.weights.posture_first, settings)
    smooth = time_series.smooth(first.joint_pos, settings.fps, settings.posture_smooth_hz)
    poses = Kinematics(robot).forward(first.root_pos_w, first.root_quat_w, first.joint_pos)
    targets = cleared(targets, poses, robot, solver.body.sole, settings.clearance, settings.fps)
    return targets, solver.solve(human.name, targets, smooth, settings.weights.posture_second, settings)


def _refuse_missing(clip: HumanClip) -> None:
    present = np.isfinite(clip.body_pos_w).all(axis=-1) & np.isfinite(clip.body_quat_w).all(axis=-1)
    if not present.all():
        frame, body = np.argwhere(~present)[0]
        raise ClipError(clip.name, "missing_samples", f"'{BODIES[body]}' has no position or orientation.", int(frame))
