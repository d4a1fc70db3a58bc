"""Distinguish a person's rest from a pose that the recording holds because it lost the body.

A person's body rests, too: locked knees, feet in stance, still arms. It enters and leaves such a rest without a jump,
however fast the motion before and after. A recording that lost a body holds its last pose and then jumps to the new
one. Where a rest and a hold follow each other in the same pose, other rests in that pose give the rest's least
duration.
"""

import dataclasses
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from pipeline import time_series
from pipeline.repair.tree import FrameMask

BESIDE = 2
"""Distance to unknown frames below which a jump is ignored [frames]."""
COMEBACK, COMEBACK_SHARE = 5, 0.5
"""A jump that returns to the pose within this many frames, by this share of its size, is a spike next to the rest."""
PAUSE = 3
"""Most frames between two rests in one pose for which the person had already left the first."""

SAME = 1e-4
"""Largest difference of two equal poses, because rests drift slightly [entries of rotation matrices, m]."""
NEAREST = 4
"""Number of nearest rests in a pose whose shortest is the least duration of a rest: about two on either side."""


@dataclass(frozen=True, kw_only=True)
class Limits:
    """Limits for the rests of a body; jumps in [rad] or [m], durations in frames."""

    jump: float
    """Largest jump with which a person enters or leaves a rest."""
    short: float
    """Jumps on both sides above which a rest of fewer than `frames` is a hold."""
    entering: float
    """Jumps on both sides above which a rest is a hold although other rests in that pose jump as well."""
    frames: int
    """Number of equal frames that count as a rest."""
    longest: float
    """Number of frames above which a constant pose is a locked joint."""
    excursion: float
    """Most frames between a jump out of a pose and the jump back for which the frames between are the defect."""


@dataclass(frozen=True, kw_only=True)
class Rest:
    """Frames [start, stop) equal to their previous one, and the sizes of the jumps into and out of the pose."""

    start: int
    stop: int
    entered: float
    left: float
    whole: bool
    """Whether the clip neither begins nor ends in the rest."""

    @property
    def frames(self) -> int:
        return self.stop - self.start

    def jumps(self, limit: float) -> bool:
        """Whether the rest is entered or left with a jump larger than `limit`."""
        return max(self.entered, self.left) > limit


@dataclass(frozen=True, kw_only=True)
class Hold:
    """Frames [start, stop) in which the recording holds a body; `entered` if it jumped into the pose."""

    start: int
    stop: int
    entered: bool
    first: int
    last: int
    """Frames [first, last) of the pose, part of which may be the person's rest."""

    @property
    def is_sure(self) -> bool:
        """Whether all frames of the pose are a hold."""
        return (self.start, self.stop) == (self.first, self.last)


def find_holds(
    still: FrameMask,
    value: Float[np.ndarray, "t d"],
    jump: Float[np.ndarray, " t"],
    unknown: FrameMask,
    limits: Limits,
    *,
    anywhere: bool = False,
) -> list[Hold]:
    """Find the stretches in which the recording holds a body.

    Args:
        still: frames equal to the previous one
        value: pose of the body in each frame
        jump: unsteadiness of the step into each frame, in the unit of `limits`
        unknown: interpolated frames
        limits: limits for the rests
        anywhere: treat all rests as rests in one pose, as feet come to stance at different positions
    """
    count, forward = len(value), (value, jump, unknown)
    backward = (value[::-1], np.concatenate([[0.0], jump[:0:-1]]), unknown[::-1])
    rests = [
        Rest(
            start=start,
            stop=stop,
            entered=_jump(*backward, count + 1 - start),
            left=_jump(*forward, stop),
            whole=start > 1 and stop < count,
        )
        for start, stop in time_series.runs(still & ~unknown)
    ]
    poses = value[[one.stop - 1 for one in rests]]
    rests = _without_excursions(rests, poses, jump, limits)
    suspects: list[tuple[Rest, list[Rest]]] = []
    for number, one in enumerate(rests):
        if one.jumps(limits.jump) and one.frames <= limits.longest:
            there = np.full(len(rests), True) if anywhere else np.abs(poses - poses[number]).max(axis=1) < SAME
            there[number] = False
            others = [rests[other] for other in np.flatnonzero(there)]
            if _suspect(one, others, limits):
                suspects.append((one, others))
    return [
        _hold(one, others, limits)
        for one, others in suspects
        if not any(_caused_by_neighbour(one, others, *more, limits) for more in suspects)
    ]


def _jump(value: Float[np.ndarray, "t d"], jump: Float[np.ndarray, " t"], unknown: FrameMask, frame: int) -> float:
    """Size of the jump into the frame after a rest; 0 where that is unknown or the body soon jumps back."""
    if frame + BESIDE >= len(value) or unknown[frame : frame + BESIDE + 1].any():
        return 0.0
    later = slice(frame + 1, frame + 1 + COMEBACK)
    apart = np.linalg.norm(value[frame : frame + 1 + COMEBACK] - value[frame - 1], axis=1)
    back = (apart[1:] < COMEBACK_SHARE * apart[0]) & (jump[later] > COMEBACK_SHARE * jump[frame])
    return 0.0 if back.any() else float(jump[frame])


def _without_excursions(
    rests: list[Rest], poses: Float[np.ndarray, "n d"], jump: Float[np.ndarray, " t"], limits: Limits
) -> list[Rest]:
    """Set the jumps between two close rests in the same pose to 0: there, the frames between them are the defect."""
    result = list(rests)
    for number in range(len(rests) - 1):
        one, after = rests[number], rests[number + 1]
        near = after.start - one.stop <= limits.excursion and np.abs(poses[number + 1] - poses[number]).max() < SAME
        if near and min(jump[one.stop], jump[after.start - 1]) > limits.jump:
            result[number] = dataclasses.replace(result[number], left=0.0)
            result[number + 1] = dataclasses.replace(after, entered=0.0)
    return result


def _suspect(one: Rest, others: list[Rest], limits: Limits) -> bool:
    """Whether a rest with a jump is a hold. Rests of a locked joint may jump, but then all of them do."""
    if one.frames < limits.frames:
        return min(one.entered, one.left) > limits.short
    locked = any(other.jumps(limits.jump) or other.frames > limits.longest for other in others)
    return not locked or min(one.entered, one.left) > limits.entering


def _caused_by_neighbour(one: Rest, others: list[Rest], next_to: Rest, its_others: list[Rest], limits: Limits) -> bool:
    """Whether a rest jumps because an adjacent one is a hold.

    Of two adjacent rests, the hold is the one whose pose does not recur, else the one with jumps at both ends, else the
    shorter one.
    """
    if not 0 <= max(next_to.start - one.stop, one.start - next_to.stop) <= BESIDE:
        return False
    both = [min(rest.entered, rest.left) > limits.jump for rest in (one, next_to)]
    return (not others, both[0], -one.frames) < (not its_others, both[1], -next_to.frames)


def _hold(one: Rest, others: list[Rest], limits: Limits) -> Hold:
    """The held part of a rest: all of it, or, if one end is smooth, the part beyond the usual duration of such
    rests."""
    entered, left = one.entered > limits.jump, one.left > limits.jump
    start, stop = one.start - entered, one.stop
    near = sorted(
        (other for other in others if other.whole and not other.jumps(limits.jump)),
        key=lambda other: abs(other.start - start),
    )
    at_least = min((other.frames for other in near[:NEAREST]), default=0)
    if left and not entered and not any(0 < one.start - other.stop <= PAUSE for other in others):
        start = min(start + at_least, stop - 1)
    if entered and not left and not any(0 < other.start - one.stop <= PAUSE for other in others):
        stop = max(stop - at_least, start + 1)
    return Hold(start=start, stop=stop, entered=entered, first=one.start - entered, last=one.stop)


def aligned(holds: list[list[Hold]]) -> list[list[Hold]]:
    """Align the uncertain start or end of each hold with a certain hold of another body, if one fits."""
    sure = [one for body in holds for one in body if one.is_sure]

    def with_others(hold: Hold) -> Hold:
        for other in [] if hold.is_sure else sure:
            if hold.start > hold.first and other.stop == hold.stop and hold.first <= other.start:
                return dataclasses.replace(hold, start=other.start)
            if hold.stop < hold.last and other.start == hold.start and other.stop <= hold.last:
                return dataclasses.replace(hold, stop=other.stop)
        return hold

    return [[with_others(one) for one in body] for body in holds]
