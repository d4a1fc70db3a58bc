"""The retargeting stage: from a human clip to the robot's clip and its numbers."""

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
from pipeline.retarget.clearance import corrected_targets
from pipeline.retarget.foot_plan import contacts_of
from pipeline.retarget.pelvis_path import fading_grip, held_share, smoothed_path, smoothed_share
from pipeline.retarget.settings import RetargetSettings
from pipeline.retarget.solver import Trajectory, solver_for
from pipeline.retarget.targets import Targets, plan_targets
from pipeline.robot import Kinematics, Robot
from pipeline.robot.size import scaled
from pipeline.scoring import score_without_collisions, worst_of_bars


def process(clip: HumanClip, numbers: Mapping[str, Any], *, settings: RetargetSettings, robot: Robot) -> Outcome:
    """Retarget a repaired human clip; the Outcome has one piece with the clip's name.

    Raises ClipError for a clip with missing samples, with implausible legs, or without a solution of the IK.
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

    Two passes: the first follows the targets only; the second also follows the first one's joint motion after a
    zero-phase low pass, which removes jitter from degrees of freedom that the targets do not determine. Where the
    pelvis deviates in the first pass, its weight is increased and the pass repeated; where a pass jerks the pelvis, its
    path is smoothed and that pass repeated. Distances in the settings are scaled to the robot.
    """
    settings = scaled(settings, robot)
    weights, fps, solver = settings.weights, settings.fps, solver_for(robot)
    targets = plan_targets(human, contacts_of(human, settings.stance), solver.body, settings)
    planned_w = targets.pelvis_pos_w
    rest = np.tile(robot.default_joint_pos, (human.frame_count, 1))

    def with_smooth_path(targets: Targets, reached_w: np.ndarray) -> Targets | None:
        """Targets with a smoothed pelvis path where a pass jerked the pelvis; None if it did not."""
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
    targets = corrected_targets(targets, poses, robot, solver.body.sole, settings.clearance, fps)
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

    Velocities are the robot's (the human's times `leg_ratio`). Slip, drift and depth use the scorer's own contact
    labels, `slip_m_s` the middle ones. KP5 detects self-collisions. None where a clip has no sample (no foot ever
    stands). `worst_figure` is the figure with the largest ratio to its limit, `times_its_bar` that ratio.
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
    """How far the plan deviates from the human because of the robot's limits; each 0 (shares: 1) where it does not.

    Least share of the lateral motion that is kept, largest outward shift of a foothold [m], largest reduction of the
    trunk's lean [deg], and the shares of frames in which the pelvis is held to the human's path and to a smoothed one.
    """
    return {
        "lateral_share": targets.lateral_share,
        "foothold_moved_m": targets.foothold_moved,
        "lean_taken_off_deg": math.degrees(targets.lean_taken_off),
        "pelvis_held_share": float((targets.pelvis_held > 0.0).mean()),
        "pelvis_smoothed_share": float((targets.pelvis_smoothed > 0.0).mean()),
    }


def velocity_of(clip: RobotClip) -> dict[str, float]:
    """Velocity command of the motion: mean forward and lateral velocity [m/s], mean yaw rate [rad/s]."""
    return dict(vars(command_velocity(clip.root_pos_w, clip.root_quat_w, clip.fps)))


def onto_robot(clip: Clip, numbers: Mapping[str, Any], *, settings: RetargetSettings, robot: Robot) -> Outcome:
    """Retarget a human clip, or resample a recording of this robot; a clip of another robot gives an empty Outcome."""
    if isinstance(clip, HumanClip):
        return process(clip, numbers, settings=settings, robot=robot)
    if clip.robot != robot.name or clip.joint_names != robot.joint_names:
        text = f"'{clip.name}' is a recording of the robot '{clip.robot}', not of '{robot.name}'."
        return Outcome(reasons=(Reason(code="other_robot", text=text, effect="rejected"),))
    resampled = clip.resampled(settings.fps)
    measured = {"seconds": resampled.duration_s, "leg_ratio": 1.0, **velocity_of(resampled)}
    return Outcome(pieces=(Piece(clip=resampled, numbers=measured),))
