"""Settings of KP3, read from `data/retarget.yaml`. One set for every skeleton."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

from pipeline.files.ranges import COUNT, NOT_NEGATIVE, PART, RATE_HZ, SHARE, Range, check, increasing
from pipeline.files.sourced import LENGTH, PER_AREA
from pipeline.robot.size import RobotSize


@dataclass(frozen=True, kw_only=True)
class StanceSettings:
    """Which foot is held still beside the clip's own contacts: a wider label, so that no standing foot is let slide."""

    toe_height: float
    """Highest toe over its own 5th percentile [m]."""
    toe_speed_m_s: float
    """Highest speed of the toe, all directions [m/s]."""
    shortest_s: float
    """Shorter stances are dropped [s]."""
    shortest_swing_s: float
    """Shorter gaps between two stances of a foot are closed: no foot steps that quickly [s]."""

    def __post_init__(self) -> None:
        check(
            self,
            toe_height=NOT_NEGATIVE,
            toe_speed_m_s=NOT_NEGATIVE,
            shortest_s=NOT_NEGATIVE,
            shortest_swing_s=NOT_NEGATIVE,
        )


@dataclass(frozen=True, kw_only=True)
class FootSettings:
    """The foot plan."""

    ball_share: float
    """Where the foot is locked in a stance: 0 the sole's centre, 1 the edge it rolls over (front or rear)."""
    heel_rise_share: float
    """Heel rise of the robot in a stance / heel rise of the human."""
    heel_strike_share: float
    """Raised toes of the robot at the start of a stance / the human's."""
    heel_rise_free: float
    """Pitch of the human foot, either way, that still counts as flat [rad]."""
    highest_pitch: float
    """Largest pitch of the planned foot, toes down [rad]."""
    lowest_pitch: float
    """Smallest pitch of the planned foot (negative: toes up) [rad]."""
    slope_s: float
    """Time over which the speed difference at a stance's end dies away [s]."""
    clearance: Annotated[float, LENGTH]
    """Least height of the sole in the middle of a swing [m]."""
    spacing: Annotated[float, LENGTH]
    """Least gap between the two soles seen from above [m]."""
    wary: Annotated[float, LENGTH]
    """Gap on top of `spacing` below which a swinging foot is held as firmly as a standing one [m]."""
    spacing_s: float
    """Time over which a swinging foot gives way to the other one [s]."""

    def __post_init__(self) -> None:
        check(
            self,
            increasing(self, "lowest_pitch", "highest_pitch"),
            ball_share=SHARE,
            heel_rise_share=Range(0.0, 2.0),
            heel_strike_share=Range(0.0, 2.0),
            heel_rise_free=NOT_NEGATIVE,
            highest_pitch=Range(-1.6, 1.6),
            lowest_pitch=Range(-1.6, 1.6),
            slope_s=NOT_NEGATIVE,
            clearance=NOT_NEGATIVE,
            spacing=NOT_NEGATIVE,
            wary=NOT_NEGATIVE,
            spacing_s=NOT_NEGATIVE,
        )


@dataclass(frozen=True, kw_only=True)
class ClearanceSettings:
    """What the second pass corrects of the first."""

    correction_share: float
    """Of the stance error that is added to the target."""
    highest_correction: Annotated[float, LENGTH]
    """[m] Each coordinate of it."""
    foot_gap: Annotated[float, LENGTH]
    """Gap between the soles of the first pass below which a swinging foot is sent further out [m]."""
    arm_distance: Annotated[float, LENGTH]
    """Least distance of forearm and hand from the line hip to knee [m]."""
    trunk_distance: Annotated[float, LENGTH]
    """Least distance of the hand from the trunk's middle line [m]."""
    spread_s: float
    """Time over which corrections come and go [s]."""

    def __post_init__(self) -> None:
        check(
            self,
            correction_share=SHARE,
            highest_correction=NOT_NEGATIVE,
            foot_gap=NOT_NEGATIVE,
            arm_distance=NOT_NEGATIVE,
            trunk_distance=NOT_NEGATIVE,
            spread_s=NOT_NEGATIVE,
        )


@dataclass(frozen=True, kw_only=True)
class WeightSettings:
    """Weights of the soft tasks; each multiplies a squared error."""

    stance_position: Annotated[float, PER_AREA]
    """[cost/m2]"""
    stance_orientation: float
    """[cost/rad2]"""
    swing_position: Annotated[float, PER_AREA]
    """[cost/m2]"""
    swing_orientation: float
    """[cost/rad2]"""
    foot_height: Annotated[float, PER_AREA]
    """In stance and swing [cost/m2]; the weights of position are for the horizontal."""
    pelvis_horizontal: Annotated[float, PER_AREA]
    """[cost/m2]"""
    pelvis_height: Annotated[float, PER_AREA]
    """[cost/m2]"""
    trunk: float
    """[cost/rad2]"""
    waist: float
    """[cost/rad2]"""
    legs: float
    """Directions of thighs and shanks [cost/rad2]."""
    arms: float
    """Directions of upper arms and forearms [cost/rad2]."""
    posture_first: float
    """Toward the default pose, first pass [cost/rad2]."""
    posture_second: float
    """Toward the smoothed first pass, second pass [cost/rad2]."""

    def __post_init__(self) -> None:
        check(self, **dict.fromkeys(vars(self), NOT_NEGATIVE))


@dataclass(frozen=True, kw_only=True)
class RetargetSettings:
    """All of KP3."""

    calibrated_on: RobotSize
    """The robot that distances and their weights hold for; `pipeline.robot.size.scaled` gives those of another one."""
    fps: float
    """Rate of the robot clip [Hz]."""
    leg_scale: float
    """Share of the robot's leg length that stands for the human's, so that knees don't lock."""
    speed_share: float
    """Share of the joint speed limits that may be used."""
    smooth_hz: float
    """Cutoff of the zero-phase low pass on the human's motion before planning [Hz]."""
    posture_smooth_hz: float
    """Cutoff of the zero-phase low pass on the first pass [Hz]."""
    settle_iterations: int
    """Solves on the first frame before the clip starts."""
    stance: StanceSettings
    feet: FootSettings
    clearance: ClearanceSettings
    weights: WeightSettings

    def __post_init__(self) -> None:
        check(
            self,
            fps=RATE_HZ,
            leg_scale=Range(0.1, 2.0),
            speed_share=PART,
            smooth_hz=Range(0.5, 1000.0),
            posture_smooth_hz=Range(0.5, 1000.0),
            settle_iterations=COUNT,
        )
