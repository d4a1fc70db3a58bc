"""A clip at 50 Hz with derived quantities that several criteria use."""

from __future__ import annotations

import dataclasses
import functools
from dataclasses import dataclass
from typing import Annotated, Protocol, runtime_checkable

import numpy as np
from jaxtyping import Bool, Float

from pipeline import rotation, time_series
from pipeline.clips.robot_clip import RobotClip
from pipeline.feasibility.criterion import Hertz, ShareOfFrames
from pipeline.files.ranges import Range
from pipeline.files.sourced import Unit
from pipeline.quality.planar_motion import CommandVelocity, command_velocities
from pipeline.quality.sole import ContactSettings, SoleMotion, contact_from_sole, sole_motion
from pipeline.robot import Robot, mirror_image

FPS = 50.0
"""Rate at which motions are evaluated and stored [Hz]."""


NO_ROLLOUT = "no tracked rollout"


@dataclass(frozen=True, kw_only=True)
class CutSettings:
    """Cutting of motions, and limits for short ones."""

    min_seconds: Annotated[float, Range(0.04, 60.0), Unit("s")]
    """Shortest stretch that is kept [s]."""
    max_cuts: Annotated[int, Range(0, 20), Unit("-")]
    """Most repetitions of cutting the remainder of a clip; each cut changes the ends for the filters."""
    margin_s: Annotated[float, Range(0.0, 5.0), Unit("s")]
    """Margin that is cut on both sides of a bad frame [s]."""
    share_s: Annotated[float, Range(0.0, 60.0), Unit("s")]
    """Shorter clips may have as many bad frames as a clip of this duration, for shares and percentiles [s]."""
    short_share: ShareOfFrames
    """Upper bound of the share of bad frames in such a short clip."""


@dataclass(frozen=True, kw_only=True)
class RootFilter:
    """Low pass of the root; root criteria add their thresholds."""

    cutoff_hz: Hertz
    """Cutoff of the zero-phase low pass [Hz]."""


@runtime_checkable
class MotionSettings(Protocol):
    """The part of `FeasibilitySettings` that `motion_of` reads."""

    @property
    def cut(self) -> CutSettings: ...
    @property
    def contact(self) -> ContactSettings: ...
    @property
    def root(self) -> RootFilter: ...


@dataclass(frozen=True, kw_only=True)
class Motion:
    """A clip at 50 Hz with derived quantities."""

    clip: RobotClip
    robot: Robot
    sole: SoleMotion
    contacts: Bool[np.ndarray, "t 2"]
    """The clip's labels; inferred from sole kinematics where it has none."""
    labelled: bool
    contact: ContactSettings
    """Limits for contacts inferred from sole kinematics."""
    velocity: CommandVelocity
    commands: Float[np.ndarray, "t 3"]
    """Forward and lateral velocity [m/s] and yaw rate [rad/s] around each frame, in the form of a command."""
    smooth_root_pos_w: Float[np.ndarray, "t 3"]
    smooth_root_quat_w: Float[np.ndarray, "t 4"]
    smooth_joint_pos: Float[np.ndarray, "t j"]
    reference: RobotClip | None = None
    """The tracked motion at the same frames; None if this is not a tracked rollout."""
    no_reference: str = NO_ROLLOUT
    """Why there is no reference."""
    least_frames: int
    """Frame count up to which a shorter clip may have as many bad frames as a clip of this length. Percentiles are over
    at least this many frames; the missing ones count as good."""
    short_share: float
    """Upper bound of the share of bad frames in a shorter clip."""

    @property
    def simulated(self) -> bool:
        """Whether a simulation recorded the motion's forces and contacts."""
        return self.clip.forces is not None

    @functools.cached_property
    def inferred_contacts(self) -> Bool[np.ndarray, "t 2"]:
        """Contacts inferred from sole kinematics, regardless of labels."""
        return contact_from_sole(self.sole, self.contact) if self.labelled else self.contacts

    @property
    def ground_speed(self) -> float:
        """Mean horizontal speed [m/s]; opposite steps do not cancel."""
        return float(np.hypot(self.commands[:, 0], self.commands[:, 1]).mean())

    def largest_share(self, share: float) -> float:
        """Convert a limit on the share of bad frames for a clip of `least_frames` or more to this clip.

        In a short clip one frame is a large share, so it may have as many bad frames as a clip of `least_frames`, but
        at most `short_share` of its own.
        """
        as_many = share * self.least_frames / self.clip.frame_count
        return max(share, min(as_many, self.short_share))

    def cut(self, start: int, stop: int, settings: MotionSettings) -> Motion:
        """Frames [start, stop) as a separate motion: filters and differences do not use the other frames."""
        reference = None if self.reference is None else self.reference.cut(start, stop, self.reference.name)
        clip = self.clip.cut(start, stop, self.clip.name)
        return motion_of(clip, self.robot, settings, reference, self.no_reference)

    def mirrored(self, image: RobotClip) -> Motion:
        """The motion of `image`, the mirror image of this clip, for a symmetric robot; not for tracked rollouts."""
        assert self.reference is None
        sole = dataclasses.replace(
            self.sole,
            corner_pos_w=mirror_image.mirror_corners(self.sole.corner_pos_w, self.robot),
            corner_vel_w=mirror_image.mirror_corners(self.sole.corner_vel_w, self.robot),
        )
        velocity, commands = command_velocities(image.root_pos_w, image.root_quat_w, image.fps)
        return dataclasses.replace(
            self,
            clip=image,
            sole=sole,
            contacts=self.contacts[:, ::-1],
            velocity=velocity,
            commands=commands,
            smooth_root_pos_w=self.smooth_root_pos_w * mirror_image.POSITION,
            smooth_root_quat_w=self.smooth_root_quat_w * mirror_image.QUATERNION,
            smooth_joint_pos=self.smooth_joint_pos[:, self.robot.mirror_index] * self.robot.mirror_sign,
        )


def motion_of(
    clip: RobotClip,
    robot: Robot,
    settings: MotionSettings,
    reference: RobotClip | None = None,
    no_reference: str = NO_ROLLOUT,
) -> Motion:
    """Resample the clip to 50 Hz and derive the quantities; `reference` is at the resampled frames."""
    clip = at_database_rate(clip)
    sole = sole_motion(clip, robot)
    velocity, commands = command_velocities(clip.root_pos_w, clip.root_quat_w, clip.fps)
    columns = [clip.root_pos_w, rotation.make_continuous(clip.root_quat_w), clip.joint_pos]
    smooth = time_series.smooth(np.concatenate(columns, axis=1), clip.fps, settings.root.cutoff_hz)
    return Motion(
        clip=clip,
        robot=robot,
        sole=sole,
        contacts=contact_from_sole(sole, settings.contact) if clip.contacts is None else clip.contacts,
        labelled=clip.contacts is not None,
        contact=settings.contact,
        velocity=velocity,
        commands=commands,
        smooth_root_pos_w=smooth[:, :3].copy(),
        smooth_root_quat_w=rotation.normalize(smooth[:, 3:7]),
        smooth_joint_pos=smooth[:, 7:].copy(),
        reference=reference,
        no_reference=no_reference,
        least_frames=round(settings.cut.share_s * FPS),
        short_share=settings.cut.short_share,
    )


def at_database_rate(clip: RobotClip) -> RobotClip:
    """Resample to 50 Hz: multiples are decimated, other rates use a spline (linear interpolation would concentrate all
    acceleration at the frames)."""
    if clip.fps == FPS or clip.fps % FPS == 0:
        return clip.resampled(FPS)
    times_s = time_series.resample_times(clip.frame_count, clip.fps, FPS)
    return RobotClip(
        name=clip.name,
        fps=FPS,
        robot=clip.robot,
        joint_names=clip.joint_names,
        root_pos_w=time_series.resample_cubic(clip.root_pos_w, clip.fps, times_s),
        root_quat_w=rotation.normalize(time_series.resample_quat_cubic(clip.root_quat_w, clip.fps, times_s)),
        joint_pos=time_series.resample_cubic(clip.joint_pos, clip.fps, times_s),
        contacts=None if clip.contacts is None else time_series.resample_nearest(clip.contacts, clip.fps, times_s),
    )
