"""Where the motions of a stored clip are: the person, what a rollout tracked, and the robot, by their blobs.

A source is plain data: worker processes load it, and its digest names what is drawn from it.
"""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass

from pipeline.batch import Store
from pipeline.clips.human_clip import HumanClip
from pipeline.clips.robot_clip import RobotClip
from pipeline.robot import Robot
from pipeline.viewing.human_figure import mirrored
from pipeline.viewing.playlist import Shown


@dataclass(frozen=True, kw_only=True)
class HumanSource:
    """A stretch of a person's motion."""

    blob: str
    window: tuple[int, int] | None = None
    """First and last frame (exclusive) of the blob that belong to the clip; None: all."""
    mirrored: bool = False
    speed: float = 1.0
    """Playing speed of the variant."""
    start_s: float = 0.0
    """Where the robot's clip starts in it, at that speed [s]."""
    seconds: float | None = None
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
        reference = self._reference(store, robot_clip)
        return Shown(name=self.clip, human=human, reference=reference, robot_clip=robot_clip, robot=robot)

    def _reference(self, store: Store, rollout: RobotClip | None) -> RobotClip | None:
        if self.reference is None or rollout is None:
            return None
        blob, start = self.reference
        clip = store.get_clip(blob, self.clip)
        return clip.cut(start, start + rollout.frame_count, self.clip) if isinstance(clip, RobotClip) else None
