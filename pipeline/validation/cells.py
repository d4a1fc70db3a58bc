"""The cells of the protocol: what is tried, how often, and which figures are judged."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

from pipeline.validation.trial import Conditions, Profile, Start, Trial, Wanted

TRACKING = ("falls", "speed_error", "yaw_rate_error", "power", "slip", "saturation")
STANDING = ("falls", "speed_error", "yaw_rate_error", "drift", "steps", "saturation")
STAYING_UP = ("falls",)
SURVIVING = ("survival",)

COMMAND_S, MEASURE_S = 10.0, 4.0
"""Length of a command's trial and from when on it is measured [s]: the last 6 s."""


@dataclass(frozen=True, kw_only=True)
class Cell:
    """Trials that are judged together."""

    name: str
    group: str
    figures: tuple[str, ...]
    """Names of the figures that are judged, of `figures.FIGURES`."""
    trials: tuple[Trial, ...]


def command_cells(seeds: Iterable[int]) -> tuple[Cell, ...]:
    """The 16 commands of the published sweep, each slewed from standing."""
    seeds = tuple(seeds)
    forward = [Wanted(forward=value) for value in (-0.6, -0.3, 0.0, 0.3, 0.6, 1.0, 1.5, 2.0)]
    lateral = [Wanted(lateral=value) for value in (-0.6, -0.3, 0.3, 0.6)]
    turning = [Wanted(yaw_rate=value) for value in (-1.5, -1.0, 1.0, 1.5)]
    return tuple(_steady(name_of(wanted), "commands", wanted, seeds) for wanted in (*forward, *lateral, *turning))


def turning_cells(seeds: Iterable[int]) -> tuple[Cell, ...]:
    """Walking on a curve, both ways round: the heading goes through all directions."""
    seeds = tuple(seeds)
    wanted = [
        Wanted(forward=speed, yaw_rate=rate) for speed, rate in ((0.6, 0.8), (0.6, -0.8), (1.0, 0.5), (1.0, -0.5))
    ]
    return tuple(_steady(f"curve {name_of(each)}", "turning", each, seeds) for each in wanted)


def step_cells(seeds: Iterable[int]) -> tuple[Cell, ...]:
    """Commands that change at once."""
    seeds = tuple(seeds)
    jumps = {
        "step 0 to 1.0": (Wanted(forward=1.0),),
        "step 0 to 2.0": (Wanted(forward=2.0),),
        "step 0 to yaw +1": (Wanted(yaw_rate=1.0),),
        "step 0 to yaw -1": (Wanted(yaw_rate=-1.0),),
        "step 0.6 to 1.5": (Wanted(forward=0.6), Wanted(start_s=3.0, forward=1.5)),
        "step 1.5 to 0.6": (Wanted(forward=1.5), Wanted(start_s=4.0, forward=0.6)),
        "step 1.0 to stand": (Wanted(forward=1.0), Wanted(start_s=4.0)),
        "step yaw +1 to yaw -1": (Wanted(yaw_rate=1.0), Wanted(start_s=3.0, yaw_rate=-1.0)),
        "step left to right": (Wanted(lateral=0.6), Wanted(start_s=3.0, lateral=-0.6)),
    }
    return tuple(
        _cell(name, "steps", wanted, seeds, seconds=wanted[-1].start_s + 7.0, slew=None)
        for name, wanted in jumps.items()
    )


def switch_cells(seeds: Iterable[int]) -> tuple[Cell, ...]:
    """Walking, running, standing and back again, by commands that are slewed."""
    seeds = tuple(seeds)
    walk, run, stand = {"forward": 0.6}, {"forward": 2.0}, {}
    courses = {
        "walk run stand": (walk, run, stand),
        "run walk": (run, walk),
        "walk stand walk": (walk, stand, walk),
        "forward back": ({"forward": 0.8}, {"forward": -0.6}),
        "forward left turn": ({"forward": 0.8}, {"lateral": 0.6}, {"yaw_rate": 1.0}),
    }
    return tuple(
        _cell(
            f"switch {name}",
            "switches",
            tuple(Wanted(start_s=4.0 * place, **each) for place, each in enumerate(course)),
            seeds,
            seconds=4.0 * (len(course) - 1) + 7.0,
        )
        for name, course in courses.items()
    )


def start_cells(count: int) -> tuple[Cell, ...]:
    """Starts away from the default pose, as far as a random push or a person's hands bring it."""
    wide = Start(joint_pos=0.15, joint_vel=1.0, lin_vel=0.3, ang_vel=0.5, tilt=0.1)
    pairs = (("standing", Wanted()), ("walking", Wanted(forward=0.6)))
    return tuple(
        Cell(
            name=f"start perturbed {name}",
            group="starts",
            figures=SURVIVING,
            trials=tuple(
                Trial(seed=seed, command=Profile(wanted=(wanted,)), seconds=5.0, measure_s=3.0, start=wide)
                for seed in range(1, count + 1)
            ),
        )
        for name, wanted in pairs
    )


def name_of(wanted: Wanted) -> str:
    """As `vx +0.6`, with the parts that are not zero; `stand` where all are."""
    parts = {"vx": wanted.forward, "vy": wanted.lateral, "yaw": wanted.yaw_rate}
    return " ".join(f"{name} {value:+.1f}" for name, value in parts.items() if value) or "stand"


def steady_cell(name: str, group: str, wanted: Wanted, seeds: Iterable[int], conditions: Conditions) -> Cell:
    """One command kept under conditions of one's choice."""
    return _steady(name, group, wanted, tuple(seeds), conditions)


def _steady(
    name: str, group: str, wanted: Wanted, seeds: tuple[int, ...], conditions: Conditions | None = None
) -> Cell:
    return _cell(name, group, (wanted,), seeds, seconds=COMMAND_S, measure_s=MEASURE_S, conditions=conditions)


def _cell(
    name: str,
    group: str,
    wanted: tuple[Wanted, ...],
    seeds: tuple[int, ...],
    *,
    seconds: float,
    measure_s: float | None = None,
    slew: float | None = 1.0,
    conditions: Conditions | None = None,
) -> Cell:
    """Measured is the last command, from 3 s after it is given where nothing else is said."""
    stands = wanted[-1].goal == (0.0, 0.0, 0.0)
    return Cell(
        name=name,
        group=group,
        figures=STANDING if stands else TRACKING,
        trials=tuple(
            Trial(
                seed=seed,
                command=Profile(wanted=wanted, slew=slew),
                seconds=seconds,
                measure_s=wanted[-1].start_s + 3.0 if measure_s is None else measure_s,
                conditions=conditions or Conditions(),
            )
            for seed in seeds
        ),
    )
