"""KP2 for trajectories that are a robot's already: finite, no jumps, limits, placed like all others.

A sole touches within a few millimetres of where soles stand in the clip; how few follows from how much the
height of standing soles varies there. So neither the height of the floor nor noise has to be known.

Spikes and dropouts leave the motion in one step and come back in one step. Spike: one or two frames. They are compared
with the cubic through the two frames before and the two after. A spike is off by many times what frames nearby are off;
where a motion is rough everywhere nothing stands out. Dropout: more frames, up to a second. Its edges are two opposite
steps of about the same size, each many times the steps beside it. What the joint did in between is not known, so the
frames are cut; a step without its opposite is no dropout.
"""

import dataclasses
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float
from scipy.ndimage import median_filter

from pipeline import rotation, time_series
from pipeline.clips.outcome import Outcome, Piece, Reason
from pipeline.clips.robot_clip import RobotClip
from pipeline.errors import ClipError
from pipeline.quality.sole import sole_motion
from pipeline.repair import reasons
from pipeline.repair.contacts import Contacts
from pipeline.repair.floor import densest, mean_heading
from pipeline.repair.settings import RepairSettings, RobotSettings
from pipeline.repair.tree import FrameMask
from pipeline.robot import Robot

BAND = 0.01
"""Width of the band of heights in which soles stand [m]."""
SPREADS, LEAST, MOST = 2.0, 0.0015, 0.01
"""A sole touches below this many times the spread of standing soles' heights over their median, within these [m]."""
FASTEST = 1.5
"""A corner faster than this over the ground does not stand [m/s]."""
SHORTEST_S = 0.04
"""Contacts and gaps shorter than this are not believed."""


def label_robot_contacts(clip: RobotClip, robot: Robot) -> Contacts:
    """Foot on the ground (left, right)."""
    sole = sole_motion(clip, robot)
    low = sole.height
    standing = low[np.abs(low - densest(low.ravel(), BAND)) <= BAND / 2.0]
    ground = float(np.median(standing))
    spread = 1.4826 * float(np.median(np.abs(standing - ground)))
    limit = ground + float(np.clip(SPREADS * spread, LEAST, MOST))
    touching = (low < limit) & (sole.lowest_corner_speed < FASTEST)
    shortest = round(SHORTEST_S * clip.fps)
    return np.stack([time_series.without_short_runs(side, shortest) for side in touching.T], axis=1)


QUAT_NORM_CHANGE = 0.01
CUT = "these frames are cut"


def process_robot(
    clip: RobotClip, start: int, stop: int, *, settings: RepairSettings, robot: Robot | None = None
) -> Outcome:
    """The window of a robot's trajectory without frames that no robot can show.

    Spikes of a frame or two are filled. Frames of longer dropouts, frames that are not finite and frames whose joints
    move faster than a jump are cut.
    Joint limits passed by a little are clamped where the robot is given; more than that is the feasibility stage's
    matter.
    """
    speed_limit = _speed_limit(clip, robot, settings.robot)
    clip, spikes = without_spikes(clip)
    dropouts = find_dropouts(clip, settings.detection.longest_spike_s)
    bad, gathered = _bad_frames(clip, speed_limit, dropouts)
    clamped, clamps = _clamped(clip, robot, settings.robot)
    gathered += [*spikes, *clamps]
    pieces = []
    whole = [(low + start, high + start) for low, high in time_series.runs(~bad[start:stop])]
    kept = [(low, high) for low, high in whole if (high - low) / clip.fps >= settings.min_seconds]
    gathered += [
        reasons.too_short(low, high, clip.fps, settings.min_seconds) for low, high in whole if (low, high) not in kept
    ]
    for number, (low, high) in enumerate(kept, start=1):
        piece = clamped.cut(low, high, f"{clip.name}+{number}" if len(kept) > 1 else clip.name)
        if robot is not None and clip.contacts is None:
            piece = dataclasses.replace(piece, contacts=label_robot_contacts(piece, robot))
        pieces.append(_placed(piece, low, settings))
    filled = sum(round(((each.stop_s or 0.0) - (each.start_s or 0.0)) * clip.fps) for each in spikes)
    cut = stop - start - sum(piece.clip.frame_count for piece in pieces)
    return Outcome(pieces=tuple(pieces), reasons=tuple(gathered), numbers={"filled_frames": filled, "cut_frames": cut})


def _speed_limit(clip: RobotClip, robot: Robot | None, settings: RobotSettings) -> Float[np.ndarray, " j"]:
    """Joint speed above which a step is a jump [rad/s] (j,). Raises ClipError for joints the robot lacks."""
    if robot is None:
        return np.full(len(clip.joint_names), settings.speed_limit_share * settings.default_speed_limit)
    if clip.joint_names != robot.joint_names:
        problem = f"its joints are {', '.join(clip.joint_names)}; the robot '{robot.name}' has others"
        raise ClipError(clip.name, "joints", problem)
    return settings.speed_limit_share * robot.motor_speed_limit


def _bad_frames(clip: RobotClip, speed_limit: np.ndarray, dropouts: "list[Dropout]") -> tuple[FrameMask, list[Reason]]:
    """Frames to cut, and why."""
    norm = np.linalg.norm(clip.root_quat_w, axis=1)
    finite = np.isfinite(clip.root_pos_w).all(axis=1) & np.isfinite(clip.joint_pos).all(axis=1) & np.isfinite(norm)
    unit = np.abs(np.where(finite, norm, 1.0) - 1.0) <= QUAT_NORM_CHANGE
    found = (("missing", "not a number", ~finite), ("no_rotation", "root quaternion not unit", ~unit))
    gathered = [
        reasons.refused(code, f"{problem}; {CUT}", frames, clip.fps)
        for code, problem, bad in found
        for frames in time_series.runs(bad)
    ]
    away = np.zeros(clip.frame_count, dtype=bool)
    for dropout in dropouts:
        away[dropout.start : dropout.stop] = True
        gathered.append(dropout.reason(clip.fps))
    known = finite & ~away
    speed = np.abs(np.diff(np.where(known[:, None], clip.joint_pos, 0.0), axis=0)) * clip.fps
    speed[~(known[1:] & known[:-1])] = 0.0
    too_fast = np.concatenate([[False], (speed > speed_limit).any(axis=1)])
    too_fast[:-1] |= too_fast[1:]
    for low, high in time_series.runs(too_fast):
        span = speed[low : high - 1]
        joint = int(np.argmax((span / speed_limit).max(axis=0)))
        fastest, limit = float(span[:, joint].max()), float(speed_limit[joint])
        problem = (
            f"joint '{clip.joint_names[joint]}' moves at {fastest:.1f} rad/s, allowed are {limit:.1f} rad/s; {CUT}"
        )
        gathered.append(reasons.refused("joint_jump", problem, (low, high), clip.fps, fastest, limit, "rad/s"))
    return ~known | ~unit | too_fast, gathered


def _clamped(clip: RobotClip, robot: Robot | None, settings: RobotSettings) -> tuple[RobotClip, list[Reason]]:
    """The clip with joints that pass their limits by a little put on them."""
    if robot is None:
        return clip, []
    over = np.maximum(clip.joint_pos - robot.joint_upper, robot.joint_lower - clip.joint_pos)
    little = (over > 0.0) & (over <= settings.clamp)
    if not little.any():
        return clip, []
    joint_pos = np.where(little, np.clip(clip.joint_pos, robot.joint_lower, robot.joint_upper), clip.joint_pos)
    gathered = []
    for joint in np.flatnonzero(little.any(axis=0)):
        most = float(over[little[:, joint], joint].max())
        passes = f"joint '{clip.joint_names[joint]}' passes its limit by up to {most:.3f} rad"
        text = f"{passes} in {little[:, joint].mean():.0%} of the frames; put on the limit"
        numbers = {"value": most, "limit": settings.clamp, "unit": "rad"}
        gathered.append(Reason(code="joint_limit", text=text, effect="repaired", **numbers))
    return dataclasses.replace(clip, joint_pos=joint_pos), gathered


def _placed(clip: RobotClip, first: int, settings: RepairSettings) -> Piece:
    """The piece heading +x from the origin; its height stays, the soles' height is the feasibility stage's."""
    quat_w = rotation.make_continuous(rotation.normalize(clip.root_quat_w))
    heading = mean_heading(quat_w[: max(1, round(settings.heading_s * clip.fps))])
    back = rotation.about_z(-heading)
    origin = np.array([*clip.root_pos_w[0, :2], 0.0])
    placed = dataclasses.replace(
        clip,
        root_pos_w=rotation.rotate(back, clip.root_pos_w - origin),
        root_quat_w=rotation.make_continuous(rotation.multiply(back, quat_w)),
    )
    numbers = {
        "seconds": clip.duration_s,
        "start_frame": first,
        "stop_frame": first + clip.frame_count,
        "heading_rad": heading,
        "origin_x_m": float(origin[0]),
        "origin_y_m": float(origin[1]),
        "floor_m": 0.0,
        "filled_frames": 0,
        "stance_slip_m_s": None,
    }
    return Piece(clip=placed, numbers=numbers)


LEAST_JOINT, LEAST_TURN, LEAST_PLACE = 0.08, 0.05, 0.015
"""Smallest spike of a joint [rad], of the root's rotation [rad] and of its position [m]: ankles that land leave
their neighbours by 0.06 rad at 50 Hz."""
TIMES_USUAL = 8.0
"""A spike is off by more than this many times the median of what frames nearby are off."""
NEAR_S = 0.5
"""Nearby [s]."""
LONGEST = 2
"""Frames of a spike at most."""
LEAST_STEPS = {"rad": 0.12, "m": 0.04}
"""Smallest step at the edges of a dropout: twice what an ankle that lands does in a frame at 50 Hz."""
TIMES_BESIDE = 3.0
"""A step of a dropout is off by more than this many times the steps before and after it."""
MOST_DIFFERENCE = 0.35
"""The steps at both edges differ by no more than this share of the larger one."""


@dataclass(frozen=True, kw_only=True)
class Dropout:
    """Frames [start, stop) in which a joint or the root is elsewhere."""

    start: int
    stop: int
    what: str
    """`joint 'Left_Knee_Pitch'`, `the root`, …"""
    size: float
    """Of the larger of the steps at its edges."""
    unit: str
    """`rad` or `m`."""

    def reason(self, fps: float) -> Reason:
        """Why the frames are cut."""
        text = f"{self.what} jumps by {self.size:.3f} {self.unit} and back; {CUT}"
        limit = LEAST_STEPS[self.unit]
        return reasons.refused("dropout", text, (self.start, self.stop), fps, self.size, limit, self.unit)


@dataclass(frozen=True, kw_only=True)
class Quantity:
    """A quantity of a robot's motion in which spikes and dropouts are sought."""

    what: str
    """`joint 'Left_Knee_Pitch'`, `the root`, …"""
    values: Float[np.ndarray, "t d"]
    size: Callable[[np.ndarray], np.ndarray]
    """Size of changes (t, d)."""
    unit: str
    least: float
    """Smallest spike."""


def _quantities(clip: RobotClip) -> list[Quantity]:
    """Every joint, then the root's position and its rotation."""
    pos, quat = clip.root_pos_w, clip.root_quat_w
    return [
        *(
            Quantity(what=f"joint '{name}'", values=values[:, None], size=np.abs, unit="rad", least=LEAST_JOINT)
            for name, values in zip(clip.joint_names, clip.joint_pos.T, strict=True)
        ),
        Quantity(what="the root", values=pos, size=rotation.length, unit="m", least=LEAST_PLACE),
        Quantity(what="the root's rotation", values=quat, size=_quat_angle, unit="rad", least=LEAST_TURN),
    ]


def without_spikes(clip: RobotClip) -> tuple[RobotClip, list[Reason]]:
    """The clip with its spikes filled from the frames around, and a reason for each. Missing frames are left alone."""
    joints, pos, quat = clip.joint_pos.copy(), clip.root_pos_w.copy(), clip.root_quat_w.copy()
    gathered = []
    for one, filled in zip(_quantities(clip), [*joints.T[:, :, None], pos, quat], strict=True):
        for start, stop in _spikes(one, clip.fps):
            made, there = _bridge(one.values, start, stop), one.values[start:stop]
            if filled is quat:
                made = rotation.normalize(made)
                off = rotation.angle_between(made, there)
            else:
                off = one.size(made - there)
            filled[start:stop] = made
            gathered.append(_reason(one, start, stop, clip.fps, float(np.max(off))))
    if not gathered:
        return clip, []
    return dataclasses.replace(clip, joint_pos=joints, root_pos_w=pos, root_quat_w=quat), gathered


def find_dropouts(clip: RobotClip, longest_s: float) -> list[Dropout]:
    """Dropouts of joints and root, the first one first, of at most `longest_s` [s]."""
    longest = max(round(longest_s * clip.fps), LONGEST + 1)
    found = [
        Dropout(start=start, stop=stop, what=one.what, size=step, unit=one.unit)
        for one in _quantities(clip)
        for start, stop, step in _dropouts(one, clip.fps, longest)
    ]
    return sorted(found, key=lambda dropout: (dropout.start, dropout.stop, dropout.what))


def _dropouts(one: Quantity, fps: float, longest: int) -> list[tuple[int, int, float]]:
    """First frame, frame after the last and largest step of each dropout of a quantity."""
    size, least = one.size, LEAST_STEPS[one.unit]
    steps = np.diff(one.values, axis=0)  # steps[i] leads from frame i to i + 1
    if len(steps) < LONGEST + 3:
        return []
    sizes = np.nan_to_num(np.asarray(size(steps)).reshape(len(steps)))
    own = steps.copy()
    own[1:-1] -= 0.5 * (steps[:-2] + steps[2:])
    off = np.nan_to_num(np.asarray(size(own)).reshape(len(own)))
    usual = median_filter(off, size=2 * max(3, round(NEAR_S * fps)) + 1, mode="mirror")
    beside = np.maximum(sizes[:-2], sizes[2:])
    edges = 1 + np.flatnonzero(
        (off[1:-1] > np.maximum(least, TIMES_USUAL * usual[1:-1])) & (off[1:-1] > TIMES_BESIDE * beside)
    )
    found, after = [], 0
    for place, first in enumerate(edges):
        if first < after:
            continue
        for second in edges[place + 1 :]:
            if second - first > longest:
                break
            larger = float(max(off[first], off[second]))
            difference = float(np.asarray(size((own[first] + own[second])[None])).reshape(-1)[0])
            if second - first > LONGEST and difference <= MOST_DIFFERENCE * larger:
                found.append((int(first) + 1, int(second) + 1, larger))
                after = second + 1
                break
    return found


def _quat_angle(change: Float[np.ndarray, "t 4"]) -> Float[np.ndarray, " t"]:
    """Half the angle of a small turn is the length of its quaternion's change."""
    return 2.0 * np.linalg.norm(change, axis=-1)


def _spikes(one: Quantity, fps: float) -> list[tuple[int, int]]:
    """Stretches [start, stop) of one or two frames that are spikes of a quantity."""
    size, values = one.size, one.values
    count = len(values)
    found: list[tuple[int, int]] = []
    taken = np.zeros(count, dtype=bool)
    for length in range(1, LONGEST + 1):
        if count < length + 6:
            break
        off = np.zeros(count)
        starts = np.arange(2, count - length - 1)
        gaps = [size(values[starts + place] - _cubic(values, starts, length, place)) for place in range(length)]
        off[starts] = np.nan_to_num(np.min([np.asarray(gap).reshape(len(starts)) for gap in gaps], axis=0))
        usual = median_filter(off, size=2 * max(3, round(NEAR_S * fps)) + 1, mode="mirror")
        peak = _peaks(off) & (off > np.maximum(one.least, TIMES_USUAL * usual)) & (off > 0.0)
        for start in np.flatnonzero(peak).tolist():
            around = slice(max(start - 2, 0), start + length + 2)
            if not taken[around].any() and _comes_back(size, values, start, length, float(off[start])):
                found.append((start, start + length))
                taken[around] = True
    return sorted(found)


def _peaks(off: Float[np.ndarray, " t"]) -> FrameMask:
    """Frames at which a quantity is largest of three on each side."""
    padded = np.pad(off, 3)
    return off >= np.max([padded[shift : shift + len(off)] for shift in range(7)], axis=0)


def _comes_back(size, values: Float[np.ndarray, "t d"], start: int, length: int, off: float) -> bool:
    """A jump out and one back, each larger than the steps around, and the way over the spike is short against it."""
    stop = start + length
    out, back = values[start] - values[start - 1], values[stop] - values[stop - 1]
    over, before = values[stop] - values[start - 1], values[start - 1] - values[start - 2]
    steps = np.stack([out, back, over, before, values[stop + 1] - values[stop]])
    out_size, back_size, way, step_before, step_after = (float(each) for each in np.asarray(size(steps)).reshape(5))
    around = max(step_before, step_after)
    if float(out @ back) >= 0.0 or min(out_size, back_size) <= 2.0 * around:
        return False
    return way <= 0.5 * off + (length + 1) * around


def _cubic(values: Float[np.ndarray, "t d"], starts: np.ndarray, length: int, place: int) -> Float[np.ndarray, "n d"]:
    """What the two frames before and the two after stretches of `length` frames say of their frame `place`."""
    times = np.array([-2.0, -1.0, length, length + 1.0])
    weights = [np.prod([(place - other) / (time - other) for other in times if other != time]) for time in times]
    frames = (starts - 2, starts - 1, starts + length, starts + length + 1)
    return np.sum([weight * values[each] for weight, each in zip(weights, frames, strict=True)], axis=0)


def _bridge(values: Float[np.ndarray, "t d"], start: int, stop: int) -> Float[np.ndarray, "n d"]:
    """The frames [start, stop) as those around them say."""
    return np.concatenate([_cubic(values, np.array([start]), stop - start, place) for place in range(stop - start)])


def _reason(one: Quantity, start: int, stop: int, fps: float, size: float) -> Reason:
    frames = f"frame {start}" if stop - start == 1 else f"frames {start}-{stop - 1}"
    text = f"{frames}: {one.what} is {size:.3f} {one.unit} off what the frames around say; filled"
    numbers = {"value": size, "limit": one.least, "unit": one.unit}
    return Reason.of_frames("spike", text, "repaired", (start, stop), fps, **numbers)
