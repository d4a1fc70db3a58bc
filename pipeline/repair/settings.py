"""Settings of KP2, read from `data/repair.yaml`: limits for defects, repair and rejection."""

from dataclasses import dataclass
from typing import Annotated

from pipeline.clips.outcome import LABELS
from pipeline.files.ranges import COUNT, NOT_NEGATIVE, PART, POSITIVE, OneOf, Range, check, increasing


@dataclass(frozen=True, kw_only=True)
class DetectionSettings:
    """Limits for the change of a body's pose from one frame to the next."""

    bone_change: Annotated[float, PART]
    """Largest deviation of a limb bone's length from the clip's median, as a share of it."""
    loose_bone_change: Annotated[float, PART]
    """`bone_change` for bodies whose bone spans several joints of the source (spine, collar bone)."""
    quat_norm_change: Annotated[float, PART]
    """Largest deviation of a quaternion's norm from 1."""
    position_jump: Annotated[float, POSITIVE]
    """Smallest jump of a body's position in its parent's frame that counts [m]."""
    root_jump: Annotated[float, POSITIVE]
    """Smallest jump of the pelvis in the world that counts [m]."""
    angle_jump: Annotated[float, POSITIVE]
    """Smallest jump of a body's orientation in its parent's frame that counts [rad]: of hands, feet and the head."""
    least_angle: Annotated[float, POSITIVE]
    """Lower bound of that limit for bodies that carry others and move them far by a small rotation [rad]."""
    lever_jump: Annotated[float, POSITIVE]
    """Displacement of the furthest joint below a body for which its rotation counts, between these two limits [m]."""
    angular_speed: Annotated[float, POSITIVE]
    """Angular speed above which a joint counts as jumping, however steady it is [rad/s]."""
    jump_spread: Annotated[float, Range(1.0)]
    """A jump also has to exceed this many times the 95th percentile of the clip's own unsteadiness."""
    spike_turn: Annotated[float, POSITIVE]
    """Smallest deviation of a body's orientation from the interpolation of the frames around that counts as a spike
    [rad]; smaller for bodies that carry others, as for jumps."""
    spike_spread: Annotated[float, Range(1.0)]
    """A spike also has to exceed this many times the 95th percentile of the clip's own interpolation errors."""
    noise_turn: Annotated[float, POSITIVE]
    """Interpolation error above which, in most frames, a body shakes [rad]; smaller if it carries others."""
    noise_place: Annotated[float, POSITIVE]
    """Interpolation error of the position in the parent's frame above which a body shakes [m]."""
    noise_share: Annotated[float, PART]
    """Share of a window's frames with such an error from which the body shakes."""
    noise_s: Annotated[float, POSITIVE]
    """Length of that window [s]; shorter shaking is reported as spikes."""
    longest_spike_s: Annotated[float, NOT_NEGATIVE]
    """Longest time between a joint's jump and its return for which the frames between are lost; otherwise two cuts."""
    opening_s: Annotated[float, NOT_NEGATIVE]
    """A jump within this time of the start (or end) separates a bind pose from the motion [s]."""
    still_step: Annotated[float, POSITIVE]
    """Step size below which a body is still [m] or [rad]; far below measurement noise."""
    release_turn: Annotated[float, POSITIVE]
    """Largest jump with which a joint enters or leaves an exactly constant pose without counting as frozen [rad]."""
    release_place: Annotated[float, POSITIVE]
    """`release_turn` for a joint's position in the world [m]."""
    short_release_turn: Annotated[float, POSITIVE]
    """Jumps on both sides above which fewer equal frames than `still_frames` count as frozen [rad]."""
    still_frames: Annotated[int, COUNT]
    """Smallest number of equal frames of a single joint that count as frozen."""


@dataclass(frozen=True, kw_only=True)
class FillSettings:
    """Longest gaps that are filled."""

    short_gap_s: Annotated[float, NOT_NEGATIVE]
    """Longest gap that is filled by a polynomial [s]."""
    longest_gap_s: Annotated[float, NOT_NEGATIVE]
    """Longest gap that is filled from similar motion of the same clip, and flagged; longer gaps are cut [s]."""

    def __post_init__(self) -> None:
        check(increasing(self, "short_gap_s", "longest_gap_s"))


@dataclass(frozen=True, kw_only=True)
class FloorSettings:
    """Estimation of the ground height."""

    ball_height: Annotated[float, Range(0.0, 0.2)]
    """Height of the joint at the ball of the foot above the ground in stance [m]; defines z = 0."""
    band: Annotated[float, POSITIVE]
    """Width of the height band with the most stance frames [m]."""
    slow_m_s: Annotated[float, POSITIVE]
    """Speed below which a toe may be in stance [m/s]."""
    drift_limit: Annotated[float, NOT_NEGATIVE]
    """Change of the ground height over the clip from which it is removed [m]."""
    offset_limit: Annotated[float, NOT_NEGATIVE]
    """Ground height above which it is reported [m]; it is removed in any case."""


@dataclass(frozen=True, kw_only=True)
class SmoothSettings:
    """Zero-phase low pass."""

    cutoff_hz: Annotated[float, Range(0.5, 1000.0)]
    """Cutoff for all skills except the fast ones [Hz]."""
    fast_cutoff_hz: Annotated[float, Range(0.5, 1000.0)]
    """Cutoff for the fast skills [Hz]."""
    fast_skills: Annotated[tuple[str, ...], OneOf(LABELS)]


@dataclass(frozen=True, kw_only=True)
class ContactSettings:
    """Limits for foot contacts and foot slip."""

    height: Annotated[float, POSITIVE]
    """Height above a point's own stance height below which it may be in contact [m]."""
    speed_floor_m_s: Annotated[float, NOT_NEGATIVE]
    """Lower bound of the adaptive speed limit of a contact [m/s]."""
    speed_on_m_s: Annotated[float, POSITIVE]
    """Upper bound of the adaptive speed limit below which a contact begins [m/s]."""
    speed_off_m_s: Annotated[float, POSITIVE]
    """Speed above which a contact ends [m/s]."""
    shortest_s: Annotated[float, NOT_NEGATIVE]
    """Contacts and gaps shorter than this are removed [s]."""
    slip_limit_m_s: Annotated[float, NOT_NEGATIVE]
    """Largest mean slip of the feet in contact when the person stands still [m/s]."""
    slip_per_speed: Annotated[float, NOT_NEGATIVE]
    """Increase of the slip limit with the pelvis speed [(m/s)/(m/s)]."""
    skate_limit_m_s: Annotated[float, POSITIVE]
    """A stretch is cut if the slowest point near the ground is rarely slower than this [m/s]."""
    plant_m_s: Annotated[float, NOT_NEGATIVE]
    """Largest slip that is corrected by moving the whole body, and largest speed of that correction [m/s]. For the mean
    over a stretch, the limit grows with `slip_per_speed`, as `slip_limit_m_s` does."""
    longest_flight_s: Annotated[float, NOT_NEGATIVE]
    """Longest plausible flight phase of a person [s]."""

    def __post_init__(self) -> None:
        check(increasing(self, "speed_floor_m_s", "speed_on_m_s", "speed_off_m_s"))


@dataclass(frozen=True, kw_only=True)
class RobotSettings:
    """Limits for robot trajectories."""

    speed_limit_share: Annotated[float, POSITIVE]
    """Share of the motor's speed limit above which a joint step is a jump."""
    default_speed_limit: Annotated[float, POSITIVE]
    """Joint speed limit without a robot [rad/s]."""
    clamp: Annotated[float, NOT_NEGATIVE]
    """Largest violation of a joint limit that is clamped [rad]."""


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
    """Duration below which pieces are dropped [s]."""
    heading_s: Annotated[float, NOT_NEGATIVE]
    """Time at the start of a piece over which the pelvis's facing is averaged to get its heading [s]."""
