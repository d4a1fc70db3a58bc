"""Plots of training and tracking: curves of runs, errors of rollouts, the worst-tracked references."""

from collections.abc import Callable, Mapping, Sequence

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from pipeline.batch import Entry, Judged, Manifest, Store
from pipeline.clips.robot_clip import RobotClip
from pipeline.robot import Robot
from pipeline.tracking.process import NOT_TRACKED
from pipeline.viewing.contact_sheet import contact_sheet, entry_clip
from pipeline.viewing.playlist import Shown
from pipeline.viewing.plots import labelled, png

SHOWN_S = 1.0
"""Time shown before, and at most after, the failure or the largest error of a rollout [s]."""

PAIRS = (
    ("slip_before_m_s", "slip_after_m_s", 100.0, "foot slip, 95th percentile [cm/s]"),
    ("penetration_before_m", "penetration_after_m", 100.0, "penetration, largest [cm]"),
    ("jerk_before_rad_s3", "jerk_after_rad_s3", 1.0, "jerk, mean [rad/s³]"),
)
"""Figures that a reference and its rollout both have: their columns, scale and label."""


def tracking_errors(rollouts: pd.DataFrame) -> bytes:
    """PNG of errors (`rollout, body_error_m, joint_error_rad, action_noise`), nominal and disturbed, and over noise."""
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
    """PNG of figures of `pipeline.tracking.before_after`: each reference compared with its undisturbed rollout."""
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
    timing.set(xlabel="delay of touchdown relative to the reference [ms]", ylabel="references")
    return png(figure)


def worst_tracked(
    rollouts: Manifest,
    references: Manifest,
    motions_to_failure: Callable[[Sequence[Entry]], Manifest],
    store: Store,
    robot: Robot,
    most: int = 5,
) -> bytes:
    """PNG of the worst-tracked references, each above its rollout up to the failure.

    References that fail come first; the last pose of each is that of the failure. Then come those with the largest
    tracking error, around the moment of that error. One clip of each family (`walk@0-99`, `walk@0-99~mirror`, ...) is
    shown.

    Args:
        rollouts: manifest of `augmented_motions`
        references: manifest of the motions that were tracked
        motions_to_failure: returns the motions of references up to the frame at which their nominal rollout fails,
            under the references' names (`pipeline.tracking.process.motion_to_failure`)
        store: the store with all motions
        robot: the robot of the motions
        most: maximum number of references
    """
    entries = {entry.clip: entry for entry in references.entries}
    families: dict[str, Judged] = {}
    for row in sorted(rollouts.judged, key=lambda row: (bool(row.numbers.get("survived")), -_cm(row), row.clip)):
        if row.clip in entries and "worst_body_error_m" in row.numbers:
            families.setdefault(row.clip.split("~")[0], row)
    rows = list(families.values())[:most]
    failing = [entries[row.clip] for row in rows if not row.numbers.get("survived")]
    motions = {entry.clip: entry for entry in motions_to_failure(failing).entries} if failing else {}
    for entry in rollouts.entries:
        if entry.numbers["rollout"] == 0 and entry.numbers["survived"]:
            motions[str(entry.numbers["reference"])] = entry
    strips = [
        _strip(row, _robot_clip(store, entries[row.clip]), _robot_clip(store, motions[row.clip]))
        for row in rows
        if row.clip in motions
    ]
    return contact_sheet(strips, robot)


def _strip(row: Judged, reference: RobotClip, rollout: RobotClip) -> Shown:
    """A reference and its rollout up to the last frame of it, or around the moment of the largest error."""
    failing = next((str(reason["text"]) for reason in row.reasons if reason["code"] == NOT_TRACKED), None)
    at_s = (rollout.frame_count - 1) / rollout.fps if failing else float(row.numbers.get("worst_at_s") or 0.0)
    start = max(round((at_s - SHOWN_S) * rollout.fps), 0)
    stop = min(round((at_s + SHOWN_S) * rollout.fps) + 1, rollout.frame_count)
    start_s, stop_s = start / rollout.fps, (stop - 1) / rollout.fps
    return Shown(
        name=f"{row.clip} from {start_s:.2f} to {stop_s:.2f} s",
        note=failing or f"largest error at {at_s:.2f} s: {_cm(row):.1f} cm, tracked to its end",
        reference=reference.cut(start, stop, reference.name),
        robot_clip=rollout.cut(start, stop, rollout.name),
    )


def _robot_clip(store: Store, entry: Entry) -> RobotClip:
    clip = entry_clip(store, entry)
    assert isinstance(clip, RobotClip)
    return clip


def _cm(row: Judged) -> float:
    return 100.0 * float(row.numbers.get("worst_body_error_m") or 0.0)


COLOURS = ("#1f77b4", "#ff7f0e", "#2ca02c", "#d62728", "#9467bd", "#8c564b")
PANELS: tuple[tuple[str, tuple[str, ...]], ...] = (
    ("reward per step", ("task_reward", "style_reward")),
    ("discriminator", ("d_expert", "d_policy", "d_rollout")),
    ("episode [s]", ("episode_s",)),
)
"""Title of a panel and the columns of `curves.csv` in it."""
BINS = ("slow", "mid", "fast", "top", "side", "turn")
"""Command bins whose velocity is shown as a share of the command."""
STYLES = ("-", "--", ":")


def training_curves(runs: Mapping[str, pd.DataFrame]) -> bytes:
    """PNG of the `curves.csv` of runs by name over training time [s]; one colour per run or, for one run, per curve."""
    figure = Figure(figsize=(11.0, 5.6), dpi=80, layout="constrained")
    places = figure.subplots(2, 2).ravel()
    for place, (title, columns) in zip(places, PANELS, strict=False):
        for number, (name, table) in enumerate(runs.items()):
            for index, column in enumerate(columns):
                colour = COLOURS[number if len(runs) > 1 else index]
                _line(place, table, column, colour, STYLES[index if len(runs) > 1 else 0], f"{name} {column}".strip())
        place.set_title(title, fontsize=9)
    for number, (name, table) in enumerate(runs.items()):
        for index, each in enumerate(BINS):
            if f"{each}_achieved" in table and f"{each}_commanded" in table:
                share = table.assign(share=table[f"{each}_achieved"] / table[f"{each}_commanded"])
                style = STYLES[number % len(STYLES)]
                _line(places[3], share, "share", COLOURS[index], style, f"{name} {each}".strip())
    places[3].set_title("velocity as a share of the command", fontsize=9)
    places[3].set_ylim(-0.2, 1.4)
    for place in places:
        labelled(place, "training [s]", size=7)
        if place.lines:
            place.legend(fontsize=6)
    return png(figure)


def _line(place, table: pd.DataFrame, column: str, colour: str, style: str, label: str) -> None:
    if column in table and bool(np.isfinite(table[column]).any()):
        place.plot(table["seconds"], table[column], style, color=colour, linewidth=1.1, label=label)
