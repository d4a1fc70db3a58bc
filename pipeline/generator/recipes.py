"""The sound motions that ship with the project."""

from __future__ import annotations

from pipeline.generator.command import Level, Recipe


def _forward(*speeds: float, hold_s: float) -> tuple[Level, ...]:
    return tuple(Level(hold_s=hold_s, forward=speed) for speed in speeds)


def _lateral(*speeds: float, hold_s: float) -> tuple[Level, ...]:
    return tuple(Level(hold_s=hold_s, lateral=speed) for speed in speeds)


def _turning(*rates: float, hold_s: float) -> tuple[Level, ...]:
    return tuple(Level(hold_s=hold_s, yaw_rate=rate) for rate in rates)


def _still(hold_s: float) -> Level:
    return Level(hold_s=hold_s)


_ALL = (
    Recipe(name="stand", what="Stands, swaying a little.", levels=(_still(8.0),), seed=1),
    Recipe(
        name="walk_slow",
        what="From standing to slow walking: .3, .4 and .55 m/s.",
        levels=(_still(1.0), *_forward(0.3, 0.4, 0.55, hold_s=4.0)),
        seed=2,
    ),
    Recipe(
        name="walk",
        what="Walks straight ahead at .7, .95 and 1.2 m/s.",
        levels=_forward(0.7, 0.95, 1.2, hold_s=4.0),
        seed=3,
    ),
    Recipe(
        name="walk_fast",
        what="Walks fast straight ahead at 1.4, 1.7 and 1.97 m/s.",
        levels=_forward(1.4, 1.7, 1.97, hold_s=4.0),
        seed=4,
    ),
    Recipe(
        name="run_easy",
        what="Runs easily at 2.08, 2.36 and 2.64 m/s.",
        levels=_forward(2.08, 2.36, 2.64, hold_s=4.0),
        seed=5,
        gait="run",
    ),
    Recipe(
        name="run_fast",
        what="Runs at 2.92, 3.2 and 3.5 m/s.",
        levels=_forward(2.92, 3.2, 3.5, hold_s=4.0),
        seed=6,
        gait="run",
    ),
    Recipe(
        name="back",
        what="From standing to walking backwards: .3, .6, .85 and 1.06 m/s.",
        levels=(_still(1.0), *_forward(-0.3, -0.6, -0.85, -1.06, hold_s=4.0)),
        seed=7,
    ),
    Recipe(
        name="side_left",
        what="From standing to steps to the left: .35, .7 and 1.06 m/s.",
        levels=(_still(1.0), *_lateral(0.35, 0.7, 1.06, hold_s=4.0)),
        seed=8,
    ),
    Recipe(
        name="side_right",
        what="From standing to steps to the right: .35, .7 and 1.06 m/s.",
        levels=(_still(1.0), *_lateral(-0.35, -0.7, -1.06, hold_s=4.0)),
        seed=9,
    ),
    Recipe(
        name="turn_left",
        what="Turns in place to the left at .65, 1.1 and 1.6 rad/s, then stops.",
        levels=(_still(1.0), *_turning(0.65, 1.1, 1.6, hold_s=4.0), _still(1.5)),
        seed=10,
    ),
    Recipe(
        name="turn_right",
        what="Turns in place to the right at .65, 1.1 and 1.6 rad/s, then stops.",
        levels=(_still(1.0), *_turning(-0.65, -1.1, -1.6, hold_s=4.0), _still(1.5)),
        seed=11,
    ),
    Recipe(
        name="curve_left",
        what="Walks curves to the left, wide and fast, then tight and slow.",
        levels=(Level(hold_s=4.5, forward=1.2, yaw_rate=0.5), Level(hold_s=4.5, forward=0.8, yaw_rate=0.8)),
        seed=12,
    ),
    Recipe(
        name="curve_right",
        what="Walks curves to the right, wide and fast, then tight and slow.",
        levels=(Level(hold_s=4.5, forward=1.2, yaw_rate=-0.5), Level(hold_s=4.5, forward=0.8, yaw_rate=-0.8)),
        seed=13,
    ),
    Recipe(
        name="start_stop",
        what="Stands, walks at 1.0 m/s, stops, walks at 1.5 m/s, stops.",
        levels=(_still(1.5), Level(hold_s=2.5, forward=1.0), _still(2.2), Level(hold_s=2.5, forward=1.5), _still(2.2)),
        seed=14,
        ramp_s=1.2,
    ),
)

RECIPES: dict[str, Recipe] = {recipe.name: recipe for recipe in _ALL}
