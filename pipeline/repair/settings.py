"""What KP2 takes for damaged, how far it repairs, and what it rejects."""

from dataclasses import dataclass
from typing import Annotated

from pipeline.clips.outcome import LABELS
from pipeline.files.ranges import COUNT, NOT_NEGATIVE, PART, POSITIVE, OneOf, Range, check, increasing


@dataclass(frozen=True, kw_only=True)
class DetectionSettings:
    """Limits of what a body does from one frame to the next."""

    bone_change: Annotated[float, PART]
    """Largest change of a limb bone's length against the clip's median, as a share of it."""
    loose_bone_change: Annotated[float, PART]
    """The same for bodies whose bone spans several joints of the source (spine, collar bone)."""
    quat_norm_change: Annotated[float, PART]
    """Largest deviation of a quaternion's norm from 1."""
    position_jump: Annotated[float, POSITIVE]
    """Smallest jump of a body's place in its parent's frame that counts [m]."""
    root_jump: Annotated[float, POSITIVE]
    """Smallest jump of the pelvis in the world that counts [m]."""
    angle_jump: Annotated[float, POSITIVE]
    """Smallest jump of a body's orientation in its parent's frame that counts [rad]: of hands, feet and the head."""
    least_angle: Annotated[float, POSITIVE]
    """The same of bodies that carry others and move them far by a small turn [rad]."""
    lever_jump: Annotated[float, POSITIVE]
    """Way of the furthest joint below a body that makes its turn count, between these two [m]."""
    angular_speed: Annotated[float, POSITIVE]
    """A joint that turns faster jumps, however steadily [rad/s]."""
    jump_spread: Annotated[float, Range(1.0)]
    """A jump also has to exceed this many times the 95th percentile of the clip's own unsteadiness."""
    spike_turn: Annotated[float, POSITIVE]
    """Smallest angle by which a body is off what the frames around a short gap say that counts as a spike [rad]; of
    bodies that carry others less, as of jumps."""
    spike_spread: Annotated[float, Range(1.0)]
    """A spike also has to exceed this many times the 95th percentile of the clip's own misses."""
    noise_turn: Annotated[float, POSITIVE]
    """A body that misses by more than this in most frames shakes [rad]; less where it carries others, as of jumps."""
    noise_place: Annotated[float, POSITIVE]
    """The same of its place in the parent's frame [m]."""
    noise_share: Annotated[float, PART]
    """Share of the frames of a window that are off where a body shakes."""
    noise_s: Annotated[float, POSITIVE]
    """Length of that window [s]; shorter shaking is a number of spikes."""
    longest_spike_s: Annotated[float, NOT_NEGATIVE]
    """A joint that jumps away and comes back within this time was lost between; longer is two cuts."""
    opening_s: Annotated[float, NOT_NEGATIVE]
    """Frames before a jump this soon after the start (or this late) are a bind pose and not motion."""
    still_step: Annotated[float, POSITIVE]
    """A body that moves less than this from frame to frame is frozen [m] or [rad]; far below any noise."""
    release_turn: Annotated[float, POSITIVE]
    """A joint at rest to the last bit is left, or taken up, by no larger jump unless it is held [rad]."""
    release_place: Annotated[float, POSITIVE]
    """The same of a joint's place in the world [m]."""
    short_release_turn: Annotated[float, POSITIVE]
    """Jumps on both sides of fewer equal frames than `still_frames` that tell of a held joint [rad]."""
    still_frames: Annotated[int, COUNT]
    """Smallest number of equal frames of a single joint that count as frozen."""


@dataclass(frozen=True, kw_only=True)
class FillSettings:
    """How long a gap may be."""

    short_gap_s: Annotated[float, NOT_NEGATIVE]
    """Up to this a gap is filled by a polynomial through its surroundings."""
    longest_gap_s: Annotated[float, NOT_NEGATIVE]
    """Up to this a gap is filled from similar moments of the same clip, and flagged; longer is cut."""

    def __post_init__(self) -> None:
        check(increasing(self, "short_gap_s", "longest_gap_s"))


@dataclass(frozen=True, kw_only=True)
class FloorSettings:
    """Where the ground is."""

    ball_height: Annotated[float, Range(0.0, 0.2)]
    """Height of the ball of the foot's joint over the ground in stance [m]: what z = 0 means."""
    band: Annotated[float, POSITIVE]
    """Width of the band of heights that is searched for the most stance frames [m]."""
    slow_m_s: Annotated[float, POSITIVE]
    """A toe slower than this may stand."""
    drift_limit: Annotated[float, NOT_NEGATIVE]
    """Change of the ground's height over the clip that is taken out [m]."""
    offset_limit: Annotated[float, NOT_NEGATIVE]
    """Height of the ground from which on it is reported [m]; it is removed in any case."""


@dataclass(frozen=True, kw_only=True)
class SmoothSettings:
    """Zero-phase low pass."""

    cutoff_hz: Annotated[float, Range(0.5, 1000.0)]
    """For all skills but the fast ones."""
    fast_cutoff_hz: Annotated[float, Range(0.5, 1000.0)]
    """For the fast skills."""
    fast_skills: Annotated[tuple[str, ...], OneOf(LABELS)]


@dataclass(frozen=True, kw_only=True)
class ContactSettings:
    """When a foot is on the ground, and when it slides."""

    height: Annotated[float, POSITIVE]
    """Ball or heel lower than this over its own stance height [m]."""
    speed_floor_m_s: Annotated[float, NOT_NEGATIVE]
    """Slower than this is always slow, however clean the clip."""
    speed_on_m_s: Annotated[float, POSITIVE]
    """A point slower than this begins a contact, in the noisiest clip."""
    speed_off_m_s: Annotated[float, POSITIVE]
    """A point faster than this ends it."""
    shortest_s: Annotated[float, NOT_NEGATIVE]
    """Contacts and gaps shorter than this are smoothed over."""
    slip_limit_m_s: Annotated[float, NOT_NEGATIVE]
    """Largest mean speed of the planted point of a standing foot of a person who stands still."""
    slip_per_speed: Annotated[float, NOT_NEGATIVE]
    """What is added to it for each m/s of the pelvis [(m/s)/(m/s)]."""
    skate_limit_m_s: Annotated[float, POSITIVE]
    """A stretch is cut in which the slowest point near the ground hardly ever is slower than this."""
    plant_m_s: Annotated[float, NOT_NEGATIVE]
    """Feet that slide no faster than this are planted by moving the whole body, by this speed at most. To the mean over
    a stretch `slip_per_speed` is added, as it is to `slip_limit_m_s`."""
    longest_flight_s: Annotated[float, NOT_NEGATIVE]
    """Both feet off the ground for longer than this is no gait of a person."""

    def __post_init__(self) -> None:
        check(increasing(self, "speed_floor_m_s", "speed_on_m_s", "speed_off_m_s"))


@dataclass(frozen=True, kw_only=True)
class RobotSettings:
    """Trajectories that are a robot's already."""

    speed_limit_share: Annotated[float, POSITIVE]
    """Joint steps above this share of the motor's speed limit are jumps."""
    default_speed_limit: Annotated[float, POSITIVE]
    """Speed limit where no robot is given [rad/s]."""
    clamp: Annotated[float, NOT_NEGATIVE]
    """Joint limits passed by no more than this are clamped [rad]."""


@dataclass(frozen=True, kw_only=True)
class RepairSettings:
    """`data/repair.yaml`."""

    detection: DetectionSettings
    fill: FillSettings
    floor: FloorSettings
    smooth: SmoothSettings
    contact: ContactSettings
    robot: RobotSettings
    min_seconds: Annotated[float, Range(0.0, 60.0, open_low=True)]
    """Shorter pieces are dropped."""
    heading_s: Annotated[float, NOT_NEGATIVE]
    """The piece's heading is the mean facing of its first seconds."""
