"""What KP2 takes for damaged, how far it repairs, and what it rejects."""

from __future__ import annotations

from dataclasses import dataclass

from pipeline.clips.skill import LABELS
from pipeline.files.ranges import COUNT, NOT_NEGATIVE, PART, POSITIVE, OneOf, Range, check, increasing


@dataclass(frozen=True, kw_only=True)
class DetectionSettings:
    """Limits of what a body does from one frame to the next."""

    bone_change: float
    """Largest change of a limb bone's length against the clip's median, as a share of it."""
    loose_bone_change: float
    """The same for bodies whose bone spans several joints of the source (spine, collar bone)."""
    quat_norm_change: float
    """Largest deviation of a quaternion's norm from 1."""
    position_jump: float
    """Smallest jump of a body's place in its parent's frame that counts [m]."""
    root_jump: float
    """Smallest jump of the pelvis in the world that counts [m]."""
    angle_jump: float
    """Smallest jump of a body's orientation in its parent's frame that counts [rad]: of hands, feet and the head."""
    least_angle: float
    """The same of bodies that carry others and move them far by a small turn [rad]."""
    lever_jump: float
    """Way of the furthest joint below a body that makes its turn count, between these two [m]."""
    angular_speed: float
    """A joint that turns faster jumps, however steadily [rad/s]."""
    jump_spread: float
    """A jump also has to exceed this many times the 95th percentile of the clip's own unsteadiness."""
    spike_turn: float
    """Smallest angle by which a body is off what the frames around a short gap say that counts as a spike [rad]; of
    bodies that carry others less, as of jumps."""
    spike_spread: float
    """A spike also has to exceed this many times the 95th percentile of the clip's own misses."""
    noise_turn: float
    """A body that misses by more than this in most frames shakes [rad]; less where it carries others, as of jumps."""
    noise_place: float
    """The same of its place in the parent's frame [m]."""
    noise_share: float
    """Share of the frames of a window that are off where a body shakes."""
    noise_s: float
    """Length of that window [s]; shorter shaking is a number of spikes."""
    longest_spike_s: float
    """A joint that jumps away and comes back within this time was lost between; longer is two cuts."""
    opening_s: float
    """Frames before a jump this soon after the start (or this late) are a bind pose and not motion."""
    still_step: float
    """A body that moves less than this from frame to frame is frozen [m] or [rad]; far below any noise."""
    release_turn: float
    """A joint at rest to the last bit is left, or taken up, by no larger jump unless it is held [rad]."""
    release_place: float
    """The same of a joint's place in the world [m]."""
    short_release_turn: float
    """Jumps on both sides of fewer equal frames than `still_frames` that tell of a held joint [rad]."""
    still_frames: int
    """Smallest number of equal frames of a single joint that count as frozen."""

    def __post_init__(self) -> None:
        check(
            self,
            bone_change=PART,
            loose_bone_change=PART,
            quat_norm_change=PART,
            position_jump=POSITIVE,
            root_jump=POSITIVE,
            angle_jump=POSITIVE,
            least_angle=POSITIVE,
            lever_jump=POSITIVE,
            angular_speed=POSITIVE,
            jump_spread=Range(1.0),
            spike_turn=POSITIVE,
            spike_spread=Range(1.0),
            noise_turn=POSITIVE,
            noise_place=POSITIVE,
            noise_share=PART,
            noise_s=POSITIVE,
            longest_spike_s=NOT_NEGATIVE,
            opening_s=NOT_NEGATIVE,
            still_step=POSITIVE,
            release_turn=POSITIVE,
            release_place=POSITIVE,
            short_release_turn=POSITIVE,
            still_frames=COUNT,
        )


@dataclass(frozen=True, kw_only=True)
class FillSettings:
    """How long a gap may be."""

    short_gap_s: float
    """Up to this a gap is filled by a polynomial through its surroundings."""
    longest_gap_s: float
    """Up to this a gap is filled from similar moments of the same clip, and flagged; longer is cut."""

    def __post_init__(self) -> None:
        check(
            self, increasing(self, "short_gap_s", "longest_gap_s"), short_gap_s=NOT_NEGATIVE, longest_gap_s=NOT_NEGATIVE
        )


@dataclass(frozen=True, kw_only=True)
class FloorSettings:
    """Where the ground is."""

    ball_height: float
    """Height of the ball of the foot's joint over the ground in stance [m]: what z = 0 means."""
    band: float
    """Width of the band of heights that is searched for the most stance frames [m]."""
    slow_m_s: float
    """A toe slower than this may stand."""
    drift_limit: float
    """Change of the ground's height over the clip that is taken out [m]."""
    offset_limit: float
    """Height of the ground from which on it is reported [m]; it is removed in any case."""

    def __post_init__(self) -> None:
        check(
            self,
            ball_height=Range(0.0, 0.2),
            band=POSITIVE,
            slow_m_s=POSITIVE,
            drift_limit=NOT_NEGATIVE,
            offset_limit=NOT_NEGATIVE,
        )


@dataclass(frozen=True, kw_only=True)
class SmoothSettings:
    """Zero-phase low pass."""

    cutoff_hz: float
    """For all skills but the fast ones."""
    fast_cutoff_hz: float
    """For the fast skills."""
    fast_skills: tuple[str, ...]

    def __post_init__(self) -> None:
        check(self, cutoff_hz=Range(0.5, 1000.0), fast_cutoff_hz=Range(0.5, 1000.0), fast_skills=OneOf(LABELS))


@dataclass(frozen=True, kw_only=True)
class ContactSettings:
    """When a foot is on the ground, and when it slides."""

    height: float
    """Ball or heel lower than this over its own stance height [m]."""
    speed_floor_m_s: float
    """Slower than this is always slow, however clean the clip."""
    speed_on_m_s: float
    """A point slower than this begins a contact, in the noisiest clip."""
    speed_off_m_s: float
    """A point faster than this ends it."""
    shortest_s: float
    """Contacts and gaps shorter than this are smoothed over."""
    slip_limit_m_s: float
    """Largest mean speed of the planted point of a standing foot of a person who stands still."""
    slip_per_speed: float
    """What is added to it for each m/s of the pelvis [(m/s)/(m/s)]."""
    skate_limit_m_s: float
    """A stretch is cut in which the slowest point near the ground hardly ever is slower than this."""
    longest_flight_s: float
    """Both feet off the ground for longer than this is no gait of a person."""

    def __post_init__(self) -> None:
        check(
            self,
            increasing(self, "speed_floor_m_s", "speed_on_m_s", "speed_off_m_s"),
            height=POSITIVE,
            speed_floor_m_s=NOT_NEGATIVE,
            speed_on_m_s=POSITIVE,
            speed_off_m_s=POSITIVE,
            shortest_s=NOT_NEGATIVE,
            slip_limit_m_s=NOT_NEGATIVE,
            slip_per_speed=NOT_NEGATIVE,
            skate_limit_m_s=POSITIVE,
            longest_flight_s=NOT_NEGATIVE,
        )


@dataclass(frozen=True, kw_only=True)
class RobotSettings:
    """Trajectories that are a robot's already."""

    speed_limit_share: float
    """Joint steps above this share of the motor's speed limit are jumps."""
    default_speed_limit: float
    """Speed limit where no robot is given [rad/s]."""
    clamp: float
    """Joint limits passed by no more than this are clamped [rad]."""

    def __post_init__(self) -> None:
        check(self, speed_limit_share=POSITIVE, default_speed_limit=POSITIVE, clamp=NOT_NEGATIVE)


@dataclass(frozen=True, kw_only=True)
class RepairSettings:
    """`data/repair.yaml`."""

    detection: DetectionSettings
    fill: FillSettings
    floor: FloorSettings
    smooth: SmoothSettings
    contact: ContactSettings
    robot: RobotSettings
    min_seconds: float
    """Shorter pieces are dropped."""
    heading_s: float
    """The piece's heading is the mean facing of its first seconds."""

    def __post_init__(self) -> None:
        check(self, min_seconds=Range(0.0, 60.0, open_low=True), heading_s=NOT_NEGATIVE)
