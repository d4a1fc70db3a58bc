"""What can be shown: a clip as a human and a robot did it, and a list of such clips."""

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
class Shown:
    """One clip as a human and a robot did it; they share the time of their first frame."""

    name: str
    human: HumanClip | None = None
    robot_clip: RobotClip | None = None
    robot: Robot | None = None
    """The robot that `robot_clip` is for."""
    text: str = ""
    """What is known of it, in Markdown."""

    def figures(self) -> list[Figure]:
        figures = [human_figure(self.human)] if self.human is not None else []
        if self.robot_clip is not None and self.robot is not None:
            figures.append(robot_figure(self.robot_clip, self.robot))
        return figures


@dataclass(frozen=True, kw_only=True)
class Playlist:
    """Clips to choose from. The first is shown first; each is loaded when it is chosen."""

    names: tuple[str, ...]
    """What was asked for; not empty."""
    beside: tuple[str, ...] = ()
    """What belongs to it and can be chosen too."""
    load: Callable[[str], Shown]
    """The clip of one of the names."""
