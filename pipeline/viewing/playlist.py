"""Clips for display: their human and robot motions, lists of clips, and the stored motions of a clip.

A `MotionSource` is plain data that worker processes can load; its digest identifies the drawn content.
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
    """Reference of a rollout, frame by frame; for a log, its simulation."""
    reference_name: str = "reference"
    robot_clip: RobotClip | None = None
    robot: Robot | None = None
    """The robot that `robot_clip` is for."""
    text: str = ""
    """Its facts, in Markdown."""
    note: str = ""
    """Why it is on a contact sheet, which shows at most two lines of it."""
    marks: Mapping[str, float] = field(default_factory=dict)
    """Failures of a log in order, and their times [s]."""
    line_at: Callable[[float], str] | None = None
    """Text to show at a time [s], for example the command of a log."""

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
    """Clips to choose from. The first one is shown first; a clip is loaded when it is chosen."""

    names: tuple[str, ...]
    """Requested names; not empty."""
    beside: tuple[str, ...] = ()
    """Related names that can be chosen too."""
    load: Callable[[str], Shown]
    """The clip of one of the names."""


@dataclass(frozen=True, kw_only=True)
class HumanSource:
    """A part of a stored human motion."""

    blob: str
    window: tuple[int, int] | None
    """First and last frame (exclusive) of the blob that belong to the clip; None: all."""
    mirrored: bool
    speed: float
    """Time scale of the variant."""
    start_s: float
    """Start of the robot's clip in the time-scaled motion [s]."""
    seconds: float | None
    """Duration from the start [s]; None: to the end."""

    def load(self, store: Store, name: str) -> HumanClip | None:
        """Load the motion. Raises FileError if the blob is missing or damaged."""
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
    """Stored motions of one clip; any of them may be missing."""

    clip: str
    human: HumanSource | None = None
    reference: tuple[str, int] | None = None
    """Blob of the reference of a rollout, and its first frame."""
    robot: str | None = None
    """Blob of the robot's motion."""

    def load(self, store: Store, robot: Robot) -> Shown:
        """Load the motions. Raises FileError if a blob is missing or damaged."""
        found = store.get_clip(self.robot, self.clip) if self.robot else None
        robot_clip = found if isinstance(found, RobotClip) else None
        human = self.human.load(store, self.clip) if self.human else None
        if isinstance(found, HumanClip):
            human = found
        reference = self.load_reference(store, robot_clip)
        return Shown(name=self.clip, human=human, reference=reference, robot_clip=robot_clip, robot=robot)

    def load_reference(self, store: Store, rollout: RobotClip | None) -> RobotClip | None:
        """The reference frames of a rollout; None for other clips, or if the reference is now shorter."""
        if self.reference is None or rollout is None:
            return None
        blob, start = self.reference
        clip, stop = store.get_clip(blob, self.clip), start + rollout.frame_count
        if not isinstance(clip, RobotClip) or stop > clip.frame_count:
            return None
        return clip.cut(start, stop, self.clip)
