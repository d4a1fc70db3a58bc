"""What retargeting is worth downstream: the same tracker recipe trained on GMR's output and on ours for the same clips.

    python -m benchmarks.retarget_downstream FILE_OR_FOLDER... --gmr PYTHON --gmr-repo FOLDER --work DIR --prepare-only
    python -m benchmarks.retarget_downstream --work DIR [--device cuda --num-envs 4096 --iterations N]
        [--seeds 1 2 3] [--workers 0] [--json]

The first command needs GMR and no GPU: files go through reader, catalogue and repair, every fourth recording is held
out, and both retargeters get the same clips. The second one needs DIR and a GPU: it trains a tracker on each
retargeter's clips with `python -m pipeline.tracking`, rolls out the held-out clips of the same retargeter in plain
MuJoCo and writes DIR/table.md. A run that was stopped continues; what is done is not done again. A mirror image of a
held-out recording must not be among the files.

A clip survives that is followed from its first frame to its last. Each tracker follows its own retargeter's version of
the held-out clips, since this is what a user of that retargeter would have; the body error is the distance of key links
from it. Clips that one retargeter cannot do are left out of both.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

ROOT = Path(__file__).resolve().parent.parent
sys.path.insert(0, str(ROOT))

from benchmarks.gmr import Gmr  # noqa: E402
from benchmarks.report import Bar, machine, report  # noqa: E402
from benchmarks.retarget_runs import HandedOn, handed_on, motion_files  # noqa: E402
from pipeline.actuators.adapted_robot import adapt, read_actuators, torque_envelope, write_adapted_robot  # noqa: E402
from pipeline.actuators.settings import ActuatorSettings  # noqa: E402
from pipeline.batch.pool import ClipPool  # noqa: E402
from pipeline.cli.chain import Chain  # noqa: E402
from pipeline.cli.project import Project  # noqa: E402
from pipeline.clips.robot_clip import RobotClip  # noqa: E402
from pipeline.errors import PipelineError  # noqa: E402
from pipeline.expert.training_bundle import robot_facts  # noqa: E402
from pipeline.files import atomic  # noqa: E402
from pipeline.files import settings as settings_file  # noqa: E402
from pipeline.retarget import RetargetSettings, process  # noqa: E402
from pipeline.robot import Robot, load_robot  # noqa: E402
from pipeline.tracking.bundle import read_tracking_bundle  # noqa: E402
from pipeline.tracking.export_tracker import (  # noqa: E402
    NominalRollout,
    clips_of,
    figures,
    nominal_rollouts,
)
from pipeline.tracking.process import Setup  # noqa: E402
from pipeline.tracking.settings import TrackingSettings  # noqa: E402
from pipeline.tracking.task import CONTROL_HZ, ITERATIONS  # noqa: E402
from pipeline.tracking.tracker_folder import NETWORK  # noqa: E402
from pipeline.tracking.write_bundle import write_tracking_bundle  # noqa: E402

OURS, GMR = "ours", "gmr"

ROBOT = "t1"
"""The robot that GMR's worker retargets to."""

HELD_OUT_EVERY = 4
"""Every so many recordings, in the order of their names, one is held out."""

LICENCE = "as the recordings'; for measuring, no policy of it ships"

Retargeter = Callable[[HandedOn], RobotClip]
"""A human clip to the robot's motion at `CONTROL_HZ`."""


@dataclass(frozen=True, kw_only=True)
class Recipe:
    """How every tracker is trained."""

    device: str
    num_envs: int
    iterations: int


def main() -> None:
    given = _arguments()
    work: Path = given.work
    if given.paths:
        chain, robot = Chain(Project(ROOT)), load_robot(ROBOT)
        clips = handed_on(motion_files(given.paths), chain)
        gmr = Gmr(python=given.gmr, repo=given.gmr_repo)
        prepare(clips, {OURS: _ours(robot), GMR: lambda clip: _theirs(clip, gmr, robot)}, work, robot)
    if given.prepare_only:
        return
    recipe = Recipe(device=given.device, num_envs=given.num_envs, iterations=given.iterations)
    found = {seed: measured(work, recipe, seed, ClipPool(workers=given.workers)) for seed in given.seeds}
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


def _ours(robot: Robot) -> Retargeter:
    settings = settings_file.read(ROOT / "data/retarget.yaml", RetargetSettings)

    def retargeted(clip: HandedOn) -> RobotClip:
        (piece,) = process(clip.human, {}, settings=settings, robot=robot).pieces
        assert isinstance(piece.clip, RobotClip)
        return piece.clip

    return retargeted


def _theirs(clip: HandedOn, gmr: Gmr, robot: Robot) -> RobotClip:
    return gmr.retarget(clip.human.resampled(CONTROL_HZ), clip.file, robot)[0]


def prepare(clips: Sequence[HandedOn], retargeters: Mapping[str, Retargeter], work: Path, robot: Robot) -> None:
    """Write a bundle to train on and one that is held out for each retargeter, and the robot that both are for.

    `work` gets `adapted_robot` and, for each retargeter, `<name>/trained_on` and `<name>/held_out`. Raises SystemExit
    where one of them has no clip.
    """
    recordings = sorted({clip.file.name for clip in clips})
    held_out = set(recordings[HELD_OUT_EVERY - 1 :: HELD_OUT_EVERY])
    actuators = adapt(robot, [], settings_file.read(ROOT / "data/actuators.yaml", ActuatorSettings))
    folder = work / "adapted_robot" / robot.name
    write_adapted_robot(folder, ROOT / "robots" / robot.name, actuators)
    adapted = load_robot(folder)
    made: dict[str, list[tuple[str, RobotClip]]] = {name: [] for name in retargeters}
    for clip in clips:
        try:
            results = {name: retargeted(clip) for name, retargeted in retargeters.items()}
        except (PipelineError, subprocess.CalledProcessError) as error:
            print(f"{clip.human.name} is left out: {error}", file=sys.stderr)
            continue
        for name, result in results.items():
            made[name].append((clip.file.name, result))
    facts = robot_facts(adapted, folder)
    for name, results in made.items():
        for part, wanted in (("trained_on", False), ("held_out", True)):
            taken = [result for file, result in results if (file in held_out) == wanted]
            if not taken:
                raise SystemExit(
                    f"{len(recordings)} recordings leave nothing for '{part}': {HELD_OUT_EVERY} are needed."
                )
            write_tracking_bundle(work / name / part, taken, adapted, facts, [LICENCE])


def measured(work: Path, recipe: Recipe, seed: int, pool: ClipPool) -> dict[str, list[NominalRollout]]:
    """Rollouts of the held-out clips by the tracker of each retargeter, by its name; trackers are trained as needed."""
    found = {}
    for name in (OURS, GMR):
        out = work / name / f"seed{seed}"
        train(work / name / "trained_on", out, recipe, seed)
        found[name] = rollouts(work / name / "held_out", work / "adapted_robot" / ROBOT, out / NETWORK, pool)
    return found


def train(bundle: Path, out: Path, recipe: Recipe, seed: int) -> None:
    """Train the tracker of a bundle in a process of its own, or continue; nothing to do where `done.json` says so.

    Raises SystemExit where training fails, or where another recipe was trained in the folder.
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


def rollouts(bundle: Path, robot_folder: Path, tracker: Path, pool: ClipPool) -> list[NominalRollout]:
    """The undisturbed rollout of each clip of a bundle."""
    robot = load_robot(robot_folder)
    values = settings_file.read(ROOT / "data/tracking.yaml", TrackingSettings)
    clips = clips_of(read_tracking_bundle(bundle).motions, robot)
    envelope = torque_envelope(read_actuators(robot_folder))
    return nominal_rollouts(clips, Setup(settings=values, robot=robot, envelope=envelope, tracker=tracker), pool)


def bars_of(found: Mapping[int, Mapping[str, Sequence[NominalRollout]]]) -> list[Bar]:
    """Survival and body error of both for each seed; of every seed ours has to survive at least a clip more."""
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
    """The comparison as a table in Markdown, a row a seed and one of their means."""
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
