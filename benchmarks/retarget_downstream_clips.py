"""Clips for the downstream comparison: both retargeters' versions of the same repaired human clips, as bundles."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

import numpy as np

from benchmarks.gmr import Gmr
from benchmarks.retarget_downstream import GMR, OURS, ROBOT, ROOT
from benchmarks.retarget_runs import HandedOn, handed_on, motion_files
from pipeline.actuators.adapted_robot import adapt, write_adapted_robot
from pipeline.actuators.settings import ActuatorSettings
from pipeline.cli.chain import Chain
from pipeline.clips.robot_clip import RobotClip
from pipeline.errors import PipelineError
from pipeline.expert.training_bundle import robot_facts
from pipeline.files import settings as settings_file
from pipeline.project import Project
from pipeline.retarget import RetargetSettings, process
from pipeline.robot import Robot, load_robot
from pipeline.tracking.task import CONTROL_HZ
from pipeline.tracking.write_bundle import write_tracking_bundle

HELD_OUT_EVERY = 4
"""Interval of held-out recordings, in the order of their names."""

PIECE_S = 2.0
"""Held-out clips are cut into pieces of about this length [s], so that one fall does not count for a long recording.
Of 25 pieces of 5 s, 13 were followed by no tracker of six, and both retargeters differed by one piece at most."""

LICENCE = "as the recordings'; for measuring, no policy of it ships"

Retargeter = Callable[[HandedOn], RobotClip]
"""Function from a human clip to the robot's motion at `CONTROL_HZ`."""


def prepare_files(paths: Sequence[Path], gmr: Gmr, work: Path) -> None:
    """Read, repair and retarget the motion files, then `prepare` the clips."""
    chain, robot = Chain(Project(ROOT)), load_robot(ROBOT)
    clips = handed_on(motion_files(paths), chain)
    prepare(clips, {OURS: _ours(robot), GMR: lambda clip: _theirs(clip, gmr, robot)}, work, robot)


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
    """Write a training bundle and a held-out bundle for each retargeter, and their robot.

    Writes `adapted_robot` and, for each retargeter, `<name>/trained_on` and `<name>/held_out` to `work`. Raises
    SystemExit if a bundle has no clip.
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
            if wanted:
                taken = [piece for clip in taken for piece in pieces_of(clip)]
            write_tracking_bundle(work / name / part, taken, adapted, facts, [LICENCE])


def pieces_of(clip: RobotClip) -> list[RobotClip]:
    """Cut a clip into equal pieces of about `PIECE_S`, named `<clip>+<number>`; keep it whole below 1.5 pieces."""
    count = max(round(clip.duration_s / PIECE_S), 1)
    edges = np.linspace(0, clip.frame_count, count + 1).astype(int)
    names = [f"{clip.name}+{number}" for number in range(count)] if count > 1 else [clip.name]
    return [clip.cut(int(start), int(stop), name) for start, stop, name in zip(edges, edges[1:], names, strict=False)]
