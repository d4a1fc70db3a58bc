"""IK targets of each frame, from the human's motion and the proportions of human and robot."""

import dataclasses
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float

from pipeline import rotation, time_series
from pipeline.clips.human_clip import HumanClip
from pipeline.clips.human_clip import body as body_index
from pipeline.errors import ClipError
from pipeline.quality.retargeting import LIMBS
from pipeline.retarget import foot_plan, foot_reach, foot_spacing
from pipeline.retarget.foot_plan import PITCH, YAW, Sole, X, Z, median, percentile
from pipeline.retarget.foot_reach import Hips
from pipeline.retarget.narrowing import lateral_share, narrowed
from pipeline.retarget.robot_body import RobotBody
from pipeline.retarget.settings import RetargetSettings
from pipeline.retarget.trunk_lean import limited_lean

FLAT_PERCENTILE = 30.0
"""Percentile of the foot's pitch over its stance frames that is the flat foot; the upper part is heel rise."""

FLAT_TOLERANCE = 0.05
"""Pitch above that of the flat foot up to which a foot counts as flat [rad]."""

LIMB_STARTS, LIMB_ENDS = ([body_index(end) for end in ends] for ends in list(zip(*LIMBS, strict=True))[1:])
"""Bodies at the upper and the lower end of each of `LIMBS`."""

PLAUSIBLE_LEG = (0.3, 1.4)
"""Plausible leg lengths of a person [m]; a length outside this range means a wrong unit."""


@dataclass(frozen=True, kw_only=True)
class Proportions:
    """Proportions of a person, constant over the clip."""

    leg: float
    """Hip to knee plus knee to ankle, median, mean of both sides [m]."""
    hip_half_width: float
    """Half the distance between the hip joints [m]."""
    ankle_height: Float[np.ndarray, " 2"]
    """Height of each ankle while the foot is flat on the ground, (left, right) [m]."""
    flat_pitch: Float[np.ndarray, " 2"]
    """Angle of the line from toe to ankle over the ground while the foot is flat, (left, right) [rad]."""
    ankle_to_toe: Float[np.ndarray, " 2"]
    """Horizontal distance from ankle to toe while the foot is flat, (left, right) [m]."""


def measure(clip: HumanClip, contacts: Bool[np.ndarray, "t 2"]) -> Proportions:
    """Measure the person's proportions. Raises ClipError if the leg length is implausible."""
    hips, knees, ankles, toes = (clip.both(part) for part in ("hip", "knee", "ankle", "toe"))
    legs = median(rotation.length(hips - knees)) + median(rotation.length(knees - ankles))
    pitches, feet = foot_pitch(ankles, toes), median(rotation.length(ankles - toes))
    ankle_height, flat_pitch = np.empty(2), np.empty(2)
    for side in range(2):
        pitch, height = pitches[:, side], toes[:, side, 2]
        stance = contacts[:, side] if contacts[:, side].any() else height <= percentile(height, 10.0)
        flat_pitch[side] = percentile(pitch[stance], FLAT_PERCENTILE)
        flat = pitch[stance] <= flat_pitch[side] + FLAT_TOLERANCE
        ankle_height[side] = median(ankles[stance, side, 2][flat])
    leg = float(np.mean(legs))
    if not PLAUSIBLE_LEG[0] <= leg <= PLAUSIBLE_LEG[1]:
        low, high = PLAUSIBLE_LEG
        raise ClipError(clip.name, "leg_length", f"the legs are {leg:.3g} m long, a person's are {low} to {high} m.")
    return Proportions(
        leg=leg,
        hip_half_width=float(median(rotation.length(hips[:, 0] - hips[:, 1]))) / 2.0,
        ankle_height=ankle_height,
        flat_pitch=flat_pitch,
        ankle_to_toe=feet * np.cos(flat_pitch),
    )


def foot_pitch(ankle_pos_w: Float[np.ndarray, "*n 3"], toe_pos_w: Float[np.ndarray, "*n 3"]) -> Float[np.ndarray, "*n"]:
    """Angle of the line from toe to ankle over the ground [rad]; it grows as the heel rises, up to pi/2."""
    line = ankle_pos_w - toe_pos_w
    return np.arctan2(line[..., 2], np.linalg.norm(line[..., :2], axis=-1))


@dataclass(frozen=True, kw_only=True)
class Targets:
    """Targets of the solver, world frame."""

    contacts: Bool[np.ndarray, "t 2"]
    """Stance, (left, right)."""
    grip: Float[np.ndarray, "t 2"]
    """Interpolation factor of the foot weights: 1 in stances and in swings close to the other foot, 0 in others."""
    foot_pos_w: Float[np.ndarray, "t 2 3"]
    """Ankles (left, right) [m]."""
    foot_quat_w: Float[np.ndarray, "t 2 4"]
    """Feet, parallel to the sole, x to the toes."""
    pelvis_pos_w: Float[np.ndarray, "t 3"]
    """Origin of the pelvis link [m]."""
    pelvis_held: Float[np.ndarray, " t"]
    """Interpolation factor of the pelvis's horizontal weight: 0 `pelvis_horizontal`, 1 `pelvis_held`."""
    pelvis_smoothed: Float[np.ndarray, " t"]
    """Interpolation factor of the weight of a smoothed pelvis path: 0 not used, 1 `path_smoothed`."""
    trunk_quat_w: Float[np.ndarray, "t 4"]
    waist_pos: Float[np.ndarray, " t"]
    """Angle about the trunk's z by which the pelvis is turned to the left relative to the trunk [rad]."""
    limb_dir_w: Float[np.ndarray, "t 8 3"]
    """Unit directions of `LIMBS`."""
    leg_ratio: float
    """Robot length / human length used for all positions; the robot's speed / the human's."""
    foothold_moved: float
    """Largest outward shift [m] of a foothold because of the hips' adduction limit."""
    lateral_share: float
    """Least share of the human's lateral motion that is kept; 1 where no step is narrowed."""
    lean_taken_off: float
    """Largest reduction [rad] of the trunk's lean relative to the human's chest."""


def plan_targets(
    clip: HumanClip, contacts: Bool[np.ndarray, "t 2"], body: RobotBody, settings: RetargetSettings
) -> Targets:
    """Plan the IK targets of a clip at the robot's rate. Raises ClipError if the skeleton is implausible.

    Args:
        clip: human motion at the robot's rate, without missing samples
        contacts: stances (left, right)
        body: geometry of the robot
        settings: settings of KP3, scaled to the robot
    """
    person = measure(clip, contacts)
    ratio = settings.leg_scale * body.leg / person.leg
    clip = _smoothed(clip, settings.smooth_hz)
    lateral_w = _horizontal(clip.pos("left_hip") - clip.pos("right_hip"))
    heading = np.unwrap(np.arctan2(-lateral_w[:, 0], lateral_w[:, 1]))
    widening_w = lateral_w[:, :2] * (body.hip_half_width - ratio * person.hip_half_width)
    trunk_quat_w, lean_taken_off = limited_lean(clip.quat("chest"), clip.quat("pelvis"), settings.trunk)
    turns = body.waist is not None
    waist_pos = waist_angle(trunk_quat_w, heading) if turns else np.zeros(clip.frame_count)

    def centre_of(clip: HumanClip) -> Float[np.ndarray, "t 3"]:
        return ratio * (clip.both("hip").mean(axis=1) - [0.0, 0.0, person.ankle_height.mean()]) + [
            0.0,
            0.0,
            body.sole.depth,
        ]

    centre_w = centre_of(clip)
    hips = foot_reach.hips_of(centre_w, trunk_quat_w, waist_pos, body)
    raws = _scaled_feet(clip, ratio, widening_w, heading, person, body.sole)
    share = lateral_share(foot_reach.lacking(raws, hips).max(axis=0), settings.narrowing, clip.fps)
    if (share < 1.0).any():
        clip = narrowed(clip, lateral_w, share)
        centre_w = centre_of(clip)
        hips = foot_reach.hips_of(centre_w, trunk_quat_w, waist_pos, body)
        raws = _scaled_feet(clip, ratio, widening_w, heading, person, body.sole)
    feet, moved = _plan_feet(clip, raws, contacts, ratio, widening_w, hips, person, body, settings)
    wary = settings.feet.spacing + settings.feet.wary
    return Targets(
        contacts=contacts,
        grip=(contacts | (foot_spacing.overlap(feet, heading, body.sole, wary) > 0.0)[:, None]).astype(float),
        foot_pos_w=feet[..., X : Z + 1].swapaxes(0, 1).copy(),
        foot_quat_w=_foot_quat(feet.swapaxes(0, 1)),
        pelvis_pos_w=centre_w
        - rotation.rotate(trunk_quat_w, rotation.rotate(rotation.about_z(waist_pos), body.hip_centre_b)),
        pelvis_held=np.zeros(clip.frame_count),
        pelvis_smoothed=np.zeros(clip.frame_count),
        trunk_quat_w=trunk_quat_w,
        waist_pos=waist_pos,
        limb_dir_w=rotation.normalize(clip.body_pos_w[:, LIMB_ENDS] - clip.body_pos_w[:, LIMB_STARTS]),
        leg_ratio=ratio,
        foothold_moved=moved,
        lateral_share=float(share.min()),
        lean_taken_off=lean_taken_off,
    )


def waist_angle(trunk_quat_w: Float[np.ndarray, "t 4"], heading: Float[np.ndarray, " t"]) -> Float[np.ndarray, " t"]:
    """Angle [rad] about the trunk's z by which a link must turn for its twist about world z to be `heading`.

    For trunk (w, x, y, z) and a turn by 2a about its z, the product's w and z are w cos a - z sin a and
    w sin a + z cos a: their ratio's angle is the trunk's own plus a.
    """
    return rotation.wrap(heading - rotation.yaw_of(trunk_quat_w))


def _plan_feet(
    clip: HumanClip,
    raws: Float[np.ndarray, "2 t 5"],
    contacts: Bool[np.ndarray, "t 2"],
    ratio: float,
    widening_w: Float[np.ndarray, "t 2"],
    hips: Hips,
    person: Proportions,
    body: RobotBody,
    settings: RetargetSettings,
) -> tuple[Float[np.ndarray, "2 t 5"], float]:
    """Plans of both feet (ankle x, y, z, yaw, pitch) within reach, spaced and above ground, and `foothold_moved` [m].

    Args:
        clip: human motion
        raws: both feet, see `_scaled_feet`; their yaw is the pelvis's
        contacts: stances
        ratio: robot length / human length
        widening_w: offset of the left foot to the left; the right foot gets its negative [m]
        hips: the robot's hips along the planned pelvis path
        person: the person's proportions
        body: the robot's geometry
        settings: settings of KP3
    """
    feet, sole, heading = settings.feet, body.sole, raws[0, :, YAW]
    toes_w = clip.both("toe")
    line_w = toes_w - clip.both("ankle")
    toe_yaw = np.arctan2(line_w[..., 1], line_w[..., 0])
    scaled_toe_w = ratio * toes_w[..., :2] + np.stack([widening_w, -widening_w], axis=1)
    ankle_to_toe = ratio * person.ankle_to_toe
    locked, plans = np.empty_like(raws), np.empty_like(raws)
    for side, raw in enumerate(raws):
        toe_w, yaw, way = scaled_toe_w[:, side], toe_yaw[:, side], float(ankle_to_toe[side])
        locked[side] = foot_plan.lock_stances(raw, contacts[:, side], toe_w, yaw, way, sole, feet)
    spread = feet.spacing_s * clip.fps
    moved = foot_reach.bring_footholds_in_reach(locked, contacts, heading, hips, feet.reach_free)
    foot_spacing.space_footholds(locked, contacts, heading, sole, feet.spacing, round(spread))
    slope = max(1, round(feet.slope_s * clip.fps))
    for side in range(2):
        plans[side] = foot_plan.spread(raws[side], locked[side], contacts[:, side], slope)
    foot_reach.bring_swings_in_reach(plans, contacts, heading, hips, feet.reach_free, spread)
    foot_spacing.space_swings(plans, contacts, heading, sole, feet.spacing, spread)
    above = [foot_plan.keep_above_ground(plan, contacts[:, side], sole, feet) for side, plan in enumerate(plans)]
    return np.stack(above), moved


def _scaled_feet(
    clip: HumanClip,
    ratio: float,
    widening_w: Float[np.ndarray, "t 2"],
    heading: Float[np.ndarray, " t"],
    person: Proportions,
    sole: Sole,
) -> Float[np.ndarray, "2 t 5"]:
    """Human feet scaled to the robot, before stances: ankle x, y, z [m], yaw (the pelvis's), pitch [rad]."""
    ankles, toes = clip.both("ankle"), clip.both("toe")
    raws = np.empty((2, clip.frame_count, 5))
    by_frame = raws.swapaxes(0, 1)
    by_frame[..., :Z] = ratio * ankles[..., :2] + np.stack([widening_w, -widening_w], axis=1)
    by_frame[..., Z] = ratio * (ankles[..., 2] - person.ankle_height) + sole.depth
    by_frame[..., YAW] = heading[:, None]
    by_frame[..., PITCH] = foot_pitch(ankles, toes) - person.flat_pitch
    return raws


def _foot_quat(feet: Float[np.ndarray, "*n 5"]) -> Float[np.ndarray, "*n 4"]:
    pitch = rotation.from_axis_angle(np.array([0.0, 1.0, 0.0]), feet[..., PITCH])
    return rotation.multiply(rotation.about_z(feet[..., YAW]), pitch)


def _horizontal(vectors: Float[np.ndarray, "t 3"]) -> Float[np.ndarray, "t 3"]:
    """Unit vectors along the horizontal part."""
    return rotation.normalize(vectors * [1.0, 1.0, 0.0])


def _smoothed(clip: HumanClip, cutoff_hz: float) -> HumanClip:
    """Low-pass the positions and the chest's orientation; the other orientations are not targets."""
    chest = body_index("chest")
    chest_quat_w = rotation.make_continuous(clip.body_quat_w[:, chest])
    flat_pos_w = clip.body_pos_w.reshape(clip.frame_count, -1)
    smooth = time_series.smooth(np.concatenate([flat_pos_w, chest_quat_w], axis=1), clip.fps, cutoff_hz)
    quat_w = clip.body_quat_w.copy()
    quat_w[:, chest] = rotation.normalize(smooth[:, -4:])
    return dataclasses.replace(clip, body_pos_w=smooth[:, :-4].reshape(clip.body_pos_w.shape), body_quat_w=quat_w)
