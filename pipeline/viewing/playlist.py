"""Displayable clips: the human and robot motion of a clip, and a list of them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from pipeline.clips.human_clip import HumanClip
from pipeline.clips.robot_clip import RobotClip
from pipeline.robot import Robot
from pipeline.viewing.figure import Figure
from pipeline.viewing.human_figure import human_figure
from pipeline.viewing.robot_figure import robot_figure


@dataclass(frozen=True, kw_only=True)
class Mark:
    """A moment that one can jump to."""

    time_s: float
    label: str


@dataclass(frozen=True, kw_only=True)
class Shown:
    """The human and robot motion of one clip, with a common start time.

    A rollout is shown beside the reference that it tracked.
    """

    name: str
    human: HumanClip | None = None
    reference: RobotClip | None = None
    """What a rollout tracked, frame for frame; of a log, its simulation."""
    reference_name: str = "reference"
    robot_clip: RobotClip | None = None
    robot: Robot | None = None
    """The robot that `robot_clip` is for."""
    text: str = ""
    """Its facts, in Markdown."""
    marks: tuple[Mark, ...] = ()
    """Failures of a log, in order of their times."""
    line_at: Callable[[float], str] | None = None
    """What is shown at a time [s], such as the command of a log."""

    def figures(self) -> list[Figure]:
        """Figures from left to right: human, reference, robot."""
        figures = [human_figure(self.human)] if self.human is not None else []
        if self.robot is not None:
            if self.reference is not None:
                figures.append(robot_figure(self.reference, self.robot, name=self.reference_name))
            if self.robot_clip is not None:
                figures.append(robot_figure(self.robot_clip, self.robot))
        return figures


@dataclass(frozen=True, kw_only=True)
class Playlist:
    """Clips to choose from. The first is shown first; each is loaded when it is chosen."""

    names: tuple[str, ...]
    """Requested names; not empty."""
    beside: tuple[str, ...] = ()
    """Related names that can be chosen too."""
    load: Callable[[str], Shown]
    """The clip of one of the names."""
