"""Settings of KP3, read from `data/retarget.yaml`. One set for every skeleton."""

from dataclasses import dataclass
from typing import Annotated

from pipeline.files.ranges import COUNT, NOT_NEGATIVE, PART, POSITIVE, RATE_HZ, SHARE, Range, check, increasing
from pipeline.files.sourced import LENGTH, PER_AREA, SPEED
from pipeline.robot.size import RobotSize


@dataclass(frozen=True, kw_only=True)
class StanceSettings:
    """Which foot is held still beside the clip's own contacts: a wider label, so that no standing foot is let slide."""

    toe_height: Annotated[float, NOT_NEGATIVE]
    """Highest toe over its own 5th percentile [m]."""
    toe_speed_m_s: Annotated[float, NOT_NEGATIVE]
    """Highest speed of the toe, all directions [m/s]."""
    shortest_s: Annotated[float, NOT_NEGATIVE]
    """Shorter stances are dropped [s]."""
    shortest_swing_s: Annotated[float, NOT_NEGATIVE]
    """Shorter gaps between two stances of a foot are closed: no foot steps that quickly [s]."""


@dataclass(frozen=True, kw_only=True)
class FootSettings:
    """The foot plan."""

    ball_share: Annotated[float, SHARE]
    """Where the foot is locked in a stance: 0 the sole's centre, 1 the edge it rolls over (front or rear)."""
    heel_rise_share: Annotated[float, Range(0.0, 2.0)]
    """Heel rise of the robot in a stance / heel rise of the human."""
    heel_strike_share: Annotated[float, Range(0.0, 2.0)]
    """Raised toes of the robot at the start of a stance / the human's."""
    heel_rise_free: Annotated[float, NOT_NEGATIVE]
    """Pitch of the human foot, either way, that still counts as flat [rad]."""
    highest_pitch: Annotated[float, Range(-1.6, 1.6)]
    """Largest pitch of the planned foot, toes down [rad]."""
    lowest_pitch: Annotated[float, Range(-1.6, 1.6)]
    """Smallest pitch of the planned foot (negative: toes up) [rad]."""
    slope_s: Annotated[float, NOT_NEGATIVE]
    """Time over which the speed difference at a stance's end dies away [s]."""
    clearance: Annotated[float, LENGTH, NOT_NEGATIVE]
    """Least height of the sole in the middle of a swing [m]."""
    spacing: Annotated[float, LENGTH, NOT_NEGATIVE]
    """Least gap between the two soles seen from above [m]."""
    reach_free: Annotated[float, LENGTH, NOT_NEGATIVE]
    """Way that a foot may lack to the hip's adduction limit before its foothold is moved outward [m]."""
    wary: Annotated[float, LENGTH, NOT_NEGATIVE]
    """Gap on top of `spacing` below which a swinging foot is held as firmly as a standing one [m]."""
    spacing_s: Annotated[float, NOT_NEGATIVE]
    """Time over which a swinging foot gives way to the other one [s]."""

    def __post_init__(self) -> None:
        check(increasing(self, "lowest_pitch", "highest_pitch"))


@dataclass(frozen=True, kw_only=True)
class ClearanceSettings:
    """What the second pass corrects of the first."""

    correction_share: Annotated[float, SHARE]
    """Of the stance error that is added to the target."""
    highest_correction: Annotated[float, LENGTH, NOT_NEGATIVE]
    """[m] Each coordinate of it."""
    foot_gap: Annotated[float, LENGTH, NOT_NEGATIVE]
    """Gap between the soles of the first pass below which a swinging foot is sent further out [m]."""
    arm_distance: Annotated[float, LENGTH, NOT_NEGATIVE]
    """Least distance of forearm and hand from the line hip to knee [m]."""
    trunk_distance: Annotated[float, LENGTH, NOT_NEGATIVE]
    """Least distance of the hand from the trunk's middle line [m]."""
    leg_distance: Annotated[float, LENGTH, NOT_NEGATIVE]
    """Distance of a shank from the line hip to knee of the other leg below which feet are sent further out [m]."""
    spread_s: Annotated[float, NOT_NEGATIVE]
    """Time over which corrections come and go [s]."""


@dataclass(frozen=True, kw_only=True)
class NarrowingSettings:
    """Side steps that are narrowed and slowed instead of crossed."""

    free: Annotated[float, LENGTH, NOT_NEGATIVE]
    """Way that a foot may lack to the hip's adduction limit before steps are narrowed [m]."""
    full: Annotated[float, LENGTH, POSITIVE]
    """Way beyond it at which nothing lateral would be left [m]."""
    least_share: Annotated[float, PART]
    """Least share of the lateral motion that is kept."""
    spread_s: Annotated[float, NOT_NEGATIVE]
    """Time over which narrowing comes and goes [s]."""


@dataclass(frozen=True, kw_only=True)
class TrunkSettings:
    """How far the trunk leans with a bent back."""

    free_lean: Annotated[float, Range(0.0, 1.6)]
    """Lean of the chest from upright up to which the trunk follows exactly [rad]."""
    highest_lean: Annotated[float, Range(0.0, 1.6)]
    """Lean of the trunk that is approached beyond it, where the pelvis doesn't lean further [rad]."""

    def __post_init__(self) -> None:
        check(increasing(self, "free_lean", "highest_lean"))


@dataclass(frozen=True, kw_only=True)
class PelvisSettings:
    """Where the pelvis is held to the human's path, and where its own path is smoothed."""

    tolerated_m_s: Annotated[float, SPEED, NOT_NEGATIVE]
    """Error of the first pass's horizontal pelvis velocity, RMS over `window_s`, that leaves a clip alone [m/s]."""
    free_m_s: Annotated[float, SPEED, NOT_NEGATIVE]
    """Error that is left alone in other clips [m/s]."""
    astray_m_s: Annotated[float, SPEED, NOT_NEGATIVE]
    """Error from which on the pelvis is held by `weights.pelvis_held` [m/s]."""
    window_s: Annotated[float, NOT_NEGATIVE]
    """Window of that error [s]."""
    cutoff_hz: Annotated[float, Range(0.5, 1000.0)]
    """Zero-phase low pass on the error [Hz]."""
    jerky_ratio: Annotated[float, POSITIVE]
    """Peak acceleration of the pelvis over that of the human's path, up to which a clip is left alone."""
    smoothed_ratio: Annotated[float, POSITIVE]
    """Acceleration over that peak from which on the path is smoothed in other clips."""
    least_peak_m_s2: Annotated[float, POSITIVE]
    """A smaller peak of the human's path counts as this much [m/s2]."""
    path_hz: Annotated[float, Range(0.5, 1000.0)]
    """Zero-phase low pass on the horizontal way between planned and reached pelvis where the path is smoothed [Hz]."""
    fade_s: Annotated[float, NOT_NEGATIVE]
    """Time over which the pelvis, and feet in clips where it is held, are taken hold of and let go [s]."""

    def __post_init__(self) -> None:
        check(increasing(self, "free_m_s", "astray_m_s"), increasing(self, "smoothed_ratio", "jerky_ratio"))


@dataclass(frozen=True, kw_only=True)
class WeightSettings:
    """Weights of the soft tasks; each multiplies a squared error. Above 0 are those between which is interpolated, and
    those of pelvis, trunk and posture, which keep the program strictly convex."""

    stance_position: Annotated[float, PER_AREA, POSITIVE]
    """[cost/m2]"""
    stance_orientation: Annotated[float, NOT_NEGATIVE]
    """[cost/rad2]"""
    swing_position: Annotated[float, PER_AREA, POSITIVE]
    """[cost/m2]"""
    swing_orientation: Annotated[float, NOT_NEGATIVE]
    """[cost/rad2]"""
    foot_height: Annotated[float, PER_AREA, POSITIVE]
    """In stance and swing [cost/m2]; the weights of position are for the horizontal."""
    foot_height_held: Annotated[float, PER_AREA, POSITIVE]
    """Where the pelvis is held [cost/m2]."""
    pelvis_horizontal: Annotated[float, PER_AREA, POSITIVE]
    """[cost/m2]"""
    pelvis_held: Annotated[float, PER_AREA, POSITIVE]
    """The horizontal one where the second pass holds the pelvis to its path [cost/m2]."""
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
    """All of KP3."""

    calibrated_on: RobotSize
    """The robot that distances and their weights hold for; `pipeline.robot.size.scaled` gives those of another one."""
    fps: Annotated[float, RATE_HZ]
    """Rate of the robot clip [Hz]."""
    leg_scale: Annotated[float, Range(0.1, 2.0)]
    """Share of the robot's leg length that stands for the human's, so that knees don't lock."""
    speed_share: Annotated[float, PART]
    """Share of the joint speed limits that may be used."""
    smooth_hz: Annotated[float, Range(0.5, 1000.0)]
    """Cutoff of the zero-phase low pass on the human's motion before planning [Hz]."""
    posture_smooth_hz: Annotated[float, Range(0.5, 1000.0)]
    """Cutoff of the zero-phase low pass on the first pass [Hz]."""
    settle_iterations: Annotated[int, COUNT]
    """Solves on the first frame before the clip starts."""
    stance: StanceSettings
    feet: FootSettings
    clearance: ClearanceSettings
    narrowing: NarrowingSettings
    trunk: TrunkSettings
    pelvis: PelvisSettings
    weights: WeightSettings
