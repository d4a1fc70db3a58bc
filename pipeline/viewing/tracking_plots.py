"""Pictures of tracking: errors of all rollouts, and the worst-tracked references at the moment they fail."""

from __future__ import annotations

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from pipeline.batch import Judged, Manifest, Store
from pipeline.clips.robot_clip import RobotClip
from pipeline.robot import Robot
from pipeline.viewing.contact_sheet import Strip, worst_clips_sheet
from pipeline.viewing.entry_clip import entry_clip
from pipeline.viewing.plots import png

SHOWN_S = 1.0
"""A failing reference is shown from this long before the failure to this long after [s]."""


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
        failing = next((reason for reason in row.reasons if reason["code"] == "not_tracked"), None)
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
