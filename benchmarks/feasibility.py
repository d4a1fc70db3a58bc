"""Both error rates of the feasibility stage: known-good motion accepted, planted infeasibilities found.

    python benchmarks/feasibility.py [POLICY ...] [--json] [--drawn 80] [--seeds 1 2 3] [--jobs 2] [--project .]

Known-good motion is rollouts of policies that walk: a published one of the T1, which is not part of the project (by
default `../shared/policies/t1_walk.npz` beside the checkout, where it is), and the shipped one. A POLICY is a file, or
a folder that holds `t1_walk.npz` or `policy.npz`. Commands are those on the axes of the command ranges and, for each
seed, random ones from the whole box. The axes and each seed have a table; several seeds also have a joint table,
without the axes, because limits were tuned on them. Every table has the bars. Rollouts are evaluated with their true
contacts, without contacts, with contacts inferred by KP2, and in windows of half a second. Each fault is planted once
into the same rollouts, and counted if some body moved by 5 cm. Criteria that do not apply to rollouts have separate
tables: tracking, and likeness to the person (for the clips of a checkout with a materialized `expert_db`).
"""

from __future__ import annotations

import argparse
import dataclasses
import sys
from collections.abc import Collection
from pathlib import Path

import joblib

ROOT = Path(__file__).resolve().parent.parent
sys.path.insert(0, str(ROOT))

from benchmarks.feasibility_faults import FAULTS  # noqa: E402
from benchmarks.feasibility_judge import (  # noqa: E402
    PUBLISHED,
    Command,
    Judged,
    commands_on_axes,
    drawn_commands,
    judge,
    policy_file,
)
from benchmarks.feasibility_likeness import likeness_bars  # noqa: E402
from benchmarks.feasibility_rates import LEAST, criteria, fault_bars, known_good_bars  # noqa: E402
from benchmarks.feasibility_tracked import tracking_bars  # noqa: E402
from benchmarks.report import Bar, machine, report  # noqa: E402
from pipeline.errors import PipelineError  # noqa: E402
from pipeline.feasibility import FeasibilitySettings  # noqa: E402
from pipeline.files import settings  # noqa: E402

SEEDS = (1,)
"""Seeds of the random commands; docs/feasibility.md, "Seeds", lists tuning and held-out seeds."""
DEFAULT_POLICIES = (ROOT.parent / "shared" / "policies", ROOT / "robots" / "t1" / "policies" / "walk")


def main() -> int:
    arguments = _arguments()
    named = arguments.policies or [path for path in DEFAULT_POLICIES if policy_file(path)]
    files = []
    for path in named:
        file = policy_file(path)
        if file is None:
            print(
                f"{path}: is not a policy and contains none ('{PUBLISHED}' or 'policy.npz'). Known-good motion is "
                "made by rolling out a policy that is known to walk. Name its file or folder: "
                "python benchmarks/feasibility.py FOLDER",
                file=sys.stderr,
            )
            return 2
        files.append(file)
    limits = settings.read(ROOT / "data" / "feasibility.yaml", FeasibilitySettings)
    codes = criteria()
    held = True
    every: list[Bar] = []
    for title, bars in _tables(files, arguments, limits, codes):
        every += [dataclasses.replace(bar, name=f"{title}: {bar.name}") for bar in bars]
        if not arguments.json:
            print(f"\n{title}", flush=True)
            held &= report(bars, machine=machine(), json=False)
    return 0 if (report(every, machine=machine(), json=True) if arguments.json else held) else 1


def _tables(files: list[Path], arguments: argparse.Namespace, limits: FeasibilitySettings, codes: list[str]):
    """Yield title and bars of each table: axes, each seed, and all seeds together if there are several; then tracking
    and likeness."""
    for file in files:
        name = f"{file.parent.name}/{file.stem}"
        on_axes = _judge_all(file, commands_on_axes(), 0, limits, arguments)
        yield f"{name}, on the axes", _of_rollouts(on_axes, codes, arguments)
        drawn: list[Judged] = []
        for seed in arguments.seeds:
            judged = _judge_all(file, drawn_commands(arguments.drawn, seed), seed, limits, arguments)
            yield f"{name}, seed {seed}", _of_rollouts(judged, codes, arguments)
            drawn += judged
        if len(arguments.seeds) > 1:
            title = f"{name}, seeds {' '.join(map(str, arguments.seeds))} together"
            yield title, _of_rollouts(drawn, codes, arguments)
    for seed in arguments.seeds:
        yield f"motion that is tracked, seed {seed}", tracking_bars(limits, arguments.drawn // 2, seed, LEAST)
    try:
        yield "likeness to the person", likeness_bars(arguments.project, limits, arguments.seeds[0], LEAST)
    except PipelineError as error:
        print(f"the table of likeness is left out: {error}", file=sys.stderr)


def _of_rollouts(judged: list[Judged], codes: list[str], arguments: argparse.Namespace) -> list[Bar]:
    return [*known_good_bars(judged, codes), *fault_bars(judged, _planted(arguments))]


def _judge_all(
    file: Path, commands: list[Command], seed: int, limits: FeasibilitySettings, arguments: argparse.Namespace
) -> list[Judged]:
    planted = _planted(arguments)
    one = joblib.delayed(judge)
    jobs = [one(file, command, (seed, number), limits, planted) for number, command in enumerate(commands)]
    return [found for found in joblib.Parallel(n_jobs=arguments.jobs)(jobs) if found is not None]


def _planted(arguments: argparse.Namespace) -> Collection[str]:
    return arguments.only if arguments.only is not None else tuple(FAULTS)


def _arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("policies", nargs="*", type=Path, metavar="POLICY", help="files of policies, or their folders")
    parser.add_argument("--project", type=Path, default=ROOT, help="a checkout with an expert database, for likeness")
    parser.add_argument("--drawn", type=int, default=80, help="commands drawn from the whole box, for each seed")
    parser.add_argument("--seeds", type=int, nargs="+", default=list(SEEDS), help="of drawn commands and of faults")
    parser.add_argument("--only", nargs="*", choices=tuple(FAULTS), metavar="FAULT", help="faults that are planted")
    parser.add_argument("--jobs", type=int, default=2, help="processes")
    parser.add_argument("--json", action="store_true", help="one JSON object instead of tables")
    return parser.parse_args()


if __name__ == "__main__":
    raise SystemExit(main())
