"""Weak motors in references: motion that contact forces do not explain, as retargeting makes it.

    python benchmarks/feasibility_references.py [PROJECT] [--seeds 31 32 33] [--clips 60] [--json]

PROJECT is a checkout whose `expert_db` has been made (by default this one); references are clips of its
`feasible_motions`. Of each clip drawn, up to four seconds are followed in MuJoCo (benchmarks/feasibility_tracker.py).
Into it a motor is planted that is too weak: one of the standing leg, whose limit is 1/1.2 of the least torque that it
gave over .2 s. The robot with it is held to the help at its root that the whole one got. The plant matters if some body
then goes 5 cm or more from where it was. So neither what is planted nor whether it matters is told by the criteria.
Beside it stands, to tell the tracker's own unrest, a motor whose limit is .98 of the most that it gave.
"""

from __future__ import annotations

import argparse
import dataclasses
import sys
from collections import Counter
from dataclasses import dataclass
from pathlib import Path

import mujoco
import numpy as np

ROOT = Path(__file__).resolve().parent.parent
sys.path.insert(0, str(ROOT))

from benchmarks.feasibility_rates import LEAST, rate  # noqa: E402
from benchmarks.feasibility_tracker import STEP_S, Followed, follow, moved  # noqa: E402
from benchmarks.report import Bar, machine, report  # noqa: E402
from pipeline import time_series  # noqa: E402
from pipeline.batch import Store  # noqa: E402
from pipeline.clips.robot_clip import RobotClip  # noqa: E402
from pipeline.errors import PipelineError  # noqa: E402
from pipeline.feasibility import FeasibilitySettings  # noqa: E402
from pipeline.feasibility.motion import Motion, motion_of  # noqa: E402
from pipeline.feasibility.torque_criteria import Dynamics, dynamics, torque_over_limit  # noqa: E402
from pipeline.files import settings  # noqa: E402
from pipeline.robot import Robot, load_robot  # noqa: E402
from pipeline.simulation.contact_wrench import GRAVITY  # noqa: E402

NEED, NEED_S = 1.2, 0.2
"""Torque over the limit of a motor that is planted, and for how long [s]."""
SHY = 0.98
"""Limit over the most torque of the motor that hardly is too weak."""
LEAST_NM = 4.0
"""A motor that gives less is not planted."""
MATTERS_M, LOST_M = 0.05, 0.25
"""Way of a body of a plant that matters; one that is further off the reference was not followed [m]."""
LONGEST_S = 4.0
JOINTS = ("Hip_Roll", "Hip_Pitch", "Knee_Pitch", "Ankle_Pitch")
FIGURES = frozenset({"reference_need_run_s", "reference_lasting_need"})
"""Criteria that only references are held to."""


@dataclass(frozen=True, kw_only=True)
class Plant:
    """A weak motor in a reference and what was said of it."""

    clip: str
    joint: str
    limit: float
    """[N m]"""
    moved: float
    """Way of the body that goes furthest [m]; infinite if the robot fell."""
    broken: frozenset[str]
    """Criteria of torque and balance that break with it."""
    added: tuple[float, float] = (0.0, 0.0)
    """How much further the admissible forces have to go than for the whole robot; see `shift`."""


@dataclass
class Found:
    """What came of the references of one seed."""

    references: int = 0
    lost: int = 0
    still: int = 0
    """No motor of a standing leg gave enough for long enough."""
    plants: list[Plant] = dataclasses.field(default_factory=list)
    shy: list[float] = dataclasses.field(default_factory=list)
    """Way of the body that goes furthest where a motor hardly is too weak [m]."""
    shifts: list[tuple[float, float]] = dataclasses.field(default_factory=list)
    """Of whole robots; see `shift`."""
    asked_too_much: int = 0
    """References whose forces that leave least at the root are over a torque limit."""


def main() -> int:
    mujoco.set_mju_user_warning(lambda _: None)  # of robots that fall, as they should
    arguments = _arguments()
    limits = settings.read(ROOT / "data" / "feasibility.yaml", FeasibilitySettings)
    store = Store(root=arguments.project / "data" / "store")
    try:
        manifest = store.load("feasible_motions")
    except PipelineError as error:
        print(error, file=sys.stderr)
        return 2
    entries = [entry for entry in manifest.entries if not entry.numbers["dynamic"]]
    every, held = [], True
    bars: list[Bar] = []
    for seed in arguments.seeds:
        rng = np.random.default_rng(seed)
        drawn = rng.permutation(len(entries))[: arguments.clips]
        found = Found()
        for index in drawn:
            clip = store.get_clip(entries[index].blob, entries[index].clip)
            assert isinstance(clip, RobotClip)
            _plant_into(clip, limits, rng, found)
        every.append(found)
        bars += [dataclasses.replace(bar, name=f"seed {seed}: {bar.name}") for bar in bars_of([found])]
        if not arguments.json:
            print(f"\nseed {seed}", flush=True)
            held &= report(bars_of([found]), machine=machine(), json=False)
    together = bars_of(every)
    if arguments.json:
        return 0 if report([*bars, *together], machine=machine(), json=True) else 1
    print(f"\nseeds {' '.join(map(str, arguments.seeds))} together", flush=True)
    return 0 if report(together, machine=machine(), json=False) and held else 1


def _plant_into(clip: RobotClip, limits: FeasibilitySettings, rng: np.random.Generator, found: Found) -> None:
    """Follow a part of a clip, and again with two weak motors and one that hardly is."""
    robot = load_robot("t1")
    motion = _part(motion_of(clip, robot, limits), limits, rng)
    own = dynamics(motion, limits.torque)
    if not all(verdict.holds for verdict in own.verdicts):
        return
    found.references += 1
    found.shifts.append(shift(own, robot))
    asked = torque_over_limit(motion, own.root_first.joint_torque, limits.torque)
    found.asked_too_much += not all(verdict.holds for verdict in asked)
    whole = follow(motion, limits.torque)
    if moved(robot, whole.qpos, whole.reference_qpos).max() > LOST_M:
        found.lost += 1
        return
    needs = standing_needs(whole, robot)
    if not needs:
        found.still += 1
        return
    for _ in range(2):
        joint, least = needs[int(rng.integers(len(needs)))]
        weak = dataclasses.replace(motion, robot=weakened(robot, joint, least / NEED))
        with_it = dynamics(weak, limits.torque)
        broken = frozenset(verdict.code for verdict in with_it.verdicts if not verdict.holds)
        force, lever = np.subtract(shift(with_it, robot), found.shifts[-1])
        way = moved(robot, follow(weak, limits.torque, held=whole).qpos, whole.qpos).max()
        name, limit = robot.joint_names[joint], float(least / NEED)
        added = (float(force), float(lever))
        plant = Plant(clip=clip.name, joint=name, limit=limit, moved=float(way), broken=broken, added=added)
        found.plants.append(plant)
    joint = needs[int(rng.integers(len(needs)))][0]
    most = SHY * float(np.abs(whole.torque[:, joint]).max())
    shy = dataclasses.replace(motion, robot=weakened(robot, joint, most))
    found.shy.append(float(moved(robot, follow(shy, limits.torque, held=whole).qpos, whole.qpos).max()))


def shift(found: Dynamics, robot: Robot) -> tuple[float, float]:
    """How far the forces that keep the torques within their limits are from those that leave least at the root: means
    over the clip of force over weight and of the lever [m] by which the centre of pressure has to be elsewhere."""
    away = (found.judged.residual_w - found.root_first.residual_w) / (robot.total_mass * GRAVITY)
    force, lever = np.linalg.norm(away[:, :3], axis=1), np.linalg.norm(away[:, 3:5], axis=1)
    return float(force.mean()), float(lever.mean())


def _part(motion: Motion, limits: FeasibilitySettings, rng: np.random.Generator) -> Motion:
    """Not more than `LONGEST_S` of a motion, from anywhere in it."""
    longest, count = round(LONGEST_S * motion.clip.fps), motion.clip.frame_count
    if count <= longest:
        return motion
    start = int(rng.integers(count - longest))
    return motion.cut(start, start + longest, limits)


def standing_needs(whole: Followed, robot: Robot) -> list[tuple[int, float]]:
    """Motors of legs that stand alone, and the least that they gave over each `NEED_S` [N m]."""
    torque, width = np.abs(whole.torque), round(NEED_S / STEP_S)
    found = []
    for side, prefix in enumerate(("Left", "Right")):
        for start, stop in time_series.runs(whole.contacts[:, side] & ~whole.contacts[:, 1 - side]):
            for joint in (robot.joint(f"{prefix}_{name}") for name in JOINTS):
                least = (float(torque[first : first + width, joint].min()) for first in range(start, stop - width, 4))
                found += [(joint, each) for each in least if each > LEAST_NM]
    return found


def weakened(robot: Robot, joint: int, limit: float) -> Robot:
    """The robot with another torque limit [N m] of one joint, which is no larger than its own."""
    limits = robot.torque_limit.copy()
    limits[joint] = min(limit, limits[joint])
    return dataclasses.replace(robot, torque_limit=limits)


def bars_of(found: list[Found]) -> list[Bar]:
    """Rates over all seeds' references; plants that matter have to be found."""
    plants = [plant for one in found for plant in one.plants]
    matter = [plant for plant in plants if plant.moved >= MATTERS_M]
    shy = [way >= MATTERS_M for one in found for way in one.shy]
    bars = [
        Bar(name="references", value=sum(one.references for one in found)),
        Bar(name="not followed, left out", value=sum(one.lost for one in found)),
        Bar(name="no motor of a standing leg to weaken", value=sum(one.still for one in found)),
        rate("over a torque limit, the root first", _share(sum(one.asked_too_much for one in found), found)),
        *_shift_bars("limits first, another force", [each for one in found for each in one.shifts]),
        rate(f"a limit of {SHY:g} of the most: some body moved 5 cm", shy),
        Bar(name="weak motors planted", value=len(plants)),
        Bar(name="    that matter: some body moved 5 cm", value=len(matter)),
        _found("found, of those that matter", matter, LEAST),
        _found("found, of the others", [plant for plant in plants if plant.moved < MATTERS_M]),
    ]
    bars += _shift_bars("a weak motor that matters adds", [plant.added for plant in matter])
    counts = Counter(code for plant in matter for code in plant.broken)
    share = {code: 100.0 * count / len(matter) for code, count in counts.most_common()}
    bars += [Bar(name=f"    by {code}", value=value, unit="%") for code, value in share.items()]
    others = [dataclasses.replace(plant, broken=plant.broken - FIGURES) for plant in matter]
    bars.append(_found("    by anything but what references ask of the motors", others))
    return bars


def _share(count: int, found: list[Found]) -> list[bool]:
    return [True] * count + [False] * (sum(one.references for one in found) - count)


def _shift_bars(name: str, shifts: list[tuple[float, float]]) -> list[Bar]:
    """Median and most of both parts."""
    forces, levers = np.array(shifts or [(0.0, 0.0)]).T
    return [
        Bar(name=f"{name}, {kind}", value=float(value), unit=unit)
        for values, unit in ((forces, "of the weight"), (levers, "m"))
        for kind, value in (("median", np.median(values)), ("most", values.max()))
    ]


def _found(name: str, plants: list[Plant], least: float | None = None) -> Bar:
    return rate(name, [bool(plant.broken) for plant in plants], least)


def _arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("project", nargs="?", type=Path, default=ROOT, help="a checkout with an expert database")
    parser.add_argument("--seeds", type=int, nargs="+", default=[1], help="of the clips drawn and of the plants")
    parser.add_argument("--clips", type=int, default=60, help="references drawn, for each seed")
    parser.add_argument("--json", action="store_true", help="one JSON object instead of tables")
    return parser.parse_args()


if __name__ == "__main__":
    raise SystemExit(main())
