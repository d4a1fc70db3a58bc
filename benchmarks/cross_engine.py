"""The grid of data/cross_engine.yaml in MuJoCo, its bridge and DART: a known-good policy, then each planted fault.

    python -m benchmarks.cross_engine [--json] [--jobs 2] [--seeds 5] [--fault-seeds 1] [--cells]
                                      [--robot data/adapted_robot/t1] [POLICY]

POLICY is an npz (by default `../shared/policies/t1_walk.npz` beside the checkout, whose ankles are damped with
2 N m s/rad). Bars: no required cell of the policy fails, each fault fails at least one, and weak motors fail cells in
DART that they pass in MuJoCo. `--cells` prints the matrix and the worst errors of commands.
"""

from __future__ import annotations

import argparse
import dataclasses
import math
import sys
from pathlib import Path

import numpy as np

ROOT = Path(__file__).resolve().parent.parent
sys.path.insert(0, str(ROOT))

from benchmarks.report import Bar, machine, report  # noqa: E402
from pipeline.batch import ClipPool  # noqa: E402
from pipeline.deployment import load_policy  # noqa: E402
from pipeline.files import settings as settings_files  # noqa: E402
from pipeline.validation.bars import read_validation  # noqa: E402
from pipeline.validation.cross_engine import CrossEngineResult, cross_engine, errors_of  # noqa: E402
from pipeline.validation.cross_engine_walk import (  # noqa: E402
    BRIDGE,
    DART,
    ENGINES,
    MUJOCO,
    CrossEngineSettings,
    walk,
)
from pipeline.validation.deployed import Deployed, deployed, with_ankle_kd  # noqa: E402
from tests.factories.cross_engine_faults import FAULTS, with_normalizer  # noqa: E402
from tests.factories.policy_walks import ANKLE_KD  # noqa: E402

PUBLISHED = ROOT.parent / "shared" / "policies" / "t1_walk.npz"
WEAK = ("60 % torque", "half Kp")


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("policy", nargs="?", type=Path, default=PUBLISHED)
    parser.add_argument("--robot", type=Path, default=ROOT / "data" / "adapted_robot" / "t1")
    parser.add_argument("--json", action="store_true")
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--seeds", type=int, default=5)
    parser.add_argument("--fault-seeds", type=int, default=1)
    parser.add_argument("--cells", action="store_true")
    parsed = parser.parse_args()
    values = settings_files.read(ROOT / "data" / "cross_engine.yaml", CrossEngineSettings)
    pool = ClipPool(workers=parsed.jobs)
    good = deployed(parsed.robot, load_policy(parsed.policy))
    rules = read_validation(ROOT / "data/validation.yaml", ROOT / "robots" / good.robot.name / "validation.yaml")
    if parsed.policy == PUBLISHED:
        good = with_ankle_kd(good, ANKLE_KD)
    found = cross_engine(good, with_seeds(values, parsed.seeds), rules, pool=pool)
    if parsed.cells:
        tell(found, values)
    bars = policy_bars(found)
    cells = {name: cell for name, cell in values.cells.items() if rules.engines[name].required}
    required = dataclasses.replace(values, cells=cells)
    for name, fault in FAULTS.items():
        broken = fault(own_normalizer(good, values) if name == "normalizer left out" else good)
        caught = cross_engine(
            broken, with_seeds(required, parsed.fault_seeds), rules, pool=pool, engines=(MUJOCO, DART)
        )
        bars += fault_bars(name, caught)
        if parsed.cells:
            print(f"{name}: {', '.join(cell.name for cell in caught.cells if cell.reasons) or 'nothing'}")
    return 0 if report(bars, machine=machine(), json=parsed.json) else 1


def with_seeds(values: CrossEngineSettings, seeds: int) -> CrossEngineSettings:
    return dataclasses.replace(values, simulation=dataclasses.replace(values.simulation, seeds=seeds))


def own_normalizer(good: Deployed, values: CrossEngineSettings) -> Deployed:
    """The same policy with a normalizer fitted to observations of a walk; the published policy has none."""
    seen: list[np.ndarray] = []

    class Watched(type(good.policy)):
        def act(self, observation):
            seen.append(observation)
            return super().act(observation)

    parts = {field.name: getattr(good.policy, field.name) for field in dataclasses.fields(good.policy)}
    walk(dataclasses.replace(good, policy=Watched(**parts)), MUJOCO, values.cells["walk_0.6"], 0, values.simulation)
    mean, spread = np.mean(seen, axis=0), np.std(seen, axis=0)
    return dataclasses.replace(good, policy=with_normalizer(good.policy, mean, np.maximum(spread, 0.01)))


def policy_bars(found: CrossEngineResult) -> list[Bar]:
    walks = [one for cell in found.cells if cell.required for each in cell.figures.values() for one in each]
    bars = [
        Bar(name="required cells that fail", value=len(found.failed_cells), unit="cells", sense="<=", bound=0.0),
        Bar(name="required cells", value=len(found.cells) - len(found.not_required), unit="cells"),
        Bar(name="falls in required cells", value=sum(one.fell for one in walks), unit=f"of {len(walks)} walks"),
    ]
    figures = {
        "forward_m_s": ("forward velocity", "m/s"),
        "lateral_m_s": ("lateral velocity", "m/s"),
        "yaw_rate_rad_s": ("yaw rate", "rad/s"),
        "height_m": ("root height", "m"),
    }
    required = [cell for cell in found.cells if cell.required]
    for figure, (what, unit) in figures.items():
        for one, two in ((MUJOCO, DART), (MUJOCO, BRIDGE), (BRIDGE, DART)):
            apart = max(abs(cell.mean(one, figure) - cell.mean(two, figure)) for cell in required)
            bars.append(Bar(name=f"largest difference of {what}, {one} and {two}", value=apart, unit=unit))
    return bars


def fault_bars(name: str, caught: CrossEngineResult) -> list[Bar]:
    failed = [cell for cell in caught.cells if cell.reasons]
    only_dart = [cell for cell in caught.cells if cell.survival(MUJOCO) == 1.0 and cell.survival(DART) < 1.0]
    bars = [
        Bar(name=f"{name}: required cells that fail", value=len(failed), unit="cells", sense=">=", bound=1.0),
        Bar(name=f"{name}: cells with falls in MuJoCo", value=sum(c.survival(MUJOCO) < 1.0 for c in caught.cells)),
        Bar(name=f"{name}: cells with falls in DART", value=sum(c.survival(DART) < 1.0 for c in caught.cells)),
    ]
    if name in WEAK:
        bound = {"sense": ">=", "bound": 1.0}
        bars.append(Bar(name=f"{name}: cells with falls in DART alone", value=len(only_dart), unit="cells", **bound))
    return bars


def tell(found: CrossEngineResult, values: CrossEngineSettings) -> None:
    """Print the matrix, and the worst errors of MuJoCo and DART."""
    for cell in found.cells:
        means = "; ".join(
            f"{engine} {cell.survival(engine):.1f} "
            + " ".join(f"{cell.mean(engine, name):+.3f}" for name in ("forward_m_s", "lateral_m_s", "yaw_rate_rad_s"))
            + f" {cell.mean(engine, 'height_m'):.4f} {cell.mean(engine, 'power_w'):.0f} W"
            for engine in ENGINES
        )
        ours = [one for engine in (MUJOCO, DART) for one in cell.figures[engine] if not one.fell]
        errors = [errors_of(values.cells[cell.name], one) for one in ours]
        velocity, turning = (
            max((each[name] for each in errors), default=math.nan) for name in ("speed_error", "yaw_rate_error")
        )
        print(f"{cell.name}: {means}; worst {velocity:.3f} m/s {turning:.3f} rad/s")
        for reason in cell.reasons:
            print(f"    {reason}")


if __name__ == "__main__":
    sys.exit(main())
