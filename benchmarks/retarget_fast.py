"""Runs and side steps: their windows in motion files, their bars, and the share that KP5 accepts."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from pathlib import Path

from benchmarks.report import Bar
from benchmarks.retarget_runs import HandedOn
from pipeline.cli.chain import Chain
from pipeline.clips.human_clip import HumanClip
from pipeline.clips.outcome import Piece
from pipeline.clips.robot_clip import RobotClip
from pipeline.feasibility import FeasibilitySettings
from pipeline.feasibility import process as evaluate
from pipeline.readers import Statement
from pipeline.retarget import RetargetSettings, process
from pipeline.robot import Robot

SKILLS = ("run", "side_left", "side_right")

BARS = {
    "position_limit_percent": 0.0,
    "speed_limit_percent": 0.0,
    "slip_strict_m_s": 0.015,
    "slip_middle_m_s": 0.012,
    "drift_cm": 0.6,
    "penetration_max_cm": 1.5,
    "jerk_rad_s3": 330.0,
    "jump_percent": 1.0,
    "self_collision_percent": 1.0,
    "pelvis_velocity_error_m_s": 0.15,
    "pelvis_acceleration_ratio": 2.0,
}
"""Largest metric values over fast clips at 30 Hz, by key; other metrics have no bar."""

ACCEPTED_PERCENT = 80.0
"""Least share of the labelled time that KP5 accepts."""


@dataclasses.dataclass(frozen=True, kw_only=True)
class Labelled:
    """A window of a run or of side steps, and its repaired pieces."""

    file: Path
    skill: str
    seconds: float
    repaired: tuple[Piece, ...]


def labelled(files: Sequence[Path], chain: Chain) -> list[Labelled]:
    """Find the windows of `SKILLS` in motion files of persons."""
    found = []
    for file in files:
        for whole in chain.catalogued(chain.read(file, Statement())).pieces[:1]:
            if not isinstance(whole.clip, HumanClip):
                continue
            for window in chain.windows(whole).pieces:
                skill = str(window.numbers["skill"])
                if skill not in SKILLS:
                    continue
                frames = int(window.numbers["stop_frame"] or 0) - int(window.numbers["start_frame"] or 0)
                pieces = chain.repaired_window(window).pieces
                seconds = frames / window.clip.fps
                found.append(Labelled(file=file, skill=skill, seconds=seconds, repaired=pieces))
    return found


def pieces_of(windows: Sequence[Labelled]) -> list[HandedOn]:
    """The repaired pieces of the windows."""
    return [
        HandedOn(file=window.file, human=piece.clip)
        for window in windows
        for piece in window.repaired
        if isinstance(piece.clip, HumanClip)
    ]


def accepted_bars(
    windows: Sequence[Labelled], retargeting: RetargetSettings, feasibility: FeasibilitySettings, robot: Robot
) -> list[Bar]:
    """Share of the labelled time that passes repair, retargeting and KP5, in total and per skill."""
    labelled_s: dict[str, float] = dict.fromkeys(SKILLS, 0.0)
    accepted_s: dict[str, float] = dict.fromkeys(SKILLS, 0.0)
    for window in windows:
        labelled_s[window.skill] += window.seconds
        for piece in window.repaired:
            if not isinstance(piece.clip, HumanClip):
                continue
            for made in process(piece.clip, piece.numbers, settings=retargeting, robot=robot).pieces:
                assert isinstance(made.clip, RobotClip)
                numbers = {**piece.numbers, **made.numbers}
                outcome = evaluate(made.clip, numbers, settings=feasibility, robot=robot)
                accepted_s[window.skill] += float(outcome.numbers["kept_seconds"] or 0.0)
    share = 100.0 * sum(accepted_s.values()) / max(sum(labelled_s.values()), 1e-9)
    total = f"of {sum(labelled_s.values()):.1f} s of runs and side steps accepted by KP5"
    bars = [Bar(name=total, value=share, unit="%", sense=">=", bound=ACCEPTED_PERCENT)]
    for skill in SKILLS:
        if labelled_s[skill]:
            name = f"of {labelled_s[skill]:.1f} s of {skill} accepted by KP5"
            bars.append(Bar(name=name, value=100.0 * accepted_s[skill] / labelled_s[skill], unit="%"))
    return bars
