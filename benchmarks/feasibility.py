"""Both error rates of the feasibility stage: known-good motion accepted, planted infeasibilities found.

    python benchmarks/feasibility.py [--json] [--drawn 80] [--seed 1] [--jobs 2] [POLICIES]

Known good are rollouts of a published walking policy of the T1 in simulation (POLICIES holds `t1_walk.npz`; by
default `../shared/policies` beside the checkout): commands on the axes of the command ranges and others drawn from the
whole box, judged with their true contacts, without contacts, and cut into windows of half a second. Into the same
rollouts each fault is planted once. Then torque by inverse dynamics is held against the simulation's motors.
"""

from __future__ import annotations

import argparse
import dataclasses
import sys
from collections import Counter, defaultdict
from dataclasses import dataclass, field
from pathlib import Path

import joblib
import numpy as np

ROOT = Path(__file__).resolve().parent.parent
sys.path.insert(0, str(ROOT))

from benchmarks.feasibility_torque import torque_bars  # noqa: E402
from benchmarks.report import Bar, machine, report  # noqa: E402
from pipeline.clips.robot_clip import RobotClip  # noqa: E402
from pipeline.feasibility import FeasibilitySettings, assess, process  # noqa: E402
from pipeline.feasibility.motion import motion_of  # noqa: E402
from pipeline.files import settings  # noqa: E402
from pipeline.robot import Robot, load_robot  # noqa: E402
from pipeline.simulation.rollout import Rollout  # noqa: E402
from tests.factories.policy_walks import policy_walk  # noqa: E402
from tests.factories.robot_clips import standing  # noqa: E402
from tests.factories.robot_faults import FAULTS, weakened_robot  # noqa: E402

Command = tuple[float, float, float]

SEED = 1
"""Of the draw that thresholds were set with; `--seed` draws other commands and faults."""
SECONDS, START_S = 7.0, 1.0
"""Length of a rollout and what is left out of its start, where it sets off [s]."""
WINDOW_S = 0.5
"""Short windows: the shortest that the selection makes [s]."""
RUN_SPEED = 1.3
"""Playing a walk twice as fast is a fault from this speed on [m/s]: half of it can be walked at twice the speed."""
STILL = 0.3
"""Slower commands [m/s, rad/s] get no faults: exchanged legs of a robot that stands move nothing by 5 cm."""
LEAST = 98.0
"""Per cent of either kind that have to be judged rightly."""
WEAK = "1.2 x torque for .2 s"


@dataclass
class Judged:
    """What was said of one rollout and of the faults planted into it."""

    fell: bool = False
    labelled: tuple[bool, float] = (False, 0.0)
    """Accepted whole, and share of its seconds accepted."""
    unlabelled: bool = False
    windows: list[bool] = field(default_factory=list)
    broken: set[str] = field(default_factory=set)
    """Criteria that the rollout as a whole breaks."""
    found: dict[str, set[str]] = field(default_factory=dict)
    """Fault -> criteria that say so; none if it was not found."""


def main() -> int:
    arguments = _arguments()
    if not (arguments.policies / "t1_walk.npz").is_file():
        print(
            f"{arguments.policies}: holds no 't1_walk.npz'. Known-good motion is made by rolling out a published "
            "walking policy, which is not part of the project. Name the folder that has it: "
            "python benchmarks/feasibility.py FOLDER",
            file=sys.stderr,
        )
        return 2
    limits = settings.read(ROOT / "data" / "feasibility.yaml", FeasibilitySettings)
    jobs = [
        joblib.delayed(judge)(arguments.policies, command, (arguments.seed, number), limits)
        for number, command in enumerate(commands(arguments.drawn, arguments.seed))
    ]
    judged = [one for one in joblib.Parallel(n_jobs=arguments.jobs)(jobs) if one is not None]
    torque = torque_bars(arguments.policies, load_robot("t1"))
    bars = [*known_good_bars(judged, criteria(limits)), *fault_bars(judged), *torque]
    return 0 if report(bars, machine=machine(), json=arguments.json) else 1


def commands(drawn: int, seed: int = SEED) -> list[Command]:
    """Commands on the axes of the command ranges, and `drawn` more from the whole box."""
    axes: list[Command] = [(float(forward), 0.0, 0.0) for forward in np.arange(-0.6, 2.01, 0.2)]
    axes += [(0.0, lateral, 0.0) for lateral in (-0.6, -0.45, 0.45, 0.6)]
    axes += [(0.0, 0.0, yaw) for yaw in (-1.5, -1.0, -0.5, 0.5, 1.0, 1.5)]
    rng = np.random.default_rng(seed)
    low, high = np.array([-0.6, -0.6, -1.5]), np.array([2.0, 0.6, 1.5])
    return axes + [tuple(rng.uniform(low, high).tolist()) for _ in range(drawn)]


def criteria(limits: FeasibilitySettings) -> list[str]:
    """Codes of all criteria, in their order."""
    robot = load_robot("t1")
    verdicts = assess(motion_of(standing(robot), robot, limits), limits).verdicts
    return [verdict.code for verdict in verdicts]


def judge(policies: Path, command: Command, seed: tuple[int, int], limits: FeasibilitySettings) -> Judged:
    """A rollout by a command, as it is and with each fault."""
    robot, rng = load_robot("t1"), np.random.default_rng(seed)
    walk = policy_walk(policies, robot, command, SECONDS)
    if walk.fell:
        return Judged(fell=True)
    clip = walk.clip("walk", start_s=START_S)
    bare = dataclasses.replace(clip, contacts=None)
    still = np.abs(command).max() < STILL
    width = round(WINDOW_S * clip.fps)
    windows = [clip.cut(start, start + width, "window") for start in range(0, clip.frame_count - width + 1, width)]
    return Judged(
        labelled=_accepted(clip, robot, limits),
        unlabelled=_accepted(bare, robot, limits)[0],
        windows=[_accepted(window, robot, limits)[0] for window in windows],
        broken={verdict.code for verdict in assess(motion_of(clip, robot, limits), limits).broken},
        found={} if still else {**_faults(clip, command, robot, rng, limits), **_weak(walk, rng, limits)},
    )


def _accepted(clip: RobotClip, robot: Robot, limits: FeasibilitySettings) -> tuple[bool, float]:
    pieces = process(clip, {}, settings=limits, robot=robot).pieces
    share = sum(piece.clip.frame_count for piece in pieces) / clip.frame_count
    return share == 1.0 and len(pieces) == 1, share


def _faults(
    clip: RobotClip, command: Command, robot: Robot, rng: np.random.Generator, limits: FeasibilitySettings
) -> dict[str, set[str]]:
    found = {}
    for name, plant in FAULTS.items():
        if name == "double speed" and command[0] < RUN_SPEED:
            continue
        reasons = process(plant(clip, robot, rng), {}, settings=limits, robot=robot).reasons
        found[name] = {reason.code for reason in reasons}
    return found


def _weak(walk: Rollout, rng: np.random.Generator, limits: FeasibilitySettings) -> dict[str, set[str]]:
    """The rollout judged for a robot with a motor too weak for it; only torque criteria count."""
    robot = weakened_robot(walk, START_S, rng)
    if robot is None:
        return {}
    reasons = process(walk.clip("walk", start_s=START_S), {}, settings=limits, robot=robot).reasons
    return {WEAK: {reason.code for reason in reasons if reason.code.startswith("torque_over")}}


def known_good_bars(judged: list[Judged], codes: list[str]) -> list[Bar]:
    """Known-good motion: accepted, and how many hold each criterion; who fell did not walk, and is told."""
    fallen, judged = sum(one.fell for one in judged), [one for one in judged if not one.fell]
    windows = [held for one in judged for held in one.windows]
    bars = [
        Bar(name="known-good rollouts", value=len(judged)),
        Bar(name="rollouts that fell, left out", value=fallen),
        _percent("known good: seconds accepted", [one.labelled[1] for one in judged], LEAST),
        _percent("known good: accepted whole", [one.labelled[0] for one in judged], LEAST),
        _percent("known good: accepted whole, contacts not labelled", [one.unlabelled for one in judged]),
        _percent(f"known good: windows of {WINDOW_S:g} s accepted", windows, LEAST),
    ]
    return bars + [_percent(f"known good: hold {code}", [code not in one.broken for one in judged]) for code in codes]


def fault_bars(judged: list[Judged]) -> list[Bar]:
    """Planted faults: found at all, and by which criterion."""
    found: dict[str, list[set[str]]] = defaultdict(list)
    for one in judged:
        for fault, codes in one.found.items():
            found[fault].append(codes)
    bars = []
    for fault, each in found.items():
        bars.append(_percent(f"found: {fault} ({len(each)} planted)", [bool(codes) for codes in each], LEAST))
        counts = Counter(code for codes in each for code in codes if code != "too_short")
        for code, count in counts.most_common():
            bars.append(Bar(name=f"    by {code}", value=100.0 * count / len(each), unit="%"))
    return bars


def _percent(name: str, values: list, least: float | None = None) -> Bar:
    value = 100.0 * float(np.mean(values)) if values else float("nan")
    return Bar(name=name, value=value, unit="%", sense=">=" if least is not None else "", bound=least)


def _arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("policies", nargs="?", type=Path, default=ROOT.parent / "shared" / "policies")
    parser.add_argument("--drawn", type=int, default=80, help="commands drawn from the whole box besides those on axes")
    parser.add_argument("--seed", type=int, default=SEED, help="of the drawn commands and of the faults")
    parser.add_argument("--jobs", type=int, default=2, help="processes")
    parser.add_argument("--json", action="store_true", help="one JSON object instead of a table")
    return parser.parse_args()


if __name__ == "__main__":
    raise SystemExit(main())
