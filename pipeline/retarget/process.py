"""The stage: a human clip in, the robot's clip and its numbers out."""

import dataclasses
import math
from collections.abc import Mapping
from typing import Any

import numpy as np
from jaxtyping import Float

from pipeline import time_series
from pipeline.clips.human_clip import BODIES, HumanClip
from pipeline.clips.outcome import Clip, Outcome, Piece, Reason
from pipeline.clips.robot_clip import RobotClip
from pipeline.errors import ClipError
from pipeline.quality.planar_motion import command_velocity
from pipeline.retarget.clearance import cleared
from pipeline.retarget.foot_plan import contacts_of
from pipeline.retarget.pelvis_path import fading_grip, held_share, smoothed_path, smoothed_share
from pipeline.retarget.settings import RetargetSettings
from pipeline.retarget.solver import Trajectory, solver_for
from pipeline.retarget.targets import Targets, plan_targets
from pipeline.robot import Kinematics, Robot
from pipeline.robot.size import scaled
from pipeline.scoring import score_without_collisions, worst_of_bars


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
    measured = numbers_of(result, human, targets.leg_ratio, robot) | changes_of(targets)
    return Outcome(pieces=(Piece(clip=result, numbers=measured),), numbers={"seconds": clip.duration_s})


def retarget(human: HumanClip, settings: RetargetSettings, robot: Robot) -> tuple[Targets, Trajectory]:
    """Targets and the trajectory that follows them, for a clip without missing samples at the robot's rate.

    Two passes: the first follows the targets alone; the second is drawn to the first one's joint motion after a
    zero-phase low pass, which takes the jitter out of what the targets leave free. Where the first pass lets the pelvis
    go astray it is held, and the first pass is done again; where a pass jerks the pelvis its path is smoothed, and that
    pass is done again. Distances of the settings are scaled to the robot.
    """
    settings = scaled(settings, robot)
    weights, fps, solver = settings.weights, settings.fps, solver_for(robot)
    targets = plan_targets(human, contacts_of(human, settings.stance), solver.body, settings)
    planned_w = targets.pelvis_pos_w
    rest = np.tile(robot.default_joint_pos, (human.frame_count, 1))

    def with_smooth_path(targets: Targets, reached_w: np.ndarray) -> Targets | None:
        """The targets with the pelvis on a smooth path where a pass jerked it; None where it did not."""
        share = smoothed_share(planned_w, reached_w, settings.pelvis, fps)
        if not share.any():
            return None
        share = np.maximum(targets.pelvis_smoothed, share)
        path_w = smoothed_path(planned_w, reached_w, share, settings.pelvis, fps)
        return dataclasses.replace(targets, pelvis_pos_w=path_w, pelvis_smoothed=share)

    def again(reached: Trajectory, changed: np.ndarray) -> Trajectory:
        return solver.solve(human.name, targets, rest, weights.posture_first, settings, reached, changed)

    first = solver.solve(human.name, targets, rest, weights.posture_first, settings)
    reached_w = _pelvis_pos_w(first, robot)
    held = held_share(planned_w, reached_w, settings.pelvis, fps)
    if held.any():
        grip = fading_grip(targets.grip > 0.5, held, settings.pelvis, fps)
        targets = dataclasses.replace(targets, pelvis_held=held, grip=grip)
        first = again(first, held > 0.0)
        reached_w = _pelvis_pos_w(first, robot)
    smoother = with_smooth_path(targets, reached_w)
    if smoother is not None:
        targets = smoother
        first = again(first, targets.pelvis_smoothed > 0.0)
    posture = time_series.smooth(first.joint_pos, fps, settings.posture_smooth_hz)
    posture_weight = weights.posture_second_held if held.any() else weights.posture_second
    poses = Kinematics(robot).forward(first.root_pos_w, first.root_quat_w, first.joint_pos)
    targets = cleared(targets, poses, robot, solver.body.sole, settings.clearance, fps)
    second = solver.solve(human.name, targets, posture, posture_weight, settings, first)
    smoother = with_smooth_path(targets, _pelvis_pos_w(second, robot))
    if smoother is not None:
        targets, changed = smoother, smoother.pelvis_smoothed > 0.0
        second = solver.solve(human.name, targets, posture, posture_weight, settings, second, changed)
    return targets, second


def _pelvis_pos_w(trajectory: Trajectory, robot: Robot) -> Float[np.ndarray, "t 3"]:
    link = robot.link(robot.human["pelvis"])
    return Kinematics(robot).link_pos_w(trajectory.root_pos_w, trajectory.root_quat_w, trajectory.joint_pos, link)


def _refuse_missing(clip: HumanClip) -> None:
    present = np.isfinite(clip.body_pos_w).all(axis=-1) & np.isfinite(clip.body_quat_w).all(axis=-1)
    if not present.all():
        frame, body = np.argwhere(~present)[0]
        raise ClipError(clip.name, "missing_samples", f"'{BODIES[body]}' has no position or orientation.", int(frame))


def numbers_of(clip: RobotClip, human: HumanClip, leg_ratio: float, robot: Robot) -> dict[str, float | str | None]:
    """Numbers by name; `human` is the clip at the robot's rate.

    The velocities are the robot's: a human's times `leg_ratio`. Slip, drift and depth are by the scorer's own labels
    of standing feet, `slip_m_s` by the middle ones. Self-collision is KP5's to find. None where a clip has no sample
    (no foot ever stands). `worst_figure` is the one that is furthest over its bar, `times_its_bar` by how much.
    """
    figures = score_without_collisions(human, clip, robot).figures()
    worst, times = worst_of_bars(figures, clip.fps)
    numbers = {
        "slip_m_s": figures["slip_middle_m_s"],
        "slip_strict_m_s": figures["slip_strict_m_s"],
        "drift_m": figures["drift_cm"] / 100.0,
        "penetration_m": figures["penetration_max_cm"] / 100.0,
        "height_shift_m": figures["height_shift_mm"] / 1000.0,
        "jerk_rad_s3": figures["jerk_rad_s3"],
        "jump_percent": figures["jump_percent"],
        "pelvis_velocity_error_m_s": figures["pelvis_velocity_error_m_s"],
        "pelvis_acceleration_ratio": figures["pelvis_acceleration_ratio"],
        **{key: value for key, value in figures.items() if key.endswith("_error_deg")},
    }
    known = {name: value if math.isfinite(value) else None for name, value in numbers.items()}
    known |= {"seconds": clip.duration_s, "leg_ratio": leg_ratio}
    return {**known, "worst_figure": worst, "times_its_bar": times, **velocity_of(clip)}


def changes_of(targets: Targets) -> dict[str, float]:
    """Where the plan departs from the human because the robot can't follow, each 0 (shares: 1) where it does not.

    Least share of the lateral motion that is kept, largest way that a foothold is moved outward [m], largest angle that
    the trunk leans less than the chest [deg], and the shares of the frames in which the pelvis is held to the human's
    path and to a smoothed one.
    """
    return {
        "lateral_share": targets.lateral_share,
        "foothold_moved_m": targets.foothold_moved,
        "lean_taken_off_deg": math.degrees(targets.lean_taken_off),
        "pelvis_held_share": float((targets.pelvis_held > 0.0).mean()),
        "pelvis_smoothed_share": float((targets.pelvis_smoothed > 0.0).mean()),
    }


def velocity_of(clip: RobotClip) -> dict[str, float]:
    """The command that the robot's motion is: mean forward and lateral velocity [m/s], yaw rate [rad/s]."""
    return dict(vars(command_velocity(clip.root_pos_w, clip.root_quat_w, clip.fps)))


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
