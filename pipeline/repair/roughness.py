"""How far each body is from where the frames around say: spikes too small to be jumps.

A gap of a few frames is bridged by a cubic through the two frames on either side, and what is there is held against
it. For motion the miss goes with the fourth derivative, so it is far smaller than that of steps held against each
other (`unsteadiness`); for a spike it is the spike's size.
"""

from __future__ import annotations

import numpy as np
from jaxtyping import Bool, Float

from pipeline.repair.bridge_miss import REACH, interpolation_miss, size_of
from pipeline.repair.defect import Defect, names
from pipeline.repair.settings import DetectionSettings
from pipeline.repair.tree import KNEES, TOES
from pipeline.repair.unsteadiness import Seen, limits, slow_rate, turn_limits

LONGEST_SPIKE_S, MOST_FRAMES = 0.02, 4
"""Spikes up to this long are sought; longer ones have edges that are jumps [s], [frames]."""
TOE_SHARE = 1.5
"""Toes bend so fast when they land that the limit of a clip's own toes is this many times as large."""
KNEE_SHARE = 1.4
"""Knees turn so fast when a foot lands that below 60 Hz their limit is up to this many times as large: in sound walks,
starts and steps back at 30 Hz they reach 1.25 times the limit that holds at 60 Hz."""
MOST_TIMES = 3.0
"""What a clip misses by makes its limits no more than so many times as large: sound files reach 2.2 times the least,
and in a short clip spikes themselves are among what it misses by."""
CLEAR = 3
"""A spike keeps this many frames away from a gap: bridges are a little off where they begin."""


def find_spikes(seen: Seen, lost: Bool[np.ndarray, "t 19"], fps: float, settings: DetectionSettings) -> list[Defect]:
    """Bodies that are elsewhere for a few frames (`spike`); nothing beside samples that are `lost` already."""
    longest = int(np.clip(int(LONGEST_SPIKE_S * fps), 1, MOST_FRAMES))
    found: list[tuple[float, int, int, int, float, float, bool]] = []
    for gap in range(1, longest + 1):
        if len(seen.pos_w) < gap + 2 * REACH + 2:
            break
        found += _candidates(seen, lost, gap, fps, settings)
    defects, taken = [], np.zeros(lost.shape, dtype=bool)
    for _, index, start, stop, angle, limit, moved in sorted(found, reverse=True):
        if taken[start:stop, index].any():
            continue
        taken[max(start - REACH, 0) : stop + REACH, index] = True
        defects.append(
            Defect(
                code="spike",
                text=f"{names([index])} is {np.rad2deg(angle):.0f} deg off what the frames around say",
                start=start,
                stop=stop,
                bodies=(index,),
                pos=moved,
                value=angle,
                limit=limit if angle > limit else None,
                unit="rad",
            )
        )
    return defects


def _candidates(
    seen: Seen, lost: Bool[np.ndarray, "t 19"], gap: int, fps: float, settings: DetectionSettings
) -> list[tuple[float, int, int, int, float, float, bool]]:
    """Windows of `gap` frames that are off: by how many times, body, frames [start, stop), angle and its limit [rad],
    whether it moved."""
    turn, place = seen.misses if gap == 1 else seen.misses_over(gap)
    least = _turn_limits(settings.spike_turn, settings)
    usual = np.asarray(~lost.any(axis=1))
    turn_limit = limits(turn, least, settings.spike_spread, usual)
    place_limit = limits(place, np.full(place.shape[1], settings.position_jump), settings.spike_spread, usual)
    place_limit[0] = max(place_limit[0], settings.root_jump)
    toes = list(TOES)
    turn_limit[toes] = np.where(turn_limit[toes] > least[toes], TOE_SHARE * turn_limit[toes], turn_limit[toes])
    turn_limit = np.minimum(turn_limit, MOST_TIMES * least)
    turn_limit[list(KNEES)] *= min(KNEE_SHARE, slow_rate(fps))
    size = np.maximum(turn / turn_limit, place / place_limit)
    if not (size > 1.0).any():
        return []
    world_turn = 2.0 * size_of(interpolation_miss(seen.continuous, gap))
    world_place = size_of(interpolation_miss(seen.pos_w, gap))
    visible = (world_turn > least / 2.0) | (world_place > settings.position_jump / 2.0)
    visible[:, 0] = True
    result = []
    for frame, index in np.argwhere((size > 1.0) & visible):
        start = int(frame) - (gap - 1) // 2
        stop = start + gap
        if lost[max(start - CLEAR, 0) : stop + CLEAR, index].any():
            continue
        moved = bool(place[frame, index] > place_limit[index])
        off = float(turn[frame, index]), float(turn_limit[index])
        result.append((float(size[frame, index]), int(index), start, stop, *off, moved))
    return result


def _turn_limits(most: float, settings: DetectionSettings) -> Float[np.ndarray, " 19"]:
    """Limits of a turn [rad] that are `most` where jumps have theirs, and smaller in proportion elsewhere."""
    return turn_limits(settings.lever_jump, settings.least_angle, settings.angle_jump) * (most / settings.angle_jump)
