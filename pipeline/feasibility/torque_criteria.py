"""Criteria of dynamics: torque within the limits, and contact forces that explain the motion."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float, Int

from pipeline import rotation
from pipeline.feasibility.motion import Motion
from pipeline.feasibility.over_limit import over_limit
from pipeline.feasibility.reference_need import lasting_need_over_allowed, need_over_allowed
from pipeline.feasibility.torque_settings import Residual, TorqueSettings
from pipeline.feasibility.verdict import Verdict
from pipeline.feasibility.windowed_mean import odd_width, windowed_mean
from pipeline.simulation.contact_wrench import GRAVITY, ContactSolution, solve_contacts
from pipeline.simulation.inverse_dynamics import MotionForces, motion_forces, states

_ALL = slice(None)

AT_LIMIT = 0.99
"""A motor that gives more than this of its limit may be held by it."""


@dataclass(frozen=True, kw_only=True)
class Dynamics:
    """What inverse dynamics says of a motion."""

    verdicts: tuple[Verdict, ...]
    consistent: bool
    """Contact forces explain nearly all of it: it was made by physics, or could have been."""
    root_first: ContactSolution
    """The forces that leave least at the root ..."""
    judged: ContactSolution
    """... and those that torque is judged by: where the motion is explained, with labels a little late or early; where
    it is not, the ones that keep to the limits."""


def dynamics(motion: Motion, settings: TorqueSettings) -> Dynamics:
    """Torque over the limits (most, share of a joint's frames, longest stretch) and what contact forces don't explain.

    A motion that contact forces explain is taken at its word: every torque it needs counts, with labels, where it has
    any, that may be late or early. One that they don't is a
    reference, followed only roughly: there the forces are sought that keep the torques within their limits, and what is
    missing at the root is held against a looser limit. So the most that such a motion needs says little: past its limit
    torque costs more than the root's residual, which takes the rest. What it asks of the motors is held against
    limits of its own.
    """
    labelled_s = (settings.label_reach_s, settings.label_reach_s)
    contacts = Contacts(motion, settings, labelled_s if motion.labelled else settings.told_reach_s)
    strict = contacts.solve(settings.strict_excess)
    percentiles = np.percentile(_residual(motion, strict), 100.0 * settings.consistent_share, axis=0)
    bounds = settings.consistent
    consistent = bool(percentiles[0] <= bounds.force and percentiles[1] <= bounds.lever)
    solution = _with_late_labels(motion, strict, settings) if consistent else contacts.solve(settings.reference_excess)
    limits = settings.dynamic_residual if consistent else _reference_limits(motion.ground_speed, settings)
    verdicts = (
        *torque_over_limit(motion, solution.joint_torque, settings),
        *(() if consistent else _asked(motion, contacts, strict, solution, settings)),
        *_residuals(motion, strict if consistent else solution, limits, settings),
    )
    return Dynamics(verdicts=verdicts, consistent=consistent, root_first=strict, judged=solution)


def _with_late_labels(motion: Motion, strict: ContactSolution, settings: TorqueSettings) -> ContactSolution:
    """What an explained motion needs where its labels, if it has any, may begin and end as late or early as those do
    that are told from the soles: beside a wrong label a motor seems to be past its limit."""
    if not motion.labelled:
        return strict
    before_s, after_s = (max(settings.label_reach_s, told_s) for told_s in settings.told_reach_s)
    reach_s = (before_s, after_s)
    return Contacts(motion, settings, reach_s).solve(settings.strict_excess)


def _asked(
    motion: Motion,
    contacts: Contacts,
    root_first: ContactSolution,
    limits_first: ContactSolution,
    settings: TorqueSettings,
) -> tuple[Verdict, Verdict]:
    """What a reference asks of the motors: for a moment, the root first; for longer, of each where the others are kept
    within their limits."""
    moment = _ratio(motion, root_first.joint_torque, settings.mean_s)
    alone = contacts.torque_alone(limits_first, settings.reference_excess)
    lasting = _ratio(motion, alone, settings.lasting_need.mean_s)
    return (
        need_over_allowed(motion, moment, settings.reference_need),
        lasting_need_over_allowed(motion, lasting, settings.lasting_need),
    )


def _reference_limits(speed: float, settings: TorqueSettings) -> Residual:
    force, lever = settings.reference_force, settings.reference_lever
    return Residual(force=force[0] + force[1] * speed, lever=lever[0] + lever[1] * speed)


class Contacts:
    """The forces a motion needs and the corners that may supply them."""

    def __init__(self, motion: Motion, settings: TorqueSettings, reach_s: tuple[float, float]):
        self._motion, self._friction = motion, settings.friction
        clip = motion.clip
        series = states(clip.root_pos_w, clip.root_quat_w, clip.joint_pos, clip.fps, settings.cutoff_hz)
        self._forces = motion_forces(motion.robot, series)
        self._touching = _touching(motion, settings, reach_s)

    def solve(
        self,
        excess_weight: float,
        frames: slice | Int[np.ndarray, " f"] = _ALL,
        torque_limit: Float[np.ndarray, " j"] | None = None,
    ) -> ContactSolution:
        """The forces of some frames; `torque_limit` [N m] replaces the robot's."""
        motion = self._motion
        root_pos_w, root_quat_w = motion.clip.root_pos_w[frames], motion.clip.root_quat_w[frames]
        return solve_contacts(
            motion.robot,
            _of_frames(self._forces, frames),
            root_pos_w,
            motion.sole.corner_pos_w[frames],
            self._touching[frames],
            friction=self._friction,
            excess_weight=excess_weight,
            heading=rotation.yaw_of(root_quat_w),
            torque_limit=torque_limit,
        )

    def torque_alone(self, limits_first: ContactSolution, excess_weight: float) -> Float[np.ndarray, "t j"]:
        """Torque [N m] that each motor would have to give if it had no limit and all others kept to theirs.

        Where it is within its limit among all, its limit asks nothing of the others, and what it gives there is that.
        """
        limit = self._motion.robot.torque_limit
        at_limit = np.abs(limits_first.joint_torque) > AT_LIMIT * limit
        alone = limits_first.joint_torque.copy()
        for joint in np.flatnonzero(at_limit.any(axis=0)):
            frames = np.flatnonzero(at_limit[:, joint])
            others = np.where(np.arange(len(limit)) == joint, np.inf, limit)
            alone[frames, joint] = self.solve(excess_weight, frames, others).joint_torque[:, joint]
        return alone


def _of_frames(forces: MotionForces, frames: slice | Int[np.ndarray, " f"]) -> MotionForces:
    return MotionForces(**{name: values[frames] for name, values in vars(forces).items()})


def _touching(motion: Motion, settings: TorqueSettings, reach_s: tuple[float, float]) -> Bool[np.ndarray, "t 2 4"]:
    """Corners that may bear a force: low ones of feet that are labelled as in contact, and they also for `reach_s` [s]
    before they do and after.

    Where nothing is labelled, low corners that stay where they are, for the speed over ground of that second: a foot
    in a slow swing is no faster than one that rolls off in a run. One that swings through a centimetre above the
    ground would else be one to lean on, and no torque of the standing leg could ever be needed.
    """
    height = motion.sole.corner_pos_w[..., 2]
    if motion.labelled:
        bearing = (height < settings.touch_height) & motion.contacts[:, :, None]
    else:
        (slowest, by_speed), commands = settings.told_speed, motion.commands
        bound = slowest + by_speed * np.hypot(commands[:, 0], commands[:, 1])
        slow = np.linalg.norm(motion.sole.corner_vel_w[..., :2], axis=-1) < bound[:, None, None]
        bearing = (height < motion.contact.height) & slow
    touching = bearing.copy()
    before, after = (round(seconds * motion.clip.fps) for seconds in reach_s)
    for away in range(1, before + 1):
        touching[:-away] |= bearing[away:]
    for away in range(1, after + 1):
        touching[away:] |= bearing[:-away]
    return touching


def _residual(motion: Motion, solution: ContactSolution) -> Float[np.ndarray, "t 2"]:
    """Force over weight and lever [m] of each frame."""
    weight = motion.robot.total_mass * GRAVITY
    force = np.linalg.norm(solution.residual_w[:, :3], axis=1)
    moment = np.linalg.norm(solution.residual_w[:, 3:5], axis=1)
    return np.stack([force, moment], axis=1) / weight


def _ratio(motion: Motion, joint_torque: Float[np.ndarray, "t j"], mean_s: float) -> Float[np.ndarray, "t j"]:
    """Torque over its limit as a mean over a time [s]."""
    return np.abs(windowed_mean(joint_torque, odd_width(mean_s, motion.clip.fps))) / motion.robot.torque_limit


def torque_over_limit(
    motion: Motion, joint_torque: Float[np.ndarray, "t j"], settings: TorqueSettings
) -> tuple[Verdict, Verdict, Verdict]:
    """Most that a joint needs over its limit, share of its frames over it, and the longest time in a row.

    Torque [N m] is taken as a mean over `settings.mean_s`: single frames at 50 Hz are off by steps of a controller and
    by impacts, so that a motor at its limit seems to pass it in some of them and to stay below in as many.
    """
    names = motion.robot.joint_names
    ratio = _ratio(motion, joint_torque, settings.mean_s)
    frame, joint = np.unravel_index(np.argmax(ratio), ratio.shape)
    found = over_limit(ratio > settings.ratio, motion)
    most, largest = found.worst, motion.largest_share(settings.over_share)
    return (
        Verdict(
            code="torque_ratio",
            value=float(ratio[frame, joint]),
            limit=settings.peak_ratio,
            unit="of the torque limit",
            text=f"frame {frame}: {names[joint]} needs {ratio[frame, joint]:.2f} times its torque limit as a mean over "
            f"{settings.mean_s:g} s",
            bad=np.any(ratio > settings.peak_ratio, axis=1),
        ),
        Verdict(
            code="torque_over_share",
            value=float(found.share[most]),
            limit=largest,
            unit="of frames",
            text=f"{names[most]} needs more than {settings.ratio:g} times its torque limit in "
            f"{100 * found.share[most]:.1f} % of the frames, at "
            f"most {ratio[:, most].max():.2f} times as much",
            bad=found.frames_of_joints_over(largest),
        ),
        Verdict(
            code="torque_over_run_s",
            value=found.longest_s,
            limit=settings.over_run_s,
            unit="s",
            text=f"from {found.start_s:.2f} s on {names[found.joint]} needs more than {settings.ratio:g} times its "
            f"torque limit for {found.longest_s:.2f} s in a row",
            bad=found.frames_of_runs_over(settings.over_run_s),
        ),
    )


def _residuals(
    motion: Motion, solution: ContactSolution, limits: Residual, settings: TorqueSettings
) -> tuple[Verdict, Verdict]:
    width = 2 * round(settings.residual_window_s * motion.clip.fps / 2) + 1
    share = windowed_mean(_residual(motion, solution), width)
    force, lever = share.max(axis=0)
    at = share.argmax(axis=0) / motion.clip.fps
    return (
        Verdict(
            code="force_residual",
            value=float(force),
            limit=limits.force,
            unit="of the weight",
            text=f"around {at[0]:.2f} s no force of the ground on the soles explains the motion: "
            f"{100 * force:.0f} % of the weight is missing",
            bad=share[:, 0] > limits.force,
        ),
        Verdict(
            code="lever_residual",
            value=float(lever),
            limit=limits.lever,
            unit="m",
            text=f"around {at[1]:.2f} s the robot is out of balance: the centre of pressure would have to lie "
            f"{100 * lever:.0f} cm outside the soles",
            bad=share[:, 1] > limits.lever,
        ),
    )
