"""Move feet that would collide apart along the pelvis's lateral axis.

In plan view, a sole is a row of discs. Two discs whose distance along the heading is less than the sum R of their
radii and the required gap need a lateral distance of sqrt(R^2 - along^2), with the left foot on the left. Corners,
which the discs miss, are measured on the rectangles.
"""

import numpy as np
from jaxtyping import Bool, Float
from scipy.ndimage import gaussian_filter1d, maximum_filter1d

from pipeline import time_series
from pipeline.retarget.foot_plan import YAW, Sole

DISCS = 5
"""Number of discs per sole."""

SPACING_ROUNDS = 4
"""Rounds of moving footholds apart; a foothold has two neighbours, so one round is not enough."""

CORNER = 1.1
"""Radius of a disc / half width of the sole: lets the discs cover most of the corners."""

CORNER_GAP = 0.005
"""Gap [m] between the corners of soles with different yaw; a larger one would turn the shanks too far."""


def overlap(
    feet: Float[np.ndarray, "2 t 5"], heading: Float[np.ndarray, " t"], sole: Sole, gap: float
) -> Float[np.ndarray, " t"]:
    """Lateral distance [m], 0 or more, by which the feet must move apart for `gap` between their soles."""
    places = np.linspace(sole.rear + sole.half_width, sole.front - sole.half_width, DISCS)[:, None]
    cosine, sine, yaw = np.cos(heading), np.sin(heading), feet[:, None, :, YAW]
    discs_x, discs_y = feet[:, None, :, 0] + places * np.cos(yaw), feet[:, None, :, 1] + places * np.sin(yaw)
    across = cosine * discs_y - sine * discs_x
    reach = 2.0 * CORNER * sole.half_width + gap
    lacking = np.zeros(len(heading))
    near = across[0].min(axis=0) - across[1].max(axis=0) < reach  # far enough apart in all other frames
    if not near.any():
        return lacking
    left, right = (cosine * discs_x + sine * discs_y)[..., near]
    way = left[:, None] - right
    needed = np.sqrt(np.maximum(reach**2 - way**2, 0.0))
    left, right = across[..., near]
    apart = left[:, None] - right
    lacking[near] = np.maximum(np.where(np.abs(way) < reach, needed - apart, 0.0).max(axis=(0, 1)), 0.0)
    return lacking


def corner_overlap(
    feet: Float[np.ndarray, "2 t 5"], heading: Float[np.ndarray, " t"], sole: Sole, gap: float
) -> Float[np.ndarray, " t"]:
    """Lateral distance [m], 0 or more, by which two rectangular soles must move apart for `gap` between them.

    Discs miss the corners, which collide where the feet have different yaw. The outline of a rectangle over the
    heading is straight between corners, so the distance is largest at a corner of one of them.
    """
    along, across = _corners(feet, heading, sole, gap / 2.0)
    lacking = np.zeros(len(heading))
    near = across[0].min(axis=0) < across[1].max(axis=0)
    if near.any():
        along, across = along[..., near], across[..., near]
        outward = np.stack([-across[0], across[1]])
        inner, outer = _outline(along, outward, np.concatenate([along[0], along[1]]))
        lacking[near] = np.maximum((outer + inner).max(axis=0), 0.0)
    return lacking


def _corners(
    feet: Float[np.ndarray, "2 t 5"], heading: Float[np.ndarray, " t"], sole: Sole, wider: float
) -> tuple[Float[np.ndarray, "2 4 t"], Float[np.ndarray, "2 4 t"]]:
    """Corners (in order) of soles enlarged by `wider` [m] on all sides: along the heading and to its left."""
    x = np.array([sole.rear - wider, sole.front + wider])[[0, 1, 1, 0], None]
    y = (sole.half_width + wider) * np.array([[-1.0], [-1.0], [1.0], [1.0]])
    turn = feet[:, None, :, YAW] - heading
    cosine, sine, cosine_turn, sine_turn = np.cos(heading), np.sin(heading), np.cos(turn), np.sin(turn)
    along = (cosine * feet[..., 0] + sine * feet[..., 1])[:, None] + x * cosine_turn - y * sine_turn
    across = (cosine * feet[..., 1] - sine * feet[..., 0])[:, None] + x * sine_turn + y * cosine_turn
    return along, across


def _outline(
    along: Float[np.ndarray, "2 4 t"], across: Float[np.ndarray, "2 4 t"], places: Float[np.ndarray, "p t"]
) -> Float[np.ndarray, "2 p t"]:
    """Largest `across` [m] of rectangles at each of `places` [m] along the heading; -inf outside."""
    onward = [1, 2, 3, 0]
    start, from_w = along[:, :, None], across[:, :, None]
    way, rise = along[:, onward, None] - start, across[:, onward, None] - from_w
    share = (places - start) / np.where(np.abs(way) > 1e-9, way, 1e-9)
    return np.where((share >= -1e-9) & (share <= 1.0 + 1e-9), from_w + share * rise, -np.inf).max(axis=1)


def lateral_way(
    feet: Float[np.ndarray, "2 t 5"], heading: Float[np.ndarray, " t"], sole: Sole, gap: float
) -> Float[np.ndarray, " t"]:
    """Lateral distance [m], 0 or more, by which feet must move apart: for `gap` between discs, `CORNER_GAP` at
    corners."""
    return np.maximum(overlap(feet, heading, sole, gap), corner_overlap(feet, heading, sole, CORNER_GAP))


def space_footholds(
    locked: Float[np.ndarray, "2 t 5"],
    contacts: Bool[np.ndarray, "t 2"],
    heading: Float[np.ndarray, " t"],
    sole: Sole,
    gap: float,
    spread: int,
) -> None:
    """Move whole footholds in place so that feet which stand at the same time have `gap` between them.

    Stances less than `spread` frames apart count as simultaneous, because no swing is that fast.
    """
    lateral_w, lacking = lateral_axis(heading), np.zeros(len(heading))
    for _ in range(SPACING_ROUNDS):
        held = [_held(foot, contacts[:, side], spread) for side, foot in enumerate(locked)]
        stands = held[0][1] & held[1][1]
        lacking[stands] = lateral_way(np.stack([foot[stands] for foot, _ in held]), heading[stands], sole, gap)
        if not lacking.any():
            return
        for side, sign in ((0, 1.0), (1, -1.0)):
            for start, stop in time_series.runs(contacts[:, side]):
                near = slice(max(start - spread, 0), stop + spread)
                worst = near.start + int(np.argmax(lacking[near]))
                locked[side, start:stop, :2] += 0.5 * sign * lacking[worst] * lateral_w[worst]


def lateral_axis(heading: Float[np.ndarray, " t"]) -> Float[np.ndarray, "t 2"]:
    """Horizontal unit vectors to the left of a heading [rad]."""
    return np.stack([-np.sin(heading), np.cos(heading)], axis=-1)


def _held(
    foot: Float[np.ndarray, "t 5"], contact: Bool[np.ndarray, " t"], spread: int
) -> tuple[Float[np.ndarray, "t 5"], Bool[np.ndarray, " t"]]:
    """Foot poses and contacts with each stance extended by `spread` frames at both ends."""
    held, stands = foot.copy(), contact.copy()
    for start, stop in time_series.runs(~contact):
        middle = (start + stop) // 2
        if stop < len(foot):
            first = max(middle, stop - spread)
            held[first:stop], stands[first:stop] = foot[stop], True
        if start > 0:
            last = min(middle, start + spread)
            held[start:last], stands[start:last] = foot[start - 1], True
    return held, stands


def space_swings(
    plans: Float[np.ndarray, "2 t 5"],
    contacts: Bool[np.ndarray, "t 2"],
    heading: Float[np.ndarray, " t"],
    sole: Sole,
    gap: float,
    spread: float,
) -> None:
    """Move swinging feet in place away from the other foot; a standing foot stays where it is.

    Args:
        spread: fade-in and fade-out of a shift [frames]
    """
    lacking = lateral_way(plans, heading, sole, gap)
    if not lacking.any():
        return
    swings = ~contacts
    share = swings / np.maximum(swings.sum(axis=1, keepdims=True), 1)
    for side in range(2):
        push_outward(plans[side], side, swings[:, side], lacking * share[:, side], heading, spread)


def push_outward(
    plan: Float[np.ndarray, "t 5"],
    side: int,
    swings: Bool[np.ndarray, " t"],
    way: Float[np.ndarray, " t"],
    heading: Float[np.ndarray, " t"],
    spread: float,
) -> None:
    """Move a swinging foot outward, in place, by approximately `way` [m] or more; it is not moved in stances.

    Args:
        spread: fade-in and fade-out of the shift [frames]
    """
    if not (way * swings).any():
        return
    push = np.where(swings, faded(way, spread) * _window(swings, spread), 0.0)
    plan[:, :2] += (1.0 - 2.0 * side) * push[:, None] * lateral_axis(heading)


def faded(push: Float[np.ndarray, "*n"], spread: float) -> Float[np.ndarray, "*n"]:
    """Smooth envelope of `push` over frames (first axis): a running maximum, then a Gaussian filter."""
    width = 2 * round(spread) + 1
    return gaussian_filter1d(maximum_filter1d(push, width, axis=0), spread, axis=0, mode="nearest")


def _window(swings: Bool[np.ndarray, " t"], spread: float) -> Float[np.ndarray, " t"]:
    """1 within swings, 0 at their ends next to a stance, smooth between over `spread` frames."""
    window = np.zeros(len(swings))
    for start, stop in time_series.runs(swings):
        index = np.arange(start, stop)
        before = index - start + 1.0 if start > 0 else np.full(len(index), np.inf)
        after = stop - index + 0.0 if stop < len(swings) else np.full(len(index), np.inf)
        share = np.minimum(np.minimum(before, after) / (spread + 1.0), 1.0)
        window[start:stop] = time_series.smoothstep(share)
    return window
