"""Limit cycles of a policy's steady walk in each engine and in hardware logs, compared at each speed."""

import dataclasses
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from pipeline.errors import PipelineError, UnknownNameError
from pipeline.files.settings import plain
from pipeline.hardware_logs.trial import Trial
from pipeline.robot import Robot
from pipeline.robot.description import SIDES
from pipeline.robot.legs import legs_of
from pipeline.validation.bars import UNKNOWN, CellBars
from pipeline.validation.cross_engine_walk import make_plant
from pipeline.validation.deployed import Deployed
from pipeline.validation.limit_cycles import (
    PLANES,
    Comparison,
    JointSeries,
    LimitCycle,
    LimitCycleSettings,
    NoCycleError,
    compare,
    leg_series,
    limit_cycle,
)

ENGINES = ("MuJoCo", "DART")
"""The first is the reference for the others."""


@dataclass(frozen=True, kw_only=True)
class SpeedCycles:
    """Cycles and comparisons at one speed."""

    speed_m_s: float
    required: bool
    """Whether engines must agree."""
    why: str = ""
    """Why it is not required; empty if it is."""
    cycles: dict[str, LimitCycle] = field(default_factory=dict)
    """Cycles by record and leg, such as `MuJoCo left`."""
    comparisons: tuple[Comparison, ...] = ()
    missing: tuple[str, ...] = ()
    """Sentences on what was not compared, with the reason."""
    reasons: tuple[str, ...] = ()
    """Differences between engines beyond the bars."""

    def rows(self) -> list[dict[str, Any]]:
        """One row per cycle."""
        names = ("cycles", "period_s", "period_std_s", "hip_amplitude_rad", "knee_amplitude_rad", "spread_rad")
        return [
            {"speed_m_s": self.speed_m_s, "record": record, **{name: getattr(cycle, name) for name in names}}
            for record, cycle in self.cycles.items()
        ]

    def to_dict(self) -> dict[str, Any]:
        """JSON types."""
        return plain(dataclasses.replace(self, cycles={})) | {"cycles": self.rows()}


def limit_cycles(
    deployed: Deployed, trials: Iterable[Trial], settings: LimitCycleSettings, bars: Mapping[str, CellBars]
) -> tuple[SpeedCycles, ...]:
    """At each speed, the cycles of both legs in each engine and in each log of that command, compared with MuJoCo's.

    Args:
        deployed: the policy on its robot
        trials: robot logs
        settings: speeds and simulation settings
        bars: bars of each speed by `name_of`; a speed without bars is not required
    """
    logs = list(trials)
    return tuple(
        _at_speed(deployed, logs, speed, settings, bars.get(name_of(speed), UNKNOWN))
        for speed in sorted(settings.speeds_m_s)
    )


def name_of(speed_m_s: float) -> str:
    """Name of a speed in `robots/<robot>/validation.yaml`."""
    return f"{speed_m_s:g} m/s"


def _at_speed(
    deployed: Deployed, logs: Sequence[Trial], speed: float, settings: LimitCycleSettings, bars: CellBars
) -> SpeedCycles:
    cycles: dict[str, LimitCycle] = {}
    missing: list[str] = []
    for engine in ENGINES:
        try:
            found = [limit_cycle(each) for each in walk_series(deployed, engine, speed, settings)]
            cycles |= {f"{engine} {side}": cycle for side, cycle in zip(SIDES, found, strict=True)}
        except (NoCycleError, FellError) as error:
            missing.append(str(error))
    in_logs = [(trial, span) for trial in logs if (span := steady_span(trial, speed, settings)) is not None]
    if not in_logs:
        missing.append(f"no hardware log walks at {speed:g} m/s: not compared with a robot")
    for trial, span in in_logs:
        kind = "simulated log" if trial.simulated else "log"
        for side in SIDES:
            try:
                name = f"{kind} {trial.name} {side}"
                cycles[name] = limit_cycle(trial_series(trial, span, side, name, deployed.robot))
            except NoCycleError as error:
                missing.append(str(error))
    comparisons = tuple(
        compare(reference, other)
        for side in SIDES
        if (reference := cycles.get(f"{ENGINES[0]} {side}"))
        for name, other in cycles.items()
        if name.endswith(side) and not name.startswith(ENGINES[0])
    )
    engines = [each for each in comparisons if each.name.startswith(ENGINES[1])]
    reasons = [reason for each in engines for reason in _reasons(each, bars)]
    reasons += [text for text in missing if text.startswith(ENGINES)]
    return SpeedCycles(
        speed_m_s=speed,
        required=bars.required,
        why=bars.why,
        cycles=cycles,
        comparisons=comparisons,
        missing=tuple(missing),
        reasons=tuple(reasons),
    )


def figures_of(found: Comparison) -> dict[str, dict[str, float]]:
    """Evaluated values of a comparison: name of the figure -> description -> value."""
    ratios = {"hip amplitude": found.hip_amplitude_ratio, "knee amplitude": found.knee_amplitude_ratio}
    return {
        "shape_distance": {f"shape distance of {plane}": found.shape_distance[plane] for plane in PLANES},
        "period_difference": {"difference of periods": abs(found.period_ratio - 1.0)},
        "amplitude_difference": {f"difference of {name}s": abs(ratio - 1.0) for name, ratio in ratios.items()},
    }


def _reasons(found: Comparison, bars: CellBars) -> list[str]:
    return [
        f"{found.name} against {found.reference}: {what} {value:.3f}, asked is {bars.bars[name]}"
        for name, values in figures_of(found).items()
        for what, value in values.items()
        if name in bars.bars and not bars.bars[name].holds(value)
    ]


class FellError(PipelineError):
    """A walk that ended in a fall."""


def walk_series(
    deployed: Deployed, engine: str, speed: float, settings: LimitCycleSettings
) -> tuple[JointSeries, JointSeries]:
    """Left and right leg of a steady walk in an engine. Raises FellError."""
    walked = deployed.walk(
        make_plant(engine.lower(), deployed, settings.timestep_s, settings.friction),
        lambda time_s: np.array([min(speed, time_s), 0.0, 0.0]),
        settings.seconds,
        wrench_every=10_000,
        stop_on_fall=True,
    )
    if walked.fell_s is not None:
        raise FellError(f"{engine} at {speed:g} m/s: fell after {walked.fell_s:.2f} s")
    kept = slice(round(settings.settled_s / walked.timestep_s), None)
    legs, rate_hz = legs_of(deployed.robot), 1.0 / walked.timestep_s
    left, right = (
        leg_series(f"{engine} {side}", hip, knee, rate_hz, walked.qpos[kept, 7:], walked.qvel[kept, 6:])
        for side, hip, knee in zip(SIDES, legs.hip_pitch, legs.knee, strict=True)
    )
    return left, right


def steady_span(trial: Trial, speed: float, settings: LimitCycleSettings) -> slice | None:
    """The longest span of a log at a forward command, without its start; None if it is too short."""
    goal = np.array([speed, 0.0, 0.0])
    near = np.all(np.abs(trial.command - goal) <= settings.command_tolerance, axis=1)
    good = near & trial.measured & (trial.fall_state <= 0) & np.isfinite(trial.joint_pos).all(axis=1)
    edges = np.flatnonzero(np.diff(np.concatenate([[False], good, [False]]).astype(int)))
    if not len(edges):
        return None
    starts, stops = edges[::2], edges[1::2]
    longest = int(np.argmax(stops - starts))
    first = int(starts[longest]) + round(settings.settled_s * trial.rate_hz)
    span = slice(first, int(stops[longest]))
    return span if span.stop - span.start > settings.settled_s * trial.rate_hz else None


def trial_series(trial: Trial, span: slice, side: str, name: str, robot: Robot) -> JointSeries:
    """One leg of a span of a log. Raises UnknownNameError if the log lacks a joint of it."""
    legs, place = legs_of(robot), SIDES.index(side)
    names = (robot.joint_names[legs.hip_pitch[place]], robot.joint_names[legs.knee[place]])
    for joint in names:
        if joint not in trial.joint_names:
            raise UnknownNameError("joint", joint, trial.joint_names)
    hip, knee = map(trial.joint_names.index, names)
    return leg_series(name, hip, knee, trial.rate_hz, trial.joint_pos[span], trial.joint_vel[span])
