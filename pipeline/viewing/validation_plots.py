"""Plots of a validation: command following, push survival, torque, foot contacts, engines, limit cycles."""

from collections.abc import Mapping, Sequence

import numpy as np
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle

from pipeline.robot.description import SIDES
from pipeline.robot.legs import legs_of
from pipeline.simulation.record import Rollout
from pipeline.simulation.torque_envelope import TorqueEnvelope
from pipeline.validation.cross_engine import NAMES, CrossEngineResult
from pipeline.validation.limit_cycle_walks import SpeedCycles
from pipeline.validation.limit_cycles import PLANES
from pipeline.validation.verdict import CellVerdict, Verdict
from pipeline.viewing.plots import labelled, png

AXES = (("forward", "forward [m/s]"), ("lateral", "to the left [m/s]"), ("yaw_rate", "yaw rate [rad/s]"))
COLOURS = {"passed": "#1f77b4", "failed": "#d62728", "not required": "#7f7f7f"}
SHOWN_S = 3.0
"""Duration shown in the plot of foot contacts [s]."""
POINTS = 1500
"""Maximum number of points per joint in the torque-speed plot."""


def command_tracking(verdict: Verdict) -> bytes:
    """Achieved against commanded velocity, one column per axis; error bars over the seeds."""
    figure = Figure(figsize=(9.0, 3.2), dpi=80, layout="constrained")
    cells = [cell for cell in verdict.cells if cell.measured.cell.group == "commands"]
    for (name, label), place in zip(AXES, figure.subplots(1, 3), strict=True):
        shown = [
            cell
            for cell in cells
            if _commanded(cell, name) != 0.0 or not any(cell.measured.cell.trials[0].command.last.goal)
        ]
        for cell in shown:
            spread, commanded = cell.measured.spread(name), _commanded(cell, name)
            if spread:
                low, high = spread["mean"] - spread["min"], spread["max"] - spread["mean"]
                place.errorbar(
                    commanded, spread["mean"], [[low], [high]], fmt="o", color=COLOURS[cell.word], markersize=4
                )
            else:
                place.plot(commanded, 0.0, "x", color=COLOURS["failed"])
        ends = [_commanded(cell, name) for cell in shown] or [0.0]
        place.plot([min(ends), max(ends)], [min(ends), max(ends)], color="#bbbbbb", linewidth=0.8, zorder=0)
        labelled(place, f"commanded {label}", "achieved")
    figure.suptitle("blue passed, red failed, grey not required, x: every trial fell", fontsize=8)
    return png(figure)


def survival_heatmap(verdict: Verdict) -> bytes:
    """Share of survived pushes: one row per push model and gait, one column per strength."""
    rows: dict[str, list[CellVerdict]] = {}
    for cell in verdict.cells:
        if cell.measured.cell.group.startswith("pushes"):
            rows.setdefault(" ".join(cell.measured.cell.name.split()[1:3]), []).append(cell)
    figure = Figure(figsize=(8.0, 0.55 * max(len(rows), 1) + 0.8), dpi=80, layout="constrained")
    place = figure.subplots()
    for row, (label, cells) in enumerate(rows.items()):
        for column, cell in enumerate(cells):
            survival = cell.measured.figure("survival") or 0.0
            colour = (0.95 - 0.55 * survival, 0.45 + 0.45 * survival, 0.45 + 0.1 * survival)
            place.add_patch(Rectangle((column - 0.48, row - 0.45), 0.96, 0.9, facecolor=colour))
            text = f"{' '.join(cell.measured.cell.name.split()[3:])}\n{survival:.2f}"
            weight = "bold" if cell.word == "failed" else "normal"
            place.text(column, row, text, ha="center", va="center", fontsize=7, fontweight=weight)
        place.text(-0.6, row, label, ha="right", va="center", fontsize=8)
    place.set_xlim(-2.2, max((len(cells) for cells in rows.values()), default=1) - 0.5)
    place.set_ylim(len(rows) - 0.5, -0.5)
    place.set_axis_off()
    figure.suptitle("survival of pushes by model; bold: below its threshold", fontsize=8)
    return png(figure)


def torque_speed(walks: Mapping[str, Rollout], envelope: TorqueEnvelope) -> bytes:
    """Torque against speed of the left leg's joints, with the motors' envelope."""
    first = next(iter(walks.values()))
    names = first.robot.joint_names
    left, _ = legs_of(first.robot).joints
    figure = Figure(figsize=(9.0, 5.0), dpi=80, layout="constrained")
    for joint, place in zip(left, np.ravel(figure.subplots(2, 3)), strict=False):
        for label, walked in walks.items():
            step = max(len(walked.torque) // POINTS, 1)
            place.plot(walked.qvel[::step, 6 + joint], walked.torque[::step, joint], ".", markersize=1.2, label=label)
        fastest = max(float(np.abs(walked.qvel[:, 6 + joint]).max()) for walked in walks.values())
        speed = np.linspace(-1.1 * fastest, 1.1 * fastest, 100)
        lower, upper = envelope.bounds(np.tile(speed[:, None], (1, len(names))))
        place.plot(speed, upper[:, joint], color="#000000", linewidth=0.8)
        place.plot(speed, lower[:, joint], color="#000000", linewidth=0.8)
        place.set_title(names[joint], fontsize=8)
        labelled(place)
    figure.axes[0].legend(fontsize=6, markerscale=6)
    figure.supxlabel("joint speed [rad/s]", fontsize=8)
    figure.supylabel("torque [N m]", fontsize=8)
    figure.suptitle("line: torque-speed envelope", fontsize=8)
    return png(figure)


def foot_contacts(walks: Mapping[str, Rollout]) -> bytes:
    """Foot contacts in the last seconds of each walk."""
    figure = Figure(figsize=(9.0, 0.8 * len(walks) + 0.6), dpi=80, layout="constrained")
    for (label, walked), place in zip(walks.items(), np.ravel(figure.subplots(len(walks), 1)), strict=True):
        contacts = walked.contacts()[-round(SHOWN_S / walked.timestep_s) :]
        times_s = walked.timestep_s * np.arange(len(contacts))
        for foot, colour in enumerate(("#1f77b4", "#ff7f0e")):
            place.fill_between(
                times_s, foot + 0.1, foot + 0.9, where=contacts[:, foot].tolist(), color=colour, step="post"
            )
        place.set_yticks([0.5, 1.5], ["left", "right"], fontsize=7)
        place.set_title(label, fontsize=8, loc="left")
        place.tick_params(labelsize=7)
    figure.supxlabel("time [s]", fontsize=8)
    return png(figure)


def _commanded(cell: CellVerdict, name: str) -> float:
    return float(getattr(cell.measured.cell.trials[0].command.last, name))


ENGINE_COLOURS = {"mujoco": "#1f77b4", "bridge": "#7fb2d9", "dart": "#ff7f0e"}
FIGURES = (
    ("forward_m_s", "forward [m/s]"),
    ("lateral_m_s", "to the left [m/s]"),
    ("yaw_rate_rad_s", "turning left [rad/s]"),
    ("height_m", "height [m]"),
)
PLANE_AXES = (
    ("hip pitch [rad]", "knee [rad]"),
    ("hip pitch [rad]", "its velocity · T/2π [rad]"),
    ("knee [rad]", "its velocity · T/2π [rad]"),
)
CYCLE_COLOURS = {"MuJoCo": "#1f77b4", "DART": "#ff7f0e"}
LOG_COLOURS = ("#2ca02c", "#d62728", "#9467bd", "#8c564b")


def cross_engine_plots(found: CrossEngineResult) -> bytes:
    """PNG with one row per cell: means of each seed and engine, a cross per fall, grey rows if not required."""
    figure = Figure(figsize=(11.0, 0.28 * len(found.cells) + 1.4), dpi=80, layout="constrained")
    places = figure.subplots(1, len(FIGURES), sharey=True, squeeze=False)[0]
    for place, (name, label) in zip(places, FIGURES, strict=True):
        for row, cell in enumerate(found.cells):
            if not cell.required:
                place.axhspan(row - 0.5, row + 0.5, color="0.93", linewidth=0.0)
            for shift, (engine, each) in enumerate(cell.figures.items()):
                height = row + 0.24 * (shift - (len(cell.figures) - 1) / 2.0)
                values = [getattr(one, name) for one in each if not one.fell]
                place.plot(values, np.full(len(values), height), "|", color=ENGINE_COLOURS[engine], markersize=6)
                fallen = sum(one.fell for one in each)
                if fallen:
                    edge = {"ha": "right", "va": "center", "transform": place.get_yaxis_transform()}
                    place.text(0.99, height, "x" * fallen, color=ENGINE_COLOURS[engine], fontsize=6, **edge)
        labelled(place, label)
    places[0].set_yticks(range(len(found.cells)), [cell.name for cell in found.cells], fontsize=7)
    places[0].invert_yaxis()
    engines = found.cells[0].figures if found.cells else ()
    handles = [places[0].plot([], [], "|", color=ENGINE_COLOURS[engine], label=NAMES[engine])[0] for engine in engines]
    figure.legend(handles=handles, loc="outside upper left", ncols=len(handles), fontsize=8, frameon=False)
    figure.suptitle(f"{found.robot}: {'passed' if found.passed else 'failed'}", fontsize=9, ha="left", x=0.75)
    return png(figure)


def limit_cycle_plots(found: Sequence[SpeedCycles]) -> bytes:
    """PNG of limit cycles, one row per speed and leg, one column per plane; missing comparisons are in the title."""
    rows = [(each, side) for each in found for side in SIDES]
    figure = Figure(figsize=(9.0, 2.6 * len(rows) + 0.4), dpi=80, layout="constrained")
    grid = figure.subplots(max(len(rows), 1), len(PLANES), squeeze=False)
    for (each, side), places in zip(rows, grid, strict=False):
        mine = {name: cycle for name, cycle in each.cycles.items() if name.endswith(side)}
        spare = iter(LOG_COLOURS * (len(mine) // len(LOG_COLOURS) + 1))
        colours = {name: CYCLE_COLOURS.get(name.split()[0]) or next(spare) for name in mine}
        for plane, place, (x, y) in zip(PLANES, places, PLANE_AXES, strict=True):
            for name, cycle in mine.items():
                curve = cycle.plane(plane)
                closed = np.concatenate([curve, curve[:1]])
                place.plot(closed[:, 0], closed[:, 1], color=colours[name], linewidth=1.3, label=name)
            labelled(place, x, y, size=7)
        places[0].set_title(f"{each.speed_m_s:g} m/s, {side} leg", fontsize=8, loc="left")
        if mine:
            places[-1].legend(fontsize=6)
        else:
            places[1].set_title("nothing to show", fontsize=8, color="#d62728")
    return png(figure)
