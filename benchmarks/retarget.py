"""KP3 compared with its bars and, if installed, with GMR on the same clips in the same run.

    python benchmarks/retarget.py FILE_OR_FOLDER... [--fps 30 --fps 50] [--gmr PYTHON --gmr-repo FOLDER]
        [--parts FILE_OR_FOLDER...] [--repeat 3] [--each] [--json] [--raw] [--trade-offs OUT.png] [--memory CLIPS]

The files pass reader, catalogue and repair; both retargeters get the result. Scores are those of `booster-lab score`,
pooled over all frames. With `--parts` the bars are those of fast clips: of the whole files, and of the windows of runs
and side steps in the parts. docs/retarget.md explains the numbers and the installation of GMR.
"""

from __future__ import annotations

import argparse
import dataclasses
import os
import statistics
import sys
from collections.abc import Mapping
from pathlib import Path

for variable in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"):  # use one core; set before numpy is loaded
    os.environ.setdefault(variable, "1")

ROOT = Path(__file__).resolve().parent.parent
sys.path.insert(0, str(ROOT))

from benchmarks import retarget_fast, retarget_memory, retarget_trade_offs  # noqa: E402
from benchmarks.gmr import Gmr  # noqa: E402
from benchmarks.report import Bar, machine, report  # noqa: E402
from benchmarks.retarget_runs import Scored, handed_on, motion_files, run_gmr, run_ours, text_to_csv  # noqa: E402
from pipeline.cli.chain import Chain  # noqa: E402
from pipeline.feasibility import FeasibilitySettings  # noqa: E402
from pipeline.files import settings as settings_file  # noqa: E402
from pipeline.project import Project  # noqa: E402
from pipeline.retarget import RetargetSettings  # noqa: E402
from pipeline.robot import Robot, load_robot  # noqa: E402
from pipeline.scoring import FIGURES, pooled  # noqa: E402

TIMES_GMR, TIMES_GMR_FROM_TEXT = 25.0, 15.0
"""Least speed of retargeting, and from BVH text to CSV, relative to GMR's inverse kinematics."""

AT_ANY_RATE = ("limit", "slip", "drift", "penetration", "self_collision", "height_shift", "pelvis")
"""Substrings of the metric keys whose bars apply at any rate; the other bars apply at 30 Hz."""

IN_EACH_CLIP = ("self_collision_percent", "self_collision_max_cm")
"""Metrics whose bars also apply to every single clip."""


def main() -> None:
    parsed = _arguments()
    chain, robot = Chain(Project(ROOT)), load_robot(parsed.robot)
    base = settings_file.read(parsed.settings, RetargetSettings)
    if parsed.memory:
        bars = retarget_memory.bars(parsed.memory, base, robot)
        sys.exit(0 if report(bars, machine=machine(), json=parsed.json) else 1)
    files = motion_files(parsed.paths)
    clips = handed_on(files, chain, raw=parsed.raw)
    parts = motion_files(parsed.parts)
    clips += retarget_fast.pieces_of(retarget_fast.labelled(parts, chain))
    limits = retarget_fast.BARS if parts else {figure.key: figure.bar for figure in FIGURES}
    if not clips:
        sys.exit("repair leaves nothing of these files; --raw takes them as recorded")
    if parsed.trade_offs:
        parsed.trade_offs.write_bytes(retarget_trade_offs.picture(clips, dataclasses.replace(base, fps=30.0), robot))
        return
    gmr = Gmr(python=parsed.gmr, repo=parsed.gmr_repo) if parsed.gmr else None
    bars = []
    for fps in parsed.fps or [30.0, 50.0]:
        settings = dataclasses.replace(base, fps=fps)
        ours = run_ours(clips, settings, robot, parsed.repeat)
        theirs = run_gmr(clips, fps, gmr, robot, parsed.repeat) if gmr else None
        bars += _bars(ours, theirs, fps, limits) + _from_text(files, chain, settings, robot, theirs, parsed.repeat)
        if parsed.each:
            _print_each(ours, fps)
    if parts:
        judged = Project(ROOT).read("feasibility.yaml", FeasibilitySettings)
        bars += retarget_fast.accepted_bars(retarget_fast.labelled([*files, *parts], chain), base, judged, robot)
    if gmr is None and not parsed.json:
        print("GMR: not installed (--gmr PYTHON --gmr-repo FOLDER)")
    sys.exit(0 if report(bars, machine=machine(), json=parsed.json) else 1)


def _arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("paths", nargs="*", type=Path, help="motion files, or folders of them")
    parser.add_argument("--parts", nargs="+", default=[], type=Path, help="of these only the runs and side steps")
    parser.add_argument("--fps", type=float, action="append", help="rate [Hz], may be repeated (30 and 50)")
    parser.add_argument("--robot", default="t1")
    parser.add_argument("--settings", type=Path, default=ROOT / "data/retarget.yaml")
    parser.add_argument("--gmr", metavar="PYTHON", type=Path, help="interpreter of an environment with GMR's packages")
    parser.add_argument("--gmr-repo", metavar="FOLDER", type=Path, help="GMR's repository, checked out")
    parser.add_argument("--repeat", type=int, default=3, help="runs that the speed is the median of")
    parser.add_argument("--raw", action="store_true", help="clips without repair")
    parser.add_argument("--each", action="store_true", help="a line a clip, too")
    parser.add_argument("--trade-offs", metavar="PNG", type=Path, help="only draw what one bar costs another")
    parser.add_argument("--memory", metavar="CLIPS", type=int, help="only measure memory over so many clips")
    parser.add_argument("--json", action="store_true")
    parsed = parser.parse_args()
    if parsed.repeat < 1:
        parser.error("--repeat must be 1 or more: speed is the median of the repeated runs")
    if not parsed.paths and not parsed.memory:
        parser.error("name motion files, or folders of them")
    if (parsed.gmr is None) != (parsed.gmr_repo is None):
        parser.error("--gmr and --gmr-repo belong together")
    return parsed


def _bars(ours: Scored, theirs: Scored | None, fps: float, limits: Mapping[str, float | None]) -> list[Bar]:
    """Metrics at one rate, of KP3 and GMR; `limits` are the largest values at 30 Hz by metric key."""
    at = f"{fps:g} Hz"
    bars = _speed(ours, theirs, at)
    scores = {"": pooled(list(ours.scores.values())).figures()}
    if theirs:
        scores["GMR: "] = pooled(list(theirs.scores.values())).figures()
    for figure in FIGURES:
        bound = limits.get(figure.key) if fps == 30.0 or any(part in figure.key for part in AT_ANY_RATE) else None
        for who, figures in scores.items():
            bars.append(_bar(f"{at}, {who}{figure.title}", figures[figure.key], figure.unit, None if who else bound))
        if figure.key in IN_EACH_CLIP:
            worst = max(score.figures()[figure.key] for score in ours.scores.values())
            bars.append(_bar(f"{at}, {figure.title} in the worst clip", worst, figure.unit, bound))
    return bars


def _speed(ours: Scored, theirs: Scored | None, at: str) -> list[Bar]:
    speeds = ours.frames_per_second
    middle = statistics.median(speeds)
    bars = [
        Bar(name=f"{at}, frames per second", value=middle, unit="1/s"),
        Bar(name=f"{at}, slowest run", value=speeds[0], unit="1/s"),
        Bar(name=f"{at}, fastest run", value=speeds[-1], unit="1/s"),
    ]
    if theirs:
        gmr = statistics.median(theirs.frames_per_second)
        bars.append(Bar(name=f"{at}, GMR: frames per second", value=gmr, unit="1/s"))
        bars.append(Bar(name=f"{at}, speed / GMR's", value=middle / gmr, sense=">=", bound=TIMES_GMR))
    return bars


def _from_text(
    files: list[Path], chain: Chain, settings: RetargetSettings, robot: Robot, theirs: Scored | None, repeat: int
) -> list[Bar]:
    """Share of each step and total speed from text to CSV, each the median of `repeat` runs."""
    runs = [text_to_csv(files, chain, settings, robot) for _ in range(repeat)]
    spent = {step: statistics.median(run[step] for run in runs) for step in runs[0]}
    at, frames = f"{settings.fps:g} Hz", spent.pop("frames")
    total_s = sum(spent.values())
    bars = [
        Bar(name=f"{at}, text to CSV: {step}", value=100.0 * seconds / total_s, unit="%")
        for step, seconds in spent.items()
    ]
    bars.append(Bar(name=f"{at}, text to CSV, frames per second", value=frames / total_s, unit="1/s"))
    if theirs:
        times = frames / total_s / statistics.median(theirs.frames_per_second)
        bars.append(Bar(name=f"{at}, text to CSV, speed / GMR's", value=times, sense=">=", bound=TIMES_GMR_FROM_TEXT))
    return bars


def _bar(name: str, value: float, unit: str, bound: float | None) -> Bar:
    return Bar(name=name, value=value, unit=unit, sense="<=" if bound is not None else "", bound=bound)


def _print_each(ours: Scored, fps: float) -> None:
    print(f"{fps:g} Hz: {' '.join(figure.key for figure in FIGURES)}")
    for name, score in ours.scores.items():
        print(f"{name} ({score.frames}): {' '.join(f'{value:.3g}' for value in score.figures().values())}")


if __name__ == "__main__":
    main()
