"""Validation in MuJoCo compared with published results, planted faults and time limits.

    python -m benchmarks.validation [--json] [--parts anchor faults repeats quick full] [--workers 2]
                                    [--robot data/adapted_robot/t1] [POLICY]

POLICY is the npz of the published walking policy of the T1 (by default `../shared/policies/t1_walk.npz` beside the
checkout). `anchor` repeats its published sweep on the published model (the manufacturer's armatures, ankles damped with
2 N m s/rad) and on the adapted robot; `faults` plants each fault in the quick suite; `repeats` compares two runs bit by
bit, with and without worker processes; `quick` and `full` measure the duration of the suites.
"""

from __future__ import annotations

import argparse
import dataclasses
import sys
import time
from pathlib import Path

import numpy as np

ROOT = Path(__file__).resolve().parent.parent
sys.path.insert(0, str(ROOT))

from benchmarks.report import Bar, machine, report  # noqa: E402
from pipeline.batch import ClipPool  # noqa: E402
from pipeline.deployment import load_policy  # noqa: E402
from pipeline.validation.bars import read_validation  # noqa: E402
from pipeline.validation.cells import Cell, command_cells  # noqa: E402
from pipeline.validation.deployed import Deployed, deployed, with_ankle_kd  # noqa: E402
from pipeline.validation.figures import Measured, measure  # noqa: E402
from pipeline.validation.suites import (  # noqa: E402
    FULL,
    JUDGED,
    QUICK,
    cells_of,
    named,
    push_cells,
)
from pipeline.validation.verdict import judge  # noqa: E402
from pipeline.validation.walk import Worlds, walk  # noqa: E402
from tests.factories.cross_engine_faults import FAULTS, with_normalizer  # noqa: E402
from tests.factories.policy_walks import ANKLE_KD, anchor  # noqa: E402

PUBLISHED = ROOT.parent / "shared" / "policies" / "t1_walk.npz"
PARTS = ("anchor", "faults", "repeats", "quick", "full")
LIMITS_S = {QUICK: 60.0, FULL: 900.0}

VELOCITIES = {
    "vx -0.6": -0.54,
    "vx -0.3": 0.0,
    "stand": 0.0,
    "vx +0.3": 0.0,
    "vx +0.6": 0.52,
    "vx +1.0": 0.96,
    "vx +1.5": 1.43,
    "vx +2.0": 1.91,
    "vy -0.6": -0.49,
    "vy -0.3": 0.0,
    "vy +0.3": 0.0,
    "vy +0.6": 0.56,
    "yaw -1.5": -1.47,
    "yaw -1.0": -0.96,
    "yaw +1.0": 0.98,
    "yaw +1.5": 1.47,
}
"""Published achieved velocity on the commanded axis [m/s, rad/s]."""

SURVIVAL = {
    "standing": (1.0, 1.0, 1.0, 1.0, 0.38, 0.0),
    "walking": (1.0, 1.0, 1.0, 0.88, 0.52, 0.05),
}
"""Published share of 64 survived pushes of 10, 20, … 60 N s."""
NEAR_VELOCITY, NEAR_SURVIVAL = 0.03, 0.1


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("policy", nargs="?", type=Path, default=PUBLISHED)
    parser.add_argument("--robot", type=Path, default=ROOT / "data" / "adapted_robot" / "t1")
    parser.add_argument("--parts", nargs="+", choices=PARTS, default=list(PARTS))
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--json", action="store_true")
    parsed = parser.parse_args()
    pool = ClipPool(workers=parsed.workers)
    policy = load_policy(parsed.policy)
    adapted = with_ankle_kd(deployed(parsed.robot, policy), ANKLE_KD)
    bars: list[Bar] = []
    if "anchor" in parsed.parts:
        models = {
            "anchor": anchor(ROOT / "robots" / "t1", policy),
            "adapted, kd 2": adapted,
            "adapted, kd 1": with_ankle_kd(adapted, 1.0),
        }
        bars += anchor_bars(models, pool)
    if "faults" in parsed.parts:
        bars += fault_bars(adapted, pool)
    if "repeats" in parsed.parts:
        bars.append(repeats_bar(adapted, pool))
    for suite in (QUICK, FULL):
        if suite in parsed.parts:
            bars += time_bars(adapted, suite, pool)
    return 0 if report(bars, machine=machine(), json=parsed.json) else 1


def anchor_bars(models: dict[str, Deployed], pool: ClipPool) -> list[Bar]:
    """Repeat the published sweep on each model; bounds apply to the first, the published one."""
    bars = []
    for place, (model, one) in enumerate(models.items()):
        cells = (*command_cells(JUDGED.seeds), *push_cells(one.robot, ("force",)))
        found = {each.cell.name: each for each in measure(one, cells, pool)}
        for name, published in VELOCITIES.items():
            value = achieved(found[name])
            bars.append(Bar(name=f"{model}: {name}", value=value, unit=f"({published:g})"))
            if place == 0:
                bars.append(_near(f"{model}: {name} from the published", value - published, NEAR_VELOCITY))
        for gait, shares in SURVIVAL.items():
            for size, published in zip(range(10, 70, 10), shares, strict=True):
                name = f"push force {gait} {size} Ns"
                value = found[name].figure("survival") or 0.0
                bars.append(Bar(name=f"{model}: {name}, survival", value=value, unit=f"({published:g})"))
                if place == 0:
                    bars.append(_near(f"{model}: {name} from the published", value - published, NEAR_SURVIVAL))
    return bars


def achieved(found: Measured) -> float:
    """Mean velocity on the commanded axis over the seeds; on the forward axis when standing."""
    axis = {"vy": "lateral", "ya": "yaw_rate"}.get(found.cell.name[:2], "forward")
    return found.spread(axis).get("mean", float("nan"))


def _near(name: str, difference: float, bound: float) -> Bar:
    return Bar(name=name, value=abs(difference), sense="<=", bound=bound)


def fault_bars(good: Deployed, pool: ClipPool) -> list[Bar]:
    """Required cells of the quick suite that each fault fails; the unchanged policy must fail none."""
    bounds = read_validation(ROOT / "data/validation.yaml", ROOT / "robots" / good.robot.name / "validation.yaml")
    cells = cells_of(QUICK, good.robot)

    def failed(one: Deployed) -> list[str]:
        verdict = judge(measure(one, cells, pool), bounds, suite=QUICK, policy="", robot="")
        return [cell.measured.cell.name for cell in verdict.failed_cells]

    whole = failed(good)
    bars = [Bar(name=f"no fault fails cells ({', '.join(whole) or 'none'})", value=len(whole), sense="<=", bound=0.0)]
    for name, fault in FAULTS.items():
        caught = failed(fault(own_normalizer(good) if name == "normalizer left out" else good))
        said = ", ".join(caught[:3]) or "none"
        bars.append(Bar(name=f"{name} fails cells ({said})", value=len(caught), sense=">=", bound=1.0))
    return bars


def own_normalizer(good: Deployed) -> Deployed:
    """The same policy with a normalizer fitted to observations of a walk; the published policy has none."""
    seen: list[np.ndarray] = []

    class Watched(type(good.policy)):
        def act(self, observation):
            seen.append(observation)
            return super().act(observation)

    parts = {field.name: getattr(good.policy, field.name) for field in dataclasses.fields(good.policy)}
    (cell,) = named(good.robot, {"vx +0.6": 1})
    walk(Worlds(dataclasses.replace(good, policy=Watched(**parts))), cell.trials[0])
    mean, spread = np.mean(seen, axis=0), np.maximum(np.std(seen, axis=0), 0.01)
    return dataclasses.replace(good, policy=with_normalizer(good.policy, mean, spread))


def repeats_bar(one: Deployed, pool: ClipPool) -> Bar:
    """Number of values, of some cells of every kind, that differ in any bit between two runs."""
    wanted = {"vx +1.0": 2, "sensor noise vx +1.0": 2, "terrain gravel 2 cm": 2, "push ball walking 1.3 m": 4}
    cells: tuple[Cell, ...] = named(one.robot, wanted)
    spread, alone = measure(one, cells, pool), measure(one, cells, ClipPool(workers=1))
    differ = sum(a.trials != b.trials for a, b in zip(spread, alone, strict=True))
    return Bar(name="cells that a repeat gives other bits", value=differ, sense="<=", bound=0.0)


def time_bars(one: Deployed, suite: str, pool: ClipPool) -> list[Bar]:
    """Wall time of a suite [s]."""
    cells = cells_of(suite, one.robot)
    start = time.perf_counter()
    measure(one, cells, pool)
    taken = time.perf_counter() - start
    trials = [trial for cell in cells for trial in cell.trials]
    return [
        Bar(
            name=f"{suite}: wall time, {pool.workers} processes",
            value=taken,
            unit="s",
            sense="<=",
            bound=LIMITS_S[suite],
        ),
        Bar(name=f"{suite}: trials", value=len(trials)),
        Bar(name=f"{suite}: simulated time if nothing falls", value=sum(trial.seconds for trial in trials), unit="s"),
    ]


if __name__ == "__main__":
    sys.exit(main())
