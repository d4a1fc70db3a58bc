"""Pictures of tracking: errors of all rollouts, what simulation changed, and the worst-tracked references."""

from __future__ import annotations

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from pipeline.batch import Judged, Manifest, Store
from pipeline.clips.robot_clip import RobotClip
from pipeline.robot import Robot
from pipeline.tracking.process import NOT_TRACKED
from pipeline.viewing.contact_sheet import Strip, worst_clips_sheet
from pipeline.viewing.entry_clip import entry_clip
from pipeline.viewing.plots import png

SHOWN_S = 1.0
"""A failing reference is shown from this long before the failure to this long after [s]."""

PAIRS = (
    ("slip_before_m_s", "slip_after_m_s", 100.0, "foot slip, 95th percentile [cm/s]"),
    ("penetration_before_m", "penetration_after_m", 100.0, "penetration, largest [cm]"),
    ("jerk_before_rad_s3", "jerk_after_rad_s3", 1.0, "jerk, mean [rad/s³]"),
)
"""Figures that a reference and its rollout both have: their columns, scale and label."""


def tracking_errors(rollouts: pd.DataFrame) -> bytes:
    """PNG: distribution of body and joint errors, nominal and disturbed, and body error against action noise.

    Args:
        rollouts: one row a rollout with `rollout, body_error_m, joint_error_rad, action_noise`
    """
    figure = Figure(figsize=(10.0, 3.2), dpi=80, layout="constrained")
    body, joint, noise = figure.subplots(1, 3)
    nominal = rollouts["rollout"].to_numpy() == 0
    body_cm = 100.0 * rollouts["body_error_m"].to_numpy(dtype=float)
    joint_deg = np.degrees(rollouts["joint_error_rad"].to_numpy(dtype=float))
    for axes, values, label in ((body, body_cm, "body error [cm]"), (joint, joint_deg, "joint error [deg]")):
        bins = np.linspace(0.0, max(float(values.max()), 1e-6), 31)
        axes.hist([values[nominal], values[~nominal]], bins=bins, stacked=True, label=["nominal", "disturbed"])
        axes.set(xlabel=label, ylabel="rollouts")
        axes.legend()
    noise.scatter(rollouts["action_noise"], body_cm, s=6.0, alpha=0.5)
    noise.set(xlabel="action noise", ylabel="body error [cm]")
    return png(figure)


def before_and_after(references: pd.DataFrame) -> bytes:
    """PNG: slip, penetration and jerk of each reference against its nominal rollout's; saturation and contacts.

    Args:
        references: one row a reference with the figures of `pipeline.tracking.before_after`
    """
    columns = [name for before, after, _, _ in PAIRS for name in (before, after)]
    figures = references[[*columns, "saturated_after", "touchdown_shift_s"]].astype(float)
    figure = Figure(figsize=(15.0, 3.2), dpi=80, layout="constrained")
    *pairs, saturation, timing = figure.subplots(1, 5)
    for axes, (before, after, scale, label) in zip(pairs, PAIRS, strict=True):
        values = scale * figures[[before, after]].to_numpy()
        most = float(np.nanmax(values, initial=1e-6))
        axes.plot([0.0, most], [0.0, most], color="#aaaaaa", linewidth=1.0)
        axes.scatter(values[:, 0], values[:, 1], s=8.0, alpha=0.5)
        axes.set(xlabel=f"reference: {label}", ylabel="rollout")
    saturation.hist(100.0 * figures["saturated_after"].dropna().to_numpy(), bins=20)
    saturation.set(xlabel="rollout: saturation, worst joint [% of frames]", ylabel="references")
    timing.hist(1000.0 * figures["touchdown_shift_s"].dropna().to_numpy(), bins=20)
    timing.set(xlabel="touchdown later than the reference's [ms]", ylabel="references")
    return png(figure)


def worst_tracked(rollouts: Manifest, references: Manifest, store: Store, robot: Robot, most: int = 5) -> bytes:
    """PNG of the references that are tracked worst, around the moment they fail or are furthest off.

    References that fail come first. One clip of each family (`walk@0-99`, `walk@0-99~mirror`, ...) is shown.
    """
    entries = {entry.clip: entry for entry in references.entries}
    families: dict[str, Judged] = {}
    for row in sorted(rollouts.judged, key=_badness):
        if row.clip in entries and "worst_body_error_m" in row.numbers:
            families.setdefault(row.clip.split("~")[0], row)
    strips = []
    for row in list(families.values())[:most]:
        clip = entry_clip(store, entries[row.clip])
        assert isinstance(clip, RobotClip)
        failing = next((reason for reason in row.reasons if reason["code"] == NOT_TRACKED), None)
        at_s = float(failing["stop_s"]) if failing else float(row.numbers.get("worst_at_s") or 0.0)
        start = max(int((at_s - SHOWN_S) * clip.fps), 0)
        stop = min(int((at_s + SHOWN_S) * clip.fps) + 1, clip.frame_count)
        furthest = f"furthest off at {at_s:.2f} s: {_cm(row):.1f} cm, followed to its end"
        note = str(failing["text"]) if failing else furthest
        strips.append(Strip(title=row.clip, note=note, human=None, robot_clip=clip.cut(start, stop, clip.name)))
    return worst_clips_sheet(strips, robot)


def _badness(row: Judged) -> tuple[bool, float, str]:
    return bool(row.numbers.get("survived")), -_cm(row), row.clip


def _cm(row: Judged) -> float:
    return 100.0 * float(row.numbers.get("worst_body_error_m") or 0.0)
