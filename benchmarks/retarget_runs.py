"""Motion files processed up to the robot, timed and scored, for the retargeting benchmark."""

from __future__ import annotations

import time
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from benchmarks.gmr import Gmr
from pipeline.cli.chain import Chain
from pipeline.cli.retarget_command import encode_csv
from pipeline.clips.human_clip import HumanClip
from pipeline.clips.robot_clip import RobotClip
from pipeline.readers import Statement
from pipeline.retarget import RetargetSettings, process
from pipeline.retarget.process import retarget
from pipeline.robot import Robot
from pipeline.scoring import Score, score

SUFFIXES = (".bvh", ".amc", ".npz", ".txt")


@dataclass(frozen=True, kw_only=True)
class HandedOn:
    """A repaired human clip and its file."""

    file: Path
    human: HumanClip


@dataclass(frozen=True, kw_only=True)
class Scored:
    """Clips of one retargeter at one rate: robot frames, CPU seconds, one score per clip."""

    frames: int
    cpu_s: tuple[float, ...]
    """One value per repetition, over all clips."""
    scores: dict[str, Score]
    """Scores by clip name."""

    @property
    def frames_per_second(self) -> tuple[float, ...]:
        """One value per repetition, slowest first."""
        return tuple(sorted(self.frames / seconds for seconds in self.cpu_s))


def motion_files(paths: Iterable[Path]) -> list[Path]:
    """The files, and the motion files in the folders; the ASF of an AMC is not a separate motion."""
    found = []
    for path in paths:
        below = sorted(each for each in path.rglob("*") if each.suffix in SUFFIXES) if path.is_dir() else [path]
        found += below
    return found


def handed_on(files: Sequence[Path], chain: Chain, *, raw: bool = False) -> list[HandedOn]:
    """Process the files by reader, catalogue and repair, in order; `raw`: without repair."""
    clips = []
    for file in files:
        for whole in chain.catalogued(chain.read(file, Statement())).pieces[:1]:
            pieces = (whole,) if raw else chain.repaired(whole).pieces
            clips += [HandedOn(file=file, human=piece.clip) for piece in pieces if isinstance(piece.clip, HumanClip)]
    return clips


def run_ours(clips: Sequence[HandedOn], settings: RetargetSettings, robot: Robot, repeat: int) -> Scored:
    """Retarget and score every clip once, then time it `repeat` times: from the clip at the robot's rate to the joint
    motion.

    The time includes planning and all passes, but not the computation of metadata.
    """
    scores, frames = {}, 0
    for clip in clips:
        (piece,) = process(clip.human, {}, settings=settings, robot=robot).pieces
        assert isinstance(piece.clip, RobotClip)
        frames += piece.clip.frame_count
        scores[clip.human.name] = score(clip.human, piece.clip, robot)
    cpu_s, humans = [], [clip.human.resampled(settings.fps) for clip in clips]
    for _ in range(repeat):
        start_s = time.process_time()
        for human in humans:
            retarget(human, settings, robot)
        cpu_s.append(time.process_time() - start_s)
    return Scored(frames=frames, cpu_s=tuple(cpu_s), scores=scores)


def run_gmr(clips: Sequence[HandedOn], fps: float, gmr: Gmr, robot: Robot, repeat: int) -> Scored:
    """Retarget the same clips with GMR, timed equally: after a first run, from the clip at the rate to the joints."""
    frames, cpu_s, scores = 0, np.zeros(repeat), {}
    for clip in clips:
        human = clip.human.resampled(fps)
        result, seconds = gmr.retarget(human, clip.file, robot, repeat)
        frames, cpu_s = frames + result.frame_count, cpu_s + seconds
        scores[human.name] = score(human, result, robot)
    return Scored(frames=frames, cpu_s=tuple(cpu_s.tolist()), scores=scores)


def text_to_csv(files: Sequence[Path], chain: Chain, settings: RetargetSettings, robot: Robot) -> dict[str, float]:
    """CPU seconds of each step from the files' text to CSV text, and the resulting robot `frames`."""
    spent: dict[str, float] = dict.fromkeys(("read", "catalogue", "repair", "retarget", "write"), 0.0)
    frames = 0
    for file in files:
        times_s = [time.process_time()]

        def lap(step: str, times_s: list[float] = times_s) -> None:
            times_s.append(time.process_time())
            spent[step] += times_s[-1] - times_s[-2]

        read = chain.read(file, Statement())
        lap("read")
        whole = chain.catalogued(read).pieces[0]
        lap("catalogue")
        repaired = chain.repaired(whole).pieces
        lap("repair")
        made: list[RobotClip] = []
        for human in (piece.clip for piece in repaired if isinstance(piece.clip, HumanClip)):
            pieces = process(human, {}, settings=settings, robot=robot).pieces
            made += [piece.clip for piece in pieces if isinstance(piece.clip, RobotClip)]
        lap("retarget")
        for clip in made:
            encode_csv(clip, {"source": file.name})
        lap("write")
        frames += sum(clip.frame_count for clip in made)
    return {**spent, "frames": float(frames)}
