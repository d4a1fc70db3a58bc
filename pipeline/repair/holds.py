"""Whether a rest of a body is the person's or a held pose of the recording.

People rest, too: knees lock, feet stand, arms are held. A rest is taken up and left without a jump, however fast the
motion on both sides; a recording that lost a body for a while holds it, and then jumps to where it has gone meanwhile.
Where a rest of the person and a lost stretch follow each other in one pose, other rests in that pose tell how long the
person keeps it at least.
"""

import dataclasses
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from pipeline import time_series
from pipeline.repair.tree import FrameMask

BESIDE = 2
"""A jump so near to frames that are not known tells nothing [frames]."""
COMEBACK, COMEBACK_SHARE = 5, 0.5
"""What jumps back to the pose within so many frames, by this share, was a spike beside the rest."""
PAUSE = 3
"""Of rests in one pose with no more frames between them the person had ended the first."""

SAME = 1e-4
"""Poses that are no further apart are one: rests creep a little [entries of rotation matrices, m]."""
NEAREST = 4
"""Of so many rests in a pose the shortest tells how long the person keeps it at least: about two on either side."""


@dataclass(frozen=True, kw_only=True)
class Limits:
    """What a body's rest is judged by, in [rad] or [m] but for the last."""

    jump: float
    """The person takes a rest up and leaves it by less."""
    short: float
    """Jumps on both sides that tell of a held pose of fewer than `frames`."""
    entering: float
    """Jumps on both sides that tell where the person's own rests in that pose jump, too."""
    frames: int
    """Equal frames that count as a rest."""
    longest: float
    """What is kept for more frames is where the body is locked."""
    excursion: float
    """What jumps out of a pose and back into it within so many frames was elsewhere."""


@dataclass(frozen=True, kw_only=True)
class Rest:
    """Frames [start, stop) that equal the one before, and the jumps into and out of their pose."""

    start: int
    stop: int
    entered: float
    left: float
    whole: bool
    """The clip does not begin or end in it."""

    @property
    def frames(self) -> int:
        return self.stop - self.start

    def jumps(self, limit: float) -> bool:
        """Whether it is taken up or left by more than this."""
        return max(self.entered, self.left) > limit


@dataclass(frozen=True, kw_only=True)
class Hold:
    """Frames [start, stop) in which a body is held; `entered` where it jumped into the pose."""

    start: int
    stop: int
    entered: bool
    first: int
    last: int
    """Frames [first, last) of the pose: of them the person may have kept some."""

    @property
    def is_sure(self) -> bool:
        """Whether all of the pose is held."""
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
    """Rests of a body that are not the person's.

    `still` frames equal the one before, `jump` is how unsteady the step into each frame is, `unknown` frames are
    bridged. `anywhere` rests in other poses count as if they were in the same: feet stand where they come down.
    """
    count, ahead = len(value), (value, jump, unknown)
    back = (value[::-1], np.concatenate([[0.0], jump[:0:-1]]), unknown[::-1])
    rests = [
        Rest(
            start=start,
            stop=stop,
            entered=_jump(*back, count + 1 - start),
            left=_jump(*ahead, stop),
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
        if not any(_gives_way(one, others, *more, limits) for more in suspects)
    ]


def _jump(value: Float[np.ndarray, "t d"], jump: Float[np.ndarray, " t"], unknown: FrameMask, frame: int) -> float:
    """Size of the jump into the frame after a rest; none that is not known, or that another soon leads back from."""
    if frame + BESIDE >= len(value) or unknown[frame : frame + BESIDE + 1].any():
        return 0.0
    later = slice(frame + 1, frame + 1 + COMEBACK)
    apart = np.linalg.norm(value[frame : frame + 1 + COMEBACK] - value[frame - 1], axis=1)
    back = (apart[1:] < COMEBACK_SHARE * apart[0]) & (jump[later] > COMEBACK_SHARE * jump[frame])
    return 0.0 if back.any() else float(jump[frame])


def _without_excursions(
    rests: list[Rest], poses: Float[np.ndarray, "n d"], jump: Float[np.ndarray, " t"], limits: Limits
) -> list[Rest]:
    """Rests that do not count the jumps out of a pose and, soon, back into it: what is between was elsewhere."""
    result = list(rests)
    for number in range(len(rests) - 1):
        one, after = rests[number], rests[number + 1]
        near = after.start - one.stop <= limits.excursion and np.abs(poses[number + 1] - poses[number]).max() < SAME
        if near and min(jump[one.stop], jump[after.start - 1]) > limits.jump:
            result[number] = dataclasses.replace(result[number], left=0.0)
            result[number + 1] = dataclasses.replace(after, entered=0.0)
    return result


def _suspect(one: Rest, others: list[Rest], limits: Limits) -> bool:
    """Whether a rest that jumps is held: those of a person's locked joint may jump, but all do."""
    if one.frames < limits.frames:
        return min(one.entered, one.left) > limits.short
    locked = any(other.jumps(limits.jump) or other.frames > limits.longest for other in others)
    return not locked or min(one.entered, one.left) > limits.entering


def _gives_way(one: Rest, others: list[Rest], next_to: Rest, its_others: list[Rest], limits: Limits) -> bool:
    """Whether a rest jumps because what is next to it is held.

    Of two poses that is held which is kept at no other time, or which is jumped into and out of, or the shorter one.
    """
    if not 0 <= max(next_to.start - one.stop, one.start - next_to.stop) <= BESIDE:
        return False
    both = [min(rest.entered, rest.left) > limits.jump for rest in (one, next_to)]
    return (not others, both[0], -one.frames) < (not its_others, both[1], -next_to.frames)


def _hold(one: Rest, others: list[Rest], limits: Limits) -> Hold:
    """What of a rest is held: all, or what is longer than others in that pose are where it has one smooth end."""
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
    """Holds of each body; those of which the person may have kept a part begin and end with others' if they can."""
    sure = [one for body in holds for one in body if one.is_sure]

    def with_others(hold: Hold) -> Hold:
        for other in [] if hold.is_sure else sure:
            if hold.start > hold.first and other.stop == hold.stop and hold.first <= other.start:
                return dataclasses.replace(hold, start=other.start)
            if hold.stop < hold.last and other.start == hold.start and other.stop <= hold.last:
                return dataclasses.replace(hold, stop=other.stop)
        return hold

    return [[with_others(one) for one in body] for body in holds]
