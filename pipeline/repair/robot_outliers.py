"""Spikes and dropouts of a robot's motion.

In both, a joint or the root leaves the motion in one step and comes back in one step.

Spike: one or two frames. They are compared with the cubic through the two frames before and the two after, and differ
from it many times more than frames nearby do; where a motion is rough everywhere, no spike is found. They are filled.

Dropout: more frames, up to a second. Its edges are two opposite steps of about the same size, each many times the steps
beside it; a step without its opposite is no dropout. What the joint did in between is not known, so they are cut.
"""

import dataclasses
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float
from scipy.ndimage import median_filter

from pipeline import rotation
from pipeline.clips.outcome import Reason
from pipeline.clips.robot_clip import RobotClip
from pipeline.repair import reasons
from pipeline.repair.tree import FrameMask

LEAST_JOINT, LEAST_TURN, LEAST_PLACE = 0.08, 0.05, 0.015
"""Smallest spike of a joint [rad], of the root's rotation [rad] and of its position [m]: at touchdown, an
ankle deviates from its neighbour frames by 0.06 rad at 50 Hz."""
TIMES_USUAL = 8.0
"""A spike's deviation exceeds the median deviation of nearby frames by at least this factor."""
NEAR_S = 0.5
"""Time range of nearby frames [s]."""
LONGEST = 2
"""Most frames of a spike."""
LEAST_STEPS = {"rad": 0.12, "m": 0.04}
"""Smallest step at the edges of a dropout: twice the step of an ankle at touchdown at 50 Hz."""
TIMES_BESIDE = 3.0
"""A step at the edge of a dropout exceeds the steps before and after it by this factor."""
MOST_DIFFERENCE = 0.35
"""The steps at both edges differ by no more than this share of the larger one."""


@dataclass(frozen=True, kw_only=True)
class Dropout:
    """Frames [start, stop) in which a joint or the root is away from its motion."""

    start: int
    stop: int
    what: str
    """`joint 'Left_Knee_Pitch'`, `the root`, …"""
    size: float
    """Size of the larger step at the edges, in `unit`."""
    unit: str
    """`rad` or `m`."""

    def reason(self, fps: float) -> Reason:
        """The reason for cutting the frames."""
        text = f"{self.what} jumps by {self.size:.3f} {self.unit} and back; {reasons.CUT}"
        limit = LEAST_STEPS[self.unit]
        return reasons.refused("dropout", text, (self.start, self.stop), fps, self.size, limit, self.unit)


@dataclass(frozen=True, kw_only=True)
class Quantity:
    """A quantity of a robot's motion that is checked for spikes and dropouts."""

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
    """Fill spikes from the surrounding frames, with a reason for each. Missing frames are not changed."""
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
    """Dropouts of joints and root of at most `longest_s` [s], in temporal order."""
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
    """Angle [rad] of a small rotation: twice the norm of the quaternion's change."""
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
    """Local maxima: frames whose value is the largest within three frames on each side."""
    padded = np.pad(off, 3)
    return off >= np.max([padded[shift : shift + len(off)] for shift in range(7)], axis=0)


def _comes_back(size, values: Float[np.ndarray, "t d"], start: int, length: int, off: float) -> bool:
    """Whether a spike has a jump out and one back, both larger than the steps around, and a small net displacement."""
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
    """Value at frame `place` of stretches of `length` frames, by the cubic through two frames before and two after."""
    times = np.array([-2.0, -1.0, length, length + 1.0])
    weights = [np.prod([(place - other) / (time - other) for other in times if other != time]) for time in times]
    frames = (starts - 2, starts - 1, starts + length, starts + length + 1)
    return np.sum([weight * values[each] for weight, each in zip(weights, frames, strict=True)], axis=0)


def _bridge(values: Float[np.ndarray, "t d"], start: int, stop: int) -> Float[np.ndarray, "n d"]:
    """Frames [start, stop) interpolated from the surrounding ones."""
    return np.concatenate([_cubic(values, np.array([start]), stop - start, place) for place in range(stop - start)])


def _reason(one: Quantity, start: int, stop: int, fps: float, size: float) -> Reason:
    frames = f"frame {start}" if stop - start == 1 else f"frames {start}-{stop - 1}"
    text = f"{frames}: {one.what} is {size:.3f} {one.unit} off what the frames around say; filled"
    numbers = {"value": size, "limit": one.least, "unit": one.unit}
    return Reason.of_frames("spike", text, "repaired", (start, stop), fps, **numbers)
