"""Criteria of dynamics: torque within the limits, and contact forces that explain the motion."""

from __future__ import annotations

import numpy as np

from pipeline import time_series
from pipeline.feasibility.motion import Motion
from pipeline.feasibility.settings import TorqueSettings
from pipeline.feasibility.verdict import Verdict
from pipeline.simulation.contact_wrench import GRAVITY, ContactSolution, solve_contacts
from pipeline.simulation.inverse_dynamics import motion_forces, states


def torques(motion: Motion, settings: TorqueSettings) -> tuple[Verdict, ...]:
    """Torque over the limits (share of a joint's frames, longest stretch) and the force and moment left unexplained."""
    solution = _best_contacts(motion, settings)
    return (*_over_limit(motion, solution, settings), *_residuals(motion, solution, settings))


def _best_contacts(motion: Motion, settings: TorqueSettings) -> ContactSolution:
    clip, sole = motion.clip, motion.sole
    series = states(clip.root_pos_w, clip.root_quat_w, clip.joint_pos, clip.fps, settings.cutoff_hz)
    bearing = sole.corner_pos_w[..., 2] < settings.touch_height
    if motion.labelled:
        bearing &= motion.contacts[:, :, None]
    touching = bearing.copy()  # an acceleration over three frames sees a contact of any of them
    touching[1:] |= bearing[:-1]
    touching[:-1] |= bearing[1:]
    return solve_contacts(
        motion.robot,
        motion_forces(motion.robot, series),
        clip.root_pos_w,
        sole.corner_pos_w,
        touching,
        friction=settings.friction,
    )


def _over_limit(motion: Motion, solution: ContactSolution, settings: TorqueSettings) -> tuple[Verdict, Verdict]:
    names, fps = motion.robot.joint_names, motion.clip.fps
    ratio = np.abs(solution.joint_torque) / motion.robot.torque_limit
    over = ratio > settings.ratio
    share = over.mean(axis=0)
    most = int(np.argmax(share))
    bad = np.zeros(len(over), dtype=bool)
    longest, where, which = 0.0, 0.0, most
    for joint in np.flatnonzero(over.any(axis=0)):
        for start, stop in time_series.runs(over[:, joint]):
            seconds = (stop - start) / fps
            bad[start:stop] |= seconds > settings.over_run_s
            if seconds > longest:
                longest, where, which = seconds, start / fps, int(joint)
    return (
        Verdict(
            code="torque_over_share",
            value=float(share[most]),
            limit=settings.over_share,
            unit="of frames",
            text=f"{names[most]} needs more than its torque limit in {100 * share[most]:.1f} % of the frames, at most "
            f"{ratio[:, most].max():.2f} times as much",
            bad=over[:, share > settings.over_share].any(axis=1),
        ),
        Verdict(
            code="torque_over_run_s",
            value=longest,
            limit=settings.over_run_s,
            unit="s",
            text=f"from {where:.2f} s on {names[which]} needs more than its torque limit for {longest:.2f} s in a row",
            bad=bad,
        ),
    )


def _residuals(motion: Motion, solution: ContactSolution, settings: TorqueSettings) -> tuple[Verdict, Verdict]:
    weight = motion.robot.total_mass * GRAVITY
    left = np.stack(
        [np.linalg.norm(solution.residual_w[:, :3], axis=1), np.linalg.norm(solution.residual_w[:, 3:5], axis=1)],
        axis=1,
    )
    width = 2 * round(settings.residual_window_s * motion.clip.fps / 2) + 1
    share = time_series.moving_mean(left / weight, width)
    force, lever = share.max(axis=0)
    at = share.argmax(axis=0) / motion.clip.fps
    return (
        Verdict(
            code="force_residual",
            value=float(force),
            limit=settings.force_residual,
            unit="of the weight",
            text=f"around {at[0]:.2f} s no force of the ground on the soles explains the motion: "
            f"{100 * force:.0f} % of the weight is missing",
            bad=share[:, 0] > settings.force_residual,
        ),
        Verdict(
            code="lever_residual",
            value=float(lever),
            limit=settings.lever_residual,
            unit="m",
            text=f"around {at[1]:.2f} s the robot is out of balance: the centre of pressure would have to lie "
            f"{100 * lever:.0f} cm outside the soles",
            bad=share[:, 1] > settings.lever_residual,
        ),
    )
