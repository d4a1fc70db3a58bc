"""Records whose limit cycles are compared: a policy's steady walk in each engine, and spans of hardware logs."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import asdict, dataclass, field, replace
from typing import Any

import numpy as np

from pipeline.dart.plant import DartPlant
from pipeline.errors import PipelineError
from pipeline.hardware_logs.trial import Trial
from pipeline.robot import Robot
from pipeline.simulation.mujoco_plant import MujocoOptions, MujocoPlant
from pipeline.simulation.plant import Plant
from pipeline.simulation.run import run
from pipeline.validation.deployed import Deployed
from pipeline.validation.limit_cycle_settings import LimitCycleSettings
from pipeline.validation.limit_cycles import (
    PLANES,
    Comparison,
    JointSeries,
    LimitCycle,
    NoCycleError,
    compare,
    limit_cycle,
)

SIDES = ("left", "right")
ENGINES = ("MuJoCo", "DART")
"""The first is what the others are held against."""


@dataclass(frozen=True, kw_only=True)
class SpeedCycles:
    """Everything found at one speed."""

    speed_m_s: float
    required: bool
    cycles: dict[str, LimitCycle] = field(default_factory=dict)
    """By record and leg, as `MuJoCo left`."""
    comparisons: tuple[Comparison, ...] = ()
    missing: tuple[str, ...] = ()
    """What was not compared and why, a sentence each."""
    reasons: tuple[str, ...] = ()
    """Where engines differ by more than allowed."""

    def rows(self) -> list[dict[str, Any]]:
        """A row a cycle."""
        return [
            {
                "speed_m_s": self.speed_m_s,
                "record": name,
                "cycles": each.cycles,
                "period_s": each.period_s,
                "period_std_s": each.period_std_s,
                "hip_amplitude_rad": each.hip_amplitude_rad,
                "knee_amplitude_rad": each.knee_amplitude_rad,
                "spread_rad": each.spread_rad,
            }
            for name, each in self.cycles.items()
        ]

    def to_dict(self) -> dict[str, Any]:
        """JSON types."""
        return {
            "speed_m_s": self.speed_m_s,
            "required": self.required,
            "cycles": self.rows(),
            "comparisons": [asdict(each) for each in self.comparisons],
            "missing": list(self.missing),
            "reasons": list(self.reasons),
        }


def limit_cycles(deployed: Deployed, trials: Iterable[Trial], settings: LimitCycleSettings) -> tuple[SpeedCycles, ...]:
    """At each speed: the cycles of both legs in each engine and in each log of that command, held against MuJoCo's."""
    logs = list(trials)
    return tuple(
        _at_speed(deployed, logs, speed, settings) for speed in sorted({*settings.required_m_s, *settings.shown_m_s})
    )


def _at_speed(deployed: Deployed, logs: Sequence[Trial], speed: float, settings: LimitCycleSettings) -> SpeedCycles:
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
                cycles[name] = limit_cycle(trial_series(trial, span, side, name, settings))
            except NoCycleError as error:
                missing.append(str(error))
    comparisons = tuple(
        compare(cycles[f"{ENGINES[0]} {side}"], other)
        for side in SIDES
        if f"{ENGINES[0]} {side}" in cycles
        for name, other in cycles.items()
        if name.endswith(side) and not name.startswith(ENGINES[0])
    )
    engines = [each for each in comparisons if each.name.startswith(ENGINES[1])]
    reasons = [reason for each in engines for reason in _reasons(each, settings)]
    reasons += [text for text in missing if text.startswith(ENGINES)]
    return SpeedCycles(
        speed_m_s=speed,
        required=speed in settings.required_m_s,
        cycles=cycles,
        comparisons=comparisons,
        missing=tuple(missing),
        reasons=tuple(reasons),
    )


def _reasons(found: Comparison, settings: LimitCycleSettings) -> list[str]:
    where = f"{found.name} against {found.reference}"
    reasons = [
        f"{where}: shape distance {found.shape_distance[plane]:.3f} of {plane}, allowed {settings.max_shape_distance:g}"
        for plane in PLANES
        if found.shape_distance[plane] > settings.max_shape_distance
    ]
    ratios = {
        "period": (found.period_ratio, settings.max_period_difference),
        "hip amplitude": (found.hip_amplitude_ratio, settings.max_amplitude_difference),
        "knee amplitude": (found.knee_amplitude_ratio, settings.max_amplitude_difference),
    }
    reasons += [
        f"{where}: {name} {ratio:.3f} times, allowed is 1 ± {allowed:g}"
        for name, (ratio, allowed) in ratios.items()
        if abs(ratio - 1.0) > allowed
    ]
    return reasons


class FellError(PipelineError):
    """A walk that ended on the ground."""


def walk_series(
    deployed: Deployed, engine: str, speed: float, settings: LimitCycleSettings
) -> tuple[JointSeries, JointSeries]:
    """Left and right leg of a steady walk in an engine. Raises FellError."""
    walked = run(
        deployed.robot,
        _PLANTS[engine](_engine_robot(deployed), settings),
        deployed.controller(),
        deployed.motors(),
        lambda time_s: np.array([min(speed, time_s), 0.0, 0.0]),
        settings.seconds,
        sensors=deployed.reads,
        wrench_every=10_000,
        stop_on_fall=True,
    )
    if walked.fell_s is not None:
        raise FellError(f"{engine} at {speed:g} m/s: fell after {walked.fell_s:.2f} s")
    kept = slice(round(settings.settled_s / walked.timestep_s), None)
    joints, speeds = walked.qpos[kept, 7:], walked.qvel[kept, 6:]
    left, right = (
        _series(f"{engine} {side}", side, joints, speeds, 1.0 / walked.timestep_s, deployed.robot.joint_names, settings)
        for side in SIDES
    )
    return left, right


def steady_span(trial: Trial, speed: float, settings: LimitCycleSettings) -> slice | None:
    """The longest span of a log at a forward command, less its start; None where none is long enough to look at."""
    wanted = np.array([speed, 0.0, 0.0])
    near = np.all(np.abs(trial.command - wanted) <= settings.command_tolerance, axis=1)
    good = near & trial.measured & (trial.fall_state <= 0) & np.isfinite(trial.joint_pos).all(axis=1)
    edges = np.flatnonzero(np.diff(np.concatenate([[False], good, [False]]).astype(int)))
    if not len(edges):
        return None
    starts, stops = edges[::2], edges[1::2]
    longest = int(np.argmax(stops - starts))
    first = int(starts[longest]) + round(settings.settled_s * trial.rate_hz)
    span = slice(first, int(stops[longest]))
    return span if span.stop - span.start > settings.settled_s * trial.rate_hz else None


def trial_series(trial: Trial, span: slice, side: str, name: str, settings: LimitCycleSettings) -> JointSeries:
    """One leg of a span of a log."""
    joints, speeds = (array[span].astype(float) for array in (trial.joint_pos, trial.joint_vel))
    return _series(name, side, joints, speeds, trial.rate_hz, trial.joint_names, settings)


def _series(
    name: str,
    side: str,
    joint_pos: np.ndarray,
    joint_vel: np.ndarray,
    rate_hz: float,
    joint_names: tuple[str, ...],
    settings: LimitCycleSettings,
) -> JointSeries:
    hip, knee = (joint_names.index(settings.joints[f"{side}_{part}"]) for part in ("hip", "knee"))
    return JointSeries(
        name=name,
        rate_hz=rate_hz,
        hip=joint_pos[:, hip],
        knee=joint_pos[:, knee],
        hip_vel=joint_vel[:, hip],
        knee_vel=joint_vel[:, knee],
    )


def _engine_robot(deployed: Deployed) -> Robot:
    """The robot with the armature of the deployment, where that is another one."""
    return deployed.robot if deployed.armature is None else replace(deployed.robot, armature=deployed.armature)


def _mujoco(robot: Robot, settings: LimitCycleSettings) -> Plant:
    options = MujocoOptions(timestep_s=settings.timestep_s, friction=settings.friction, armature=robot.armature)
    return MujocoPlant(robot, options)


def _dart(robot: Robot, settings: LimitCycleSettings) -> Plant:
    return DartPlant(robot, settings.timestep_s, settings.friction)


_PLANTS: dict[str, Callable[[Robot, LimitCycleSettings], Plant]] = {"MuJoCo": _mujoco, "DART": _dart}
