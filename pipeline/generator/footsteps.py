"""Times and positions of footholds. A foothold is beside the path at the middle of its stance, so
that the feet keep exactly the commanded speed."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from pipeline import time_series
from pipeline.generator import gait
from pipeline.generator.command import GRID_HZ, Commands, Recipe, smoothstep

TOE_OUT = np.deg2rad(4.0)
"""Feet point outwards when walking [rad]; people: 5 to 7 degrees (Murray 1967)."""
WIDTH_JITTER = 0.003
"""Spread of the step width from step to step [m]; people: .02 m (Owings and Grabiner 2004)."""
LANDING_SHARE = 0.25
"""Part of a stance from touch-down to the flat foot [-]; foot flat at 12 of 62 % of the stride (Perry 2010), here a
little later for a softer touch."""
LEAVING_SHARE = {gait.WALK: 0.55, gait.RUN: 0.7}
"""Part of a stance from the first rise of the heel to lift-off [-]; heel off at 31 of 62 % of a stride (Perry 2010)."""
EASE_S = 0.6
"""Time over which sway and swing grow at a start and fade before a stop [s]."""


@dataclass(frozen=True, kw_only=True)
class Stance:
    """One foot on the ground. World frame, SI."""

    start_s: float
    """Touch-down; -inf for a clip that begins standing."""
    stop_s: float
    """Lift-off; inf for one that ends standing."""
    x: float
    y: float
    """Middle of the foot."""
    yaw: float
    landing_pitch: float
    """Pitch at touch-down, heel up positive [rad]."""
    leaving_pitch: float
    """Pitch at lift-off, heel up positive [rad]."""
    landing_s: float
    """From touch-down to flat."""
    leaving_s: float
    """From flat to lift-off."""


@dataclass(frozen=True, kw_only=True)
class Stride:
    """The rhythm of the steps at `GRID_HZ`."""

    phase: Float[np.ndarray, " n"]
    """Number of strides: the left foot lands at integers, the right one in between. Constant while standing."""
    duty: Float[np.ndarray, " n"]
    """Share of the stride in which a foot is on the ground."""
    activity: Float[np.ndarray, " n"]
    """0 standing, 1 stepping."""
    stances: tuple[tuple[Stance, ...], tuple[Stance, ...]]
    """Of the left foot and of the right one, in order."""

    def wave(self, per_stride: int = 1, from_midstance: bool = False) -> np.ndarray:
        """Cosine of the stride (n,), 1 as the left foot lands or is in the middle of its stance."""
        shift = self.duty / 2.0 if from_midstance else 0.0
        return np.cos(2.0 * np.pi * per_stride * (self.phase - shift))


@dataclass(frozen=True, kw_only=True)
class _Figures:
    """Figures of gait at `GRID_HZ` for the commanded speeds, each (n,)."""

    rate_hz: np.ndarray
    """Stride rate [Hz]."""
    duty: np.ndarray
    width: np.ndarray
    """[m]"""
    landing_pitch: np.ndarray
    """[rad]"""
    leaving_pitch: np.ndarray
    """[rad]"""


def plan_steps(recipe: Recipe, commands: Commands) -> Stride:
    """Footsteps along the path. Raises ValueError if a recipe stands in a run or continues before a stop ends."""
    if recipe.gait == gait.RUN and not commands.moving.all():
        raise ValueError(f"recipe '{recipe.name}': a run can't stand still.")
    command = (commands.forward, commands.lateral, commands.yaw_rate)
    figures = _Figures(
        rate_hz=gait.step_rate(recipe.gait, *command) / 2.0,
        duty=gait.duty(recipe.gait, *command),
        width=gait.step_width(recipe.gait, *command),
        landing_pitch=gait.landing_pitch(recipe.gait, commands.forward),
        leaving_pitch=gait.leaving_pitch(recipe.gait, commands.forward),
    )
    phase, activity = _phase(recipe, commands, figures)
    rng = np.random.default_rng(recipe.seed)
    left = _stances(recipe, commands, figures, phase, 0.0, rng)
    right = _stances(recipe, commands, figures, phase, -0.5, rng)
    return Stride(phase=phase, duty=figures.duty, activity=activity, stances=(left, right))


def _phase(recipe: Recipe, commands: Commands, figures: _Figures) -> tuple[np.ndarray, np.ndarray]:
    """Phase and activity. Stepping begins with the command and ends as both feet stand at the end of the path."""
    rate_hz, count = figures.rate_hz, len(commands.times)
    phase, activity = np.full(count, _first_phase(commands)), np.zeros(count)
    reached = 0
    for start, stop in time_series.runs(commands.moving):
        if start < reached:
            raise ValueError(f"recipe '{recipe.name}': moves on before its last stop is over, hold it longer.")
        steps = 0.5 * (rate_hz[start + 1 :] + rate_hz[start:-1]) / GRID_HZ
        running = phase[start] + np.concatenate([[0.0], np.cumsum(steps)])
        reached = count if stop == count else start + _last_landing(running, figures, start, stop)
        phase[start:reached] = running[: reached - start]
        phase[reached:] = np.round(2.0 * running[reached - start]) / 2.0 if reached < count else 0.0
        rise = np.ones(count) if start == 0 else smoothstep((np.arange(count) - start) / (EASE_S * GRID_HZ))
        fall = np.ones(count) if reached == count else smoothstep((reached - np.arange(count)) / (EASE_S * GRID_HZ))
        activity += rise * fall
    return phase, activity


def _first_phase(commands: Commands) -> float:
    """Phase of the initial stand: the foot on the side of a lateral or turning command steps first, else the right."""
    sideways = (commands.lateral + commands.yaw_rate)[commands.moving]
    return 0.5 if len(sideways) and sideways[0] > 0.0 else 0.0


def _last_landing(phase: np.ndarray, figures: _Figures, start: int, stop: int) -> int:
    """Steps on the grid from `start` to the touch-down at which both feet stand where the path ends (index `stop`)."""
    landings = np.flatnonzero(np.floor(2.0 * phase[1:]) > np.floor(2.0 * phase[:-1])) + 1
    length_s = figures.duty[start + landings] / figures.rate_hz[start + landings]
    settled = np.flatnonzero(start + landings + 0.5 * length_s * GRID_HZ >= stop)
    return int(landings[settled[0] + 1])


def _stances(
    recipe: Recipe, commands: Commands, figures: _Figures, phase: np.ndarray, shift: float, rng: np.random.Generator
) -> tuple[Stance, ...]:
    """Stances of the foot that lands `shift` strides after the left one; a wait at its start or end does not count."""
    side = 1.0 if shift == 0.0 else -1.0
    stances = []
    for landing in np.arange(np.floor(phase[0]) + shift, phase[-1] + 1.0, 1.0):
        start_s = _time_of(commands, phase, figures.rate_hz, float(landing))
        if start_s == np.inf:
            break
        duty = commands.held(figures.duty, start_s)
        stop_s = _time_of(commands, phase, figures.rate_hz, float(landing) + duty)
        if stop_s == -np.inf:
            continue
        length_s = duty / commands.held(figures.rate_hz, start_s)
        middle_s = float(commands.times[0]) if start_s == -np.inf else start_s + 0.5 * length_s
        jitter = float(np.clip(rng.normal(0.0, WIDTH_JITTER), -2.0 * WIDTH_JITTER, 2.0 * WIDTH_JITTER))
        beside = side * (commands.held(figures.width, middle_s) + jitter) / 2.0
        heading = commands.at(commands.heading, middle_s)
        stances.append(
            Stance(
                start_s=start_s,
                stop_s=stop_s,
                x=commands.at(commands.path_w[:, 0], middle_s) - float(np.sin(heading)) * beside,
                y=commands.at(commands.path_w[:, 1], middle_s) + float(np.cos(heading)) * beside,
                yaw=heading + (side * TOE_OUT if recipe.gait == gait.WALK else 0.0),
                landing_pitch=commands.held(figures.landing_pitch, start_s),
                leaving_pitch=commands.held(figures.leaving_pitch, stop_s),
                landing_s=LANDING_SHARE * length_s,
                leaving_s=LEAVING_SHARE[recipe.gait] * duty / commands.held(figures.rate_hz, stop_s),
            )
        )
    return tuple(stances)


def _time_of(commands: Commands, phase: np.ndarray, rate_hz: np.ndarray, value: float) -> float:
    """Time at which the phase first reaches a value [s]; -inf if it is there from the start, inf if never."""
    times = commands.times
    if value <= phase[0]:
        return float(times[0] + (value - phase[0]) / rate_hz[0]) if phase[1] > phase[0] else -np.inf
    if value > phase[-1]:
        return float(times[-1] + (value - phase[-1]) / rate_hz[-1]) if phase[-1] > phase[-2] else np.inf
    high = int(np.searchsorted(phase, value, side="left"))
    fraction = (value - phase[high - 1]) / (phase[high] - phase[high - 1])
    return float(times[high - 1] + fraction / GRID_HZ)
