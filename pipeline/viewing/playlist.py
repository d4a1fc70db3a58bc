"""Displayable clips: the human and robot motion of a clip, a list of them, and where a stored clip's motions are.

A `MotionSource` is plain data: worker processes load it, and its digest identifies what is drawn from it.
"""

import dataclasses
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

from pipeline.batch import Store
from pipeline.clips.human_clip import HumanClip
from pipeline.clips.robot_clip import RobotClip
from pipeline.robot import Robot
from pipeline.viewing.figure import Figure
from pipeline.viewing.human_figure import human_figure, mirrored
from pipeline.viewing.robot_figure import robot_figure


@dataclass(frozen=True, kw_only=True)
class Shown:
    """The human and robot motion of one clip, with a common start time, and the reference of a rollout."""

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
    note: str = ""
    """Why it is on a sheet of clips, cut after two lines there."""
    marks: Mapping[str, float] = field(default_factory=dict)
    """Failures of a log in order, and their times [s]."""
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


@dataclass(frozen=True, kw_only=True)
class HumanSource:
    """A stretch of a person's motion."""

    blob: str
    window: tuple[int, int] | None
    """First and last frame (exclusive) of the blob that belong to the clip; None: all."""
    mirrored: bool
    speed: float
    """Playing speed of the variant."""
    start_s: float
    """Where the robot's clip starts in it, at that speed [s]."""
    seconds: float | None
    """Length from there on [s]; None: to the end."""

    def load(self, store: Store, name: str) -> HumanClip | None:
        """The motion. Raises FileError when the blob is gone or damaged."""
        clip = store.get_clip(self.blob, name)
        if not isinstance(clip, HumanClip):
            return None
        if self.window is not None:
            clip = clip.cut(*self.window, name)
        if self.mirrored:
            clip = mirrored(clip)
        clip = dataclasses.replace(clip, fps=clip.fps * self.speed)
        if self.start_s == 0.0 and self.seconds is None:
            return clip
        start = min(round(self.start_s * clip.fps), clip.frame_count - 1)
        stop = clip.frame_count if self.seconds is None else start + max(round(self.seconds * clip.fps), 1)
        return clip.cut(start, min(stop, clip.frame_count), name)


@dataclass(frozen=True, kw_only=True)
class MotionSource:
    """The motions that are shown of one clip; any of them may be missing."""

    clip: str
    human: HumanSource | None = None
    reference: tuple[str, int] | None = None
    """Blob of what a rollout tracked, and the frame that it starts at."""
    robot: str | None = None
    """Blob of the robot's motion."""

    def load(self, store: Store, robot: Robot) -> Shown:
        """The motions. Raises FileError when a blob is gone or damaged."""
        found = store.get_clip(self.robot, self.clip) if self.robot else None
        robot_clip = found if isinstance(found, RobotClip) else None
        human = self.human.load(store, self.clip) if self.human else None
        if isinstance(found, HumanClip):
            human = found
        reference = self.load_reference(store, robot_clip)
        return Shown(name=self.clip, human=human, reference=reference, robot_clip=robot_clip, robot=robot)

    def load_reference(self, store: Store, rollout: RobotClip | None) -> RobotClip | None:
        """The frames that a rollout tracked; None for another clip, or where the reference is shorter now."""
        if self.reference is None or rollout is None:
            return None
        blob, start = self.reference
        clip, stop = store.get_clip(blob, self.clip), start + rollout.frame_count
        if not isinstance(clip, RobotClip) or stop > clip.frame_count:
            return None
        return clip.cut(start, stop, self.clip)
