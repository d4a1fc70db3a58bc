"""Figures measured on a rollout, each with name, unit and direction; cells measured in parallel processes."""

import itertools
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float

from pipeline.batch import ClipPool
from pipeline.quality.planar_motion import command_velocity
from pipeline.quality.sole import lowest_corner_slip, sole_motion
from pipeline.robot.legs import legs_of
from pipeline.simulation.record import Rollout
from pipeline.simulation.torque_envelope import TorqueEnvelope
from pipeline.validation.cells import Cell
from pipeline.validation.deployed import Deployed
from pipeline.validation.trial import Trial
from pipeline.validation.walk import Branches, Worlds, prefix_of

CLIP_HZ = 100.0
"""Rate at which slip and contacts are evaluated: that of the recorded forces."""
SATURATED = 0.999
"""Share of the torque envelope above which a joint counts as saturated."""


@dataclass(frozen=True, kw_only=True)
class Figure:
    """A figure of a cell."""

    name: str
    unit: str
    lower_is_better: bool
    definition: str


FIGURES = {
    each.name: each
    for each in (
        Figure(name="falls", unit="trials", lower_is_better=True, definition="root too low, or tilt > 60 deg"),
        Figure(name="survival", unit="share", lower_is_better=False, definition="trials that do not fall"),
        Figure(name="speed_error", unit="m/s", lower_is_better=True, definition="length of mean velocity less command"),
        Figure(name="yaw_rate_error", unit="rad/s", lower_is_better=True, definition="mean yaw rate less command"),
        Figure(name="power", unit="W", lower_is_better=True, definition="mean of sum |torque x joint speed|"),
        Figure(name="slip", unit="m/s", lower_is_better=True, definition="speed of the lowest sole corner in contact"),
        Figure(name="saturation", unit="%", lower_is_better=True, definition="leg joint samples at the envelope"),
        Figure(name="drift", unit="m", lower_is_better=True, definition="distance between first and last position"),
        Figure(name="steps", unit="steps", lower_is_better=True, definition="feet set down"),
        Figure(name="shape_distance", unit="of its size", lower_is_better=True, definition="between limit cycles"),
        Figure(name="period_difference", unit="share", lower_is_better=True, definition="of strides in two engines"),
        Figure(name="amplitude_difference", unit="share", lower_is_better=True, definition="hip or knee, two engines"),
    )
}

Numbers = dict[str, float]


def numbers_of(rollout: Rollout, trial: Trial, envelope: TorqueEnvelope) -> Numbers:
    """Figures of a rollout from `measure_s` to its end; after a fall only its time."""
    if rollout.fell_s is not None:
        return {"fell": 1.0, "fell_s": round(rollout.fell_s, 6)}
    measure_s = max(trial.measure_s - rollout.start_s, 0.0)
    clip = rollout.clip("trial", CLIP_HZ, measure_s)
    velocity = command_velocity(clip.root_pos_w, clip.root_quat_w, clip.fps)
    command = trial.command.last
    contacts = clip.contacts
    assert contacts is not None
    moved = clip.root_pos_w[-1, :2] - clip.root_pos_w[0, :2]
    numbers = {
        "fell": 0.0,
        "forward": velocity.forward_m_s,
        "lateral": velocity.lateral_m_s,
        "yaw_rate": velocity.yaw_rate_rad_s,
        "speed_error": np.hypot(velocity.forward_m_s - command.forward, velocity.lateral_m_s - command.lateral),
        "yaw_rate_error": abs(velocity.yaw_rate_rad_s - command.yaw_rate),
        "slip": lowest_corner_slip(sole_motion(clip, rollout.robot), contacts)[0],
        "drift": np.hypot(*moved),
        "steps": (contacts[1:] & ~contacts[:-1]).sum(),
        **_effort(rollout, measure_s, envelope),
    }
    return {name: float(value) for name, value in numbers.items()}


def _effort(rollout: Rollout, measure_s: float, envelope: TorqueEnvelope) -> Numbers:
    """Power of all joints and torque saturation of the leg joints."""
    taken = slice(round(measure_s / rollout.timestep_s), None)
    torque, speed = rollout.torque[taken], rollout.qvel[taken, 6:]
    saturated = at_envelope(torque, speed, envelope)[:, np.array(legs_of(rollout.robot).all)]
    return {"power": np.abs(torque * speed).sum(axis=1).mean(), "saturation": 100.0 * float(saturated.mean())}


def at_envelope(
    torque: Float[np.ndarray, "n j"], speed: Float[np.ndarray, "n j"], envelope: TorqueEnvelope
) -> Bool[np.ndarray, "n j"]:
    """Samples at which a joint's torque is at its limit for that speed; beyond the no-load speed both limits brake."""
    lower, upper = envelope.bounds(speed)
    rest = 1.0 - SATURATED
    return (torque >= upper - rest * np.abs(upper)) | (torque <= lower + rest * np.abs(lower))


def most_saturated(rollout: Rollout, measure_s: float, envelope: TorqueEnvelope) -> str:
    """The leg joint that is saturated most often from `measure_s` on."""
    taken = slice(round(measure_s / rollout.timestep_s), None)
    reached = at_envelope(rollout.torque[taken], rollout.qvel[taken, 6:], envelope).mean(axis=0)
    legs = np.array(legs_of(rollout.robot).all)
    return rollout.robot.joint_names[legs[int(np.argmax(reached[legs]))]]


CHUNK = 32
"""Trials per process call."""


@dataclass(frozen=True, kw_only=True)
class Measured:
    """A cell with the numbers of its trials, in order."""

    cell: Cell
    trials: tuple[Numbers, ...]

    @property
    def fallen(self) -> tuple[int, ...]:
        """Indices of the trials that fell."""
        return tuple(index for index, numbers in enumerate(self.trials) if numbers["fell"])

    def values(self, name: str) -> list[float]:
        """Values of a figure over the trials that have it."""
        return [numbers[name] for numbers in self.trials if name in numbers]

    def figure(self, name: str) -> float | None:
        """The cell's figure: count or share of all trials, or the worst trial; None if all trials fell."""
        if name == "falls":
            return float(len(self.fallen))
        if name == "survival":
            return 1.0 - len(self.fallen) / len(self.trials)
        values = self.values(name)
        if not values:
            return None
        return max(values) if FIGURES[name].lower_is_better else min(values)

    def spread(self, name: str) -> dict[str, float]:
        """Mean, standard deviation, minimum and maximum of a figure over the trials that have it."""
        values = self.values(name)
        if not values:
            return {}
        return {"mean": float(np.mean(values)), "std": float(np.std(values)), "min": min(values), "max": max(values)}


def measure(one: Deployed, cells: Sequence[Cell], pool: ClipPool | None = None) -> tuple[Measured, ...]:
    """Run all trials of all cells. The numbers do not depend on the distribution over processes."""
    jobs = [(number, place) for number, cell in enumerate(cells) for place in range(len(cell.trials))]
    trials = {(number, place): cells[number].trials[place] for number, place in jobs}
    # keep trials that share a prefix together: models are compiled and prefixes simulated once per process
    jobs.sort(key=lambda job: prefix_of(trials[job]))
    chunks = [jobs[first : first + CHUNK] for first in range(0, len(jobs), CHUNK)]
    calls = [(one, tuple(trials[job] for job in chunk)) for chunk in chunks]
    found = dict(zip(jobs, itertools.chain(*(pool or ClipPool()).map(measure_trials, calls)), strict=True))
    return tuple(
        Measured(cell=cell, trials=tuple(found[number, place] for place in range(len(cell.trials))))
        for number, cell in enumerate(cells)
    )


def measure_trials(one: Deployed, trials: Sequence[Trial]) -> list[Numbers]:
    """Numbers of each trial, computed in this process."""
    branches = Branches(Worlds(one))
    return [numbers_of(branches.walk(trial), trial, one.envelope) for trial in trials]
