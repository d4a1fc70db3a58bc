"""Settings of KP3, read from `data/retarget.yaml`. One set for every skeleton."""

from dataclasses import dataclass
from typing import Annotated

from pipeline.files.ranges import COUNT, NOT_NEGATIVE, PART, POSITIVE, RATE_HZ, SHARE, Range, check, increasing
from pipeline.files.sourced import LENGTH, PER_AREA, SPEED
from pipeline.robot.size import RobotSize


@dataclass(frozen=True, kw_only=True)
class StanceSettings:
    """Contact labels in addition to the clip's own; deliberately permissive, so that no standing foot may slide."""

    toe_height: Annotated[float, NOT_NEGATIVE]
    """Highest toe over its own 5th percentile [m]."""
    toe_speed_m_s: Annotated[float, NOT_NEGATIVE]
    """Highest speed of the toe, all directions [m/s]."""
    shortest_s: Annotated[float, NOT_NEGATIVE]
    """Shorter stances are dropped [s]."""
    shortest_swing_s: Annotated[float, NOT_NEGATIVE]
    """Shorter swings between two stances of a foot are closed, because no step is that quick [s]."""


@dataclass(frozen=True, kw_only=True)
class FootSettings:
    """The foot plan."""

    ball_share: Annotated[float, SHARE]
    """Where the foot is locked in a stance: 0 the sole's centre, 1 the edge it rolls over (front or rear)."""
    heel_rise_share: Annotated[float, Range(0.0, 2.0)]
    """Heel rise of the robot in a stance / heel rise of the human."""
    heel_strike_share: Annotated[float, Range(0.0, 2.0)]
    """Toe raise of the robot at the start of a stance / toe raise of the human."""
    heel_rise_free: Annotated[float, NOT_NEGATIVE]
    """Pitch of the human foot, either way, that still counts as flat [rad]."""
    highest_pitch: Annotated[float, Range(-1.6, 1.6)]
    """Largest pitch of the planned foot, toes down [rad]."""
    lowest_pitch: Annotated[float, Range(-1.6, 1.6)]
    """Smallest pitch of the planned foot (negative: toes up) [rad]."""
    slope_s: Annotated[float, NOT_NEGATIVE]
    """Time over which the velocity difference at the end of a stance fades [s]."""
    clearance: Annotated[float, LENGTH, NOT_NEGATIVE]
    """Least height of the sole in the middle of a swing [m]."""
    spacing: Annotated[float, LENGTH, NOT_NEGATIVE]
    """Least horizontal gap between the two soles [m]."""
    reach_free: Annotated[float, LENGTH, NOT_NEGATIVE]
    """Adduction shortfall of a foot [m] above which its foothold is moved outward."""
    wary: Annotated[float, LENGTH, NOT_NEGATIVE]
    """Gap in addition to `spacing` below which a swinging foot gets the weights of a standing foot [m]."""
    spacing_s: Annotated[float, NOT_NEGATIVE]
    """Fade-in and fade-out of the shift of a swinging foot away from the other [s]."""

    def __post_init__(self) -> None:
        check(increasing(self, "lowest_pitch", "highest_pitch"))


@dataclass(frozen=True, kw_only=True)
class ClearanceSettings:
    """Corrections of the second pass."""

    correction_share: Annotated[float, SHARE]
    """Share of the stance error that is added to the target."""
    highest_correction: Annotated[float, LENGTH, NOT_NEGATIVE]
    """Limit of each coordinate of that correction [m]."""
    foot_gap: Annotated[float, LENGTH, NOT_NEGATIVE]
    """Gap between the soles of the first pass below which a swinging foot is moved outward [m]."""
    arm_distance: Annotated[float, LENGTH, NOT_NEGATIVE]
    """Least distance of forearm and hand from the line hip to knee [m]."""
    trunk_distance: Annotated[float, LENGTH, NOT_NEGATIVE]
    """Least distance of the hand from the trunk's middle line [m]."""
    leg_distance: Annotated[float, LENGTH, NOT_NEGATIVE]
    """Distance of a shank from the line hip to knee of the other leg below which feet are moved outward [m]."""
    spread_s: Annotated[float, NOT_NEGATIVE]
    """Fade-in and fade-out of corrections [s]."""


@dataclass(frozen=True, kw_only=True)
class NarrowingSettings:
    """Side steps that are narrowed and slowed instead of crossed."""

    free: Annotated[float, LENGTH, NOT_NEGATIVE]
    """Adduction shortfall of a foot [m] above which steps are narrowed."""
    full: Annotated[float, LENGTH, POSITIVE]
    """Shortfall beyond `free` at which the kept share would be 0 [m]."""
    least_share: Annotated[float, PART]
    """Least share of the lateral motion that is kept."""
    spread_s: Annotated[float, NOT_NEGATIVE]
    """Fade-in and fade-out of narrowing [s]."""


@dataclass(frozen=True, kw_only=True)
class TrunkSettings:
    """Limits of the trunk's lean when the person's back is bent."""

    free_lean: Annotated[float, Range(0.0, 1.6)]
    """Lean of the chest from upright up to which the trunk follows exactly [rad]."""
    highest_lean: Annotated[float, Range(0.0, 1.6)]
    """Asymptotic limit of the trunk's lean beyond `free_lean`, unless the pelvis leans further [rad]."""

    def __post_init__(self) -> None:
        check(increasing(self, "free_lean", "highest_lean"))


@dataclass(frozen=True, kw_only=True)
class PelvisSettings:
    """Where the pelvis is held to the human's path, and where its own path is smoothed."""

    tolerated_m_s: Annotated[float, SPEED, NOT_NEGATIVE]
    """RMS error over `window_s` of the horizontal pelvis velocity up to which a clip is not corrected [m/s]."""
    free_m_s: Annotated[float, SPEED, NOT_NEGATIVE]
    """Error below which the pelvis is not held, in clips that are corrected [m/s]."""
    astray_m_s: Annotated[float, SPEED, NOT_NEGATIVE]
    """Error above which the pelvis has the full weight `weights.pelvis_held` [m/s]."""
    window_s: Annotated[float, NOT_NEGATIVE]
    """Window of that error [s]."""
    cutoff_hz: Annotated[float, Range(0.5, 1000.0)]
    """Zero-phase low pass on the error [Hz]."""
    jerky_ratio: Annotated[float, POSITIVE]
    """Peak acceleration of the pelvis over that of the human's path, up to which a clip is not smoothed."""
    smoothed_ratio: Annotated[float, POSITIVE]
    """Acceleration over that peak above which the path is smoothed, in clips that are smoothed."""
    least_peak_m_s2: Annotated[float, POSITIVE]
    """A smaller peak of the human's path counts as this much [m/s2]."""
    path_hz: Annotated[float, Range(0.5, 1000.0)]
    """Zero-phase low pass on the horizontal offset between planned and reached pelvis on a smoothed path [Hz]."""
    fade_s: Annotated[float, NOT_NEGATIVE]
    """Fade-in and fade-out of the weights of the pelvis, and of the feet in clips where the pelvis is held [s]."""

    def __post_init__(self) -> None:
        check(increasing(self, "free_m_s", "astray_m_s"), increasing(self, "smoothed_ratio", "jerky_ratio"))


@dataclass(frozen=True, kw_only=True)
class WeightSettings:
    """Weights of the soft tasks; each multiplies a squared error. Weights that are interpolated geometrically, and
    those of pelvis, trunk and posture, which keep the program strictly convex, are above 0."""

    stance_position: Annotated[float, PER_AREA, POSITIVE]
    """[cost/m2]"""
    stance_orientation: Annotated[float, NOT_NEGATIVE]
    """[cost/rad2]"""
    swing_position: Annotated[float, PER_AREA, POSITIVE]
    """[cost/m2]"""
    swing_orientation: Annotated[float, NOT_NEGATIVE]
    """[cost/rad2]"""
    foot_height: Annotated[float, PER_AREA, POSITIVE]
    """In stance and swing [cost/m2]; `stance_position` and `swing_position` are horizontal."""
    foot_height_held: Annotated[float, PER_AREA, POSITIVE]
    """Where the pelvis is held [cost/m2]."""
    pelvis_horizontal: Annotated[float, PER_AREA, POSITIVE]
    """[cost/m2]"""
    pelvis_held: Annotated[float, PER_AREA, POSITIVE]
    """Horizontal weight where the pelvis is held to its path [cost/m2]."""
    pelvis_height: Annotated[float, PER_AREA, POSITIVE]
    """[cost/m2]"""
    path_smoothed: Annotated[float, PER_AREA, POSITIVE]
    """Of the pelvis in all directions, where it follows a smoothed path [cost/m2]."""
    foot_height_smoothed: Annotated[float, PER_AREA, POSITIVE]
    """Where the pelvis follows a smoothed path [cost/m2]."""
    trunk: Annotated[float, POSITIVE]
    """[cost/rad2]"""
    waist: Annotated[float, NOT_NEGATIVE]
    """[cost/rad2]"""
    legs: Annotated[float, POSITIVE]
    """Directions of thighs and shanks [cost/rad2]."""
    legs_held: Annotated[float, POSITIVE]
    """Where the pelvis is held [cost/rad2]."""
    arms: Annotated[float, NOT_NEGATIVE]
    """Directions of upper arms and forearms [cost/rad2]."""
    posture_first: Annotated[float, POSITIVE]
    """Toward the default pose, first pass [cost/rad2]."""
    posture_second: Annotated[float, POSITIVE]
    """Toward the smoothed first pass, second pass [cost/rad2]."""
    posture_second_held: Annotated[float, POSITIVE]
    """In clips where the pelvis is held [cost/rad2]."""


@dataclass(frozen=True, kw_only=True)
class RetargetSettings:
    """All settings of KP3."""

    calibrated_on: RobotSize
    """Robot that distances and weights are valid for; `pipeline.robot.size.scaled` converts them for another."""
    fps: Annotated[float, RATE_HZ]
    """Rate of the robot clip [Hz]."""
    leg_scale: Annotated[float, Range(0.1, 2.0)]
    """Fraction of the robot's leg length used in the length ratio to the human's leg, so that knees don't lock."""
    speed_share: Annotated[float, PART]
    """Share of the joint speed limits that may be used."""
    smooth_hz: Annotated[float, Range(0.5, 1000.0)]
    """Cutoff of the zero-phase low pass on the human's motion before planning [Hz]."""
    posture_smooth_hz: Annotated[float, Range(0.5, 1000.0)]
    """Cutoff of the zero-phase low pass on the joint motion of the first pass [Hz]."""
    settle_iterations: Annotated[int, COUNT]
    """Solver iterations on the first frame before the clip starts."""
    stance: StanceSettings
    feet: FootSettings
    clearance: ClearanceSettings
    narrowing: NarrowingSettings
    trunk: TrunkSettings
    pelvis: PelvisSettings
    weights: WeightSettings
