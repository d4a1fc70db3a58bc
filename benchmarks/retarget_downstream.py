"""Downstream value of retargeting: the same tracker recipe, trained on GMR's and on KP3's versions of the same clips.

    python -m benchmarks.retarget_downstream FILE_OR_FOLDER... --gmr PYTHON --gmr-repo FOLDER --work DIR --prepare-only
    python -m benchmarks.retarget_downstream --work DIR [--device cuda --num-envs 4096 --iterations N]
        [--seeds 1 2 3] [--workers 0] [--json]

The first command needs GMR and no GPU: files pass reader, catalogue and repair, every fourth recording is held
out (cut into pieces of 2 s), and both retargeters get the same clips. The second one needs DIR and a GPU: it trains a
tracker on each retargeter's clips with `python -m pipeline.tracking`, rolls out the held-out clips of the same
retargeter in plain MuJoCo and writes DIR/table.md. Repeating the command continues a stopped run. The files must not
contain a mirror image of a held-out recording.

A clip survives if it is tracked from its first to its last frame. Each tracker follows its own retargeter's version of
the held-out clips, as it would for a user of that retargeter; the body error is the distance of key links from it.
Clips that one retargeter rejects are excluded from both.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
from collections.abc import Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from functools import partial
from multiprocessing import get_context
from pathlib import Path

import numpy as np

ROOT = Path(__file__).resolve().parent.parent
sys.path.insert(0, str(ROOT))

from benchmarks.report import Bar, machine, report  # noqa: E402
from pipeline.actuators.adapted_robot import read_actuators, torque_envelope  # noqa: E402
from pipeline.files import atomic  # noqa: E402
from pipeline.files import settings as settings_file  # noqa: E402
from pipeline.robot import load_robot  # noqa: E402
from pipeline.tracking.bundle import read_tracking_bundle  # noqa: E402
from pipeline.tracking.nominal_rollout import NominalRollout, clips_of, figures, nominal_rollout  # noqa: E402
from pipeline.tracking.process import Setup  # noqa: E402
from pipeline.tracking.settings import TrackingSettings  # noqa: E402
from pipeline.tracking.task import ITERATIONS  # noqa: E402
from pipeline.tracking.tracker_folder import NETWORK  # noqa: E402

OURS, GMR = "ours", "gmr"

ROBOT = "t1"
"""Robot of GMR's worker."""


@dataclass(frozen=True, kw_only=True)
class Recipe:
    """Training parameters of every tracker."""

    device: str
    num_envs: int
    iterations: int


def main() -> None:
    given = _arguments()
    work: Path = given.work
    if given.paths:
        from benchmarks.gmr import Gmr  # retargeting needs packages that GPU hosts lack
        from benchmarks.retarget_downstream_clips import prepare_files

        prepare_files(given.paths, Gmr(python=given.gmr, repo=given.gmr_repo), work)
    if given.prepare_only:
        return
    recipe = Recipe(device=given.device, num_envs=given.num_envs, iterations=given.iterations)
    found = {seed: measured(work, recipe, seed, given.workers) for seed in given.seeds}
    atomic.write_text(work / "table.md", table(found))
    sys.exit(0 if report(bars_of(found), machine=machine(), json=given.json) else 1)


def _arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument(
        "paths", nargs="*", type=Path, help="motion files, or folders of them; none: as prepared in DIR"
    )
    parser.add_argument("--work", type=Path, required=True, metavar="DIR")
    parser.add_argument("--gmr", metavar="PYTHON", type=Path, help="interpreter of an environment with GMR's packages")
    parser.add_argument("--gmr-repo", metavar="FOLDER", type=Path, help="GMR's repository, checked out")
    parser.add_argument("--prepare-only", action="store_true")
    parser.add_argument("--device", default="cuda")
    parser.add_argument("--num-envs", type=int, default=4096)
    parser.add_argument("--iterations", type=int, default=ITERATIONS)
    parser.add_argument("--seeds", nargs="+", type=int, default=[1, 2, 3])
    parser.add_argument("--workers", type=int, default=0, help="processes of the rollouts; 0: one a core")
    parser.add_argument("--json", action="store_true")
    given = parser.parse_args()
    if given.paths and (given.gmr is None or given.gmr_repo is None):
        parser.error("files are prepared with --gmr and --gmr-repo")
    if not given.paths and not (given.work / OURS).is_dir():
        parser.error(f"nothing is prepared in {given.work}; name motion files")
    return given


def measured(work: Path, recipe: Recipe, seed: int, workers: int) -> dict[str, list[NominalRollout]]:
    """Roll out the held-out clips with the tracker of each retargeter; train missing trackers."""
    found = {}
    for name in (OURS, GMR):
        out = work / name / f"seed{seed}"
        train(work / name / "trained_on", out, recipe, seed)
        found[name] = rollouts(work / name / "held_out", work / "adapted_robot" / ROBOT, out / NETWORK, workers)
    return found


def train(bundle: Path, out: Path, recipe: Recipe, seed: int) -> None:
    """Train the tracker of a bundle in a separate process, or continue; nothing to do if `done.json` exists.

    Raises SystemExit if training fails, or if the folder holds another recipe's run.
    """
    asked = {**vars(recipe), "seed": seed}
    stated = out / "recipe.json"
    if stated.is_file() and json.loads(stated.read_text()) != asked:
        raise SystemExit(f"{out} has a tracker of another recipe ({stated.read_text().strip()}); give another --work.")
    if (out / "done.json").is_file():
        return
    command = [
        sys.executable,
        "-m",
        "pipeline.tracking",
        "--bundle",
        str(bundle.resolve()),
        "--out",
        str(out.resolve()),
    ]
    command += ["--device", recipe.device, "--num-envs", str(recipe.num_envs), "--iterations", str(recipe.iterations)]
    command += ["--seed", str(seed), "--resume"]
    atomic.write_text(stated, json.dumps(asked) + "\n")
    status = subprocess.run(command, cwd=ROOT, stdout=subprocess.DEVNULL).returncode
    if status:
        raise SystemExit(f"training of {out} ended with status {status}; its message is above.")


def rollouts(bundle: Path, robot_folder: Path, tracker: Path, workers: int) -> list[NominalRollout]:
    """Roll out each clip of a bundle without disturbance, in `workers` processes; 0: one per core."""
    robot = load_robot(robot_folder)
    setup = Setup(
        settings=settings_file.read(ROOT / "data/tracking.yaml", TrackingSettings),
        robot=robot,
        envelope=torque_envelope(read_actuators(robot_folder)),
        tracker=tracker,
    )
    work = partial(nominal_rollout, setup=setup)
    clips = clips_of(read_tracking_bundle(bundle).motions, robot)
    if workers == 1:
        return [work(clip) for clip in clips]
    with ProcessPoolExecutor(workers or None, mp_context=get_context("spawn")) as pool:
        return list(pool.map(work, clips))


def bars_of(found: Mapping[int, Mapping[str, Sequence[NominalRollout]]]) -> list[Bar]:
    """Survival and body error of both for each seed; KP3 must survive at least one clip more with every seed."""
    bars = []
    for seed, each in found.items():
        values = {name: figures(rolled) for name, rolled in each.items()}
        for name, value in values.items():
            bars.append(Bar(name=f"seed {seed}, {name}: survival", value=100.0 * _survival(each[name]), unit="%"))
            bars.append(Bar(name=f"seed {seed}, {name}: body error", value=value["body_error_cm"], unit="cm"))
        more = 100.0 * (_survival(each[OURS]) - _survival(each[GMR]))
        one_clip = 100.0 / len(each[OURS])
        name = f"seed {seed}: survival, ours minus GMR's"
        bars.append(Bar(name=name, value=round(more, 6), unit="%", sense=">=", bound=round(one_clip, 6)))
    return bars


def _survival(rolled: Sequence[NominalRollout]) -> float:
    return float(np.mean([each.survived for each in rolled]))


def table(found: Mapping[int, Mapping[str, Sequence[NominalRollout]]]) -> str:
    """The comparison as a Markdown table: one row per seed, and one of means."""
    rows = []
    for seed, each in found.items():
        survival = [100.0 * _survival(each[name]) for name in (GMR, OURS)]
        error = [figures(each[name])["body_error_cm"] for name in (GMR, OURS)]
        rows.append((str(seed), *survival, *error))
    rows.append(("mean", *np.mean([row[1:] for row in rows], axis=0)))
    count = len(next(iter(found.values()))[OURS])
    lines = [
        f"| seed | GMR: survival of {count} held-out clips [%] | ours | GMR: body error [cm] | ours |",
        "|---|---|---|---|---|",
        *(f"| {name} | {a:.0f} | {b:.0f} | {c:.1f} | {d:.1f} |" for name, a, b, c, d in rows),
    ]
    return "\n".join(lines) + "\n"


if __name__ == "__main__":
    main()
