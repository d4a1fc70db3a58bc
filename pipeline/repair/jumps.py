"""Jumps: a body that is somewhere else from one frame to the next, and does or does not come back."""

from __future__ import annotations

import dataclasses

import numpy as np
from jaxtyping import Bool, Float

from pipeline import rotation
from pipeline.clips.human_clip import BODIES
from pipeline.repair.defect import Defect, names
from pipeline.repair.settings import DetectionSettings
from pipeline.repair.tree import Orientations, Positions
from pipeline.repair.unsteadiness import Seen, slow_rate

USUAL_PERCENTILE = 95.0
AT_THE_ENDS = 2.0
"""The first and the last step are judged from one side only and have to be this many times as large."""
COMEBACK_SPEED = 1.5
"""A joint has come back if the way across took no more than this many times its usual top speed."""
EVERYBODY = tuple(range(len(BODIES)))


def find_jumps(seen: Seen, fps: float, settings: DetectionSettings) -> list[Defect]:
    """Jumps of the whole body (`teleport`, `heading_jump`, `opening_pose`) and of single joints (`joint_jump`).

    A stretch between two jumps that the body came back from is lost (`dropout`, `spike`); a jump
    without a way back is a cut.
    """
    pos_w, quat_w = seen.pos_w, seen.quat_w
    if len(pos_w) < 6:
        return []
    measured = seen.unsteadiness
    rate = slow_rate(fps)
    place_limit = _limits(measured.place, settings.position_jump * rate, settings.jump_spread)
    place_limit[0] = _limits(measured.place[:, :1], settings.root_jump * rate, settings.jump_spread)[0]
    turn_limit = _limits(measured.turn, settings.angle_jump * rate, settings.jump_spread)
    turn_limit[0] = _limits(measured.turn[:, :1], settings.angle_jump, settings.jump_spread)[0]  # steady at any rate
    ends = np.ones((len(pos_w), 1))
    ends[[1, -1]] = AT_THE_ENDS
    place, turn = measured.place > place_limit * ends, measured.turn > turn_limit * ends
    offset, local_turn = seen.local
    fast = np.zeros_like(turn)
    fast[1:] = rotation.length(seen.local_turns) * fps > settings.angular_speed
    turn |= fast
    visible = (measured.world > settings.position_jump / 2) | (measured.world_turn > settings.angle_jump / 2)
    place[:, 1:] &= visible[:, 1:]
    turn[:, 1:] &= visible[:, 1:] | fast[:, 1:]
    defects = _root_defects(pos_w, quat_w, place[:, 0], turn[:, 0], fps, settings)
    taken = np.zeros(len(pos_w), dtype=bool)
    for defect in defects:
        taken[max(defect.start - 1, 0) : defect.stop + 2] = True
    for index in EVERYBODY[1:]:
        both = (place[:, index] | turn[:, index]) & ~taken
        if both.any():
            defects += _joint_defects(index, both, place[:, index], offset, local_turn, fps, settings)
    return defects


def joined(defects: list[Defect], known: list[Defect]) -> list[Defect]:
    """A joint's jump at the edge of another's lost stretch, found now or `known`, belongs to it.

    Its way back, or in, was too small to see.
    """
    lost = [one for one in (*known, *defects) if not one.is_cut and (one.pos or one.rot)]
    stretches = sorted({(one.start, one.stop) for one in lost})

    def stretch_of(cut: Defect) -> Defect:
        if cut.code == "joint_jump":
            for start, stop in stretches:
                if min(abs(cut.start - start), abs(cut.start - stop)) <= 1:
                    return dataclasses.replace(cut, code="dropout", start=start, stop=stop)
        return cut

    return [stretch_of(one) if one.is_cut else one for one in defects]


def _limits(size: Float[np.ndarray, "t n"], floor: float, spread: float) -> Float[np.ndarray, " n"]:
    return np.maximum(floor, spread * np.percentile(size, USUAL_PERCENTILE, axis=0))


def _root_defects(
    pos_w: Positions,
    quat_w: Orientations,
    place: Bool[np.ndarray, " t"],
    turn: Bool[np.ndarray, " t"],
    fps: float,
    settings: DetectionSettings,
) -> list[Defect]:
    edges = np.flatnonzero(place | turn)
    step = np.concatenate([[0.0], np.linalg.norm(np.diff(pos_w[:, 0], axis=0), axis=1)])
    angle = np.concatenate([[0.0], rotation.angle_between(quat_w[:-1, 0], quat_w[1:, 0])])
    top = COMEBACK_SPEED * np.percentile(step, 90), COMEBACK_SPEED * np.percentile(angle, 90)

    def text(edge: int) -> str:
        return f"the pelvis jumps by {step[edge]:.2f} m and {np.rad2deg(angle[edge]):.0f} deg"

    def came_back(start: int, stop: int) -> bool:
        way = np.linalg.norm(pos_w[stop, 0] - pos_w[start - 1, 0])
        turned = rotation.angle_between(quat_w[start - 1, 0], quat_w[stop, 0])
        frames = stop - start + 1
        return bool(way <= top[0] * frames + 0.02 and turned <= top[1] * frames + 0.05)

    defects = []
    for start, stop in _stretches(edges, len(pos_w), came_back, fps, settings):
        code = "dropout" if stop > start else ("teleport" if place[start] else "heading_jump")
        edge = start if start > 0 else stop
        if start != stop and (start == 0 or stop == len(pos_w)):
            code = "opening_pose" if start == 0 else "closing_pose"
        defects.append(
            Defect(
                code=code,
                text=text(edge),
                start=start,
                stop=stop,
                bodies=EVERYBODY,
                value=float(step[edge] if place[edge] else angle[edge]),
                limit=settings.root_jump if place[edge] else settings.angle_jump,
                unit="m" if place[edge] else "rad",
            )
        )
    return defects


def _joint_defects(
    index: int,
    edges: Bool[np.ndarray, " t"],
    place: Bool[np.ndarray, " t"],
    offset: Positions,
    turn: Orientations,
    fps: float,
    settings: DetectionSettings,
) -> list[Defect]:
    angle = np.concatenate([[0.0], rotation.angle_between(turn[:-1, index], turn[1:, index])])
    way = np.concatenate([[0.0], np.linalg.norm(np.diff(offset[:, index], axis=0), axis=1)])
    top = COMEBACK_SPEED * np.percentile(angle, 95), COMEBACK_SPEED * np.percentile(way, 95)

    def came_back(start: int, stop: int) -> bool:
        frames = stop - start + 1
        turned = rotation.angle_between(turn[start - 1, index], turn[stop, index])
        moved = np.linalg.norm(offset[stop, index] - offset[start - 1, index])
        return bool(turned <= top[0] * frames + 0.1 and moved <= top[1] * frames + 0.01)

    defects = []
    for start, stop in _stretches(np.flatnonzero(edges), len(edges), came_back, fps, settings):
        edge = start if start > 0 else stop
        code = "joint_jump" if start == stop else ("spike" if stop - start <= 2 else "dropout")
        if start != stop and (start == 0 or stop == len(edges)):
            code = "opening_pose" if start == 0 else "closing_pose"
        lost_pos = bool(place[max(start, 1) : stop + 1].any())
        text = f"{names([index])} jumps by {np.rad2deg(angle[edge]):.0f} deg and {way[edge]:.3f} m"
        defects.append(
            Defect(
                code=code,
                text=text,
                start=start,
                stop=stop,
                bodies=EVERYBODY if code.endswith("_pose") else (index,),
                pos=lost_pos or code.endswith("_pose"),
                value=float(angle[edge]),
                limit=settings.angle_jump,
                unit="rad",
            )
        )
    return defects


def _stretches(
    edges: np.ndarray, frame_count: int, came_back, fps: float, settings: DetectionSettings
) -> list[tuple[int, int]]:
    """Lost stretches [start, stop) and cuts (start == stop) that a body's jumps, sorted, amount to."""
    longest, ends = settings.longest_spike_s * fps, max(settings.opening_s * fps, 3)
    result, left = [], [int(edge) for edge in edges]
    if left and left[0] <= ends:
        last = max(edge for edge in left if edge <= ends)
        result.append((0, last))
        left = [edge for edge in left if edge > ends]
    tail = [edge for edge in left if edge >= frame_count - ends]
    if tail:
        result.append((tail[0], frame_count))
        left = left[: -len(tail)]
    while left:
        start = left.pop(0)
        near = [edge for edge in left if edge - start <= longest]
        back = next((edge for edge in near if came_back(start, edge)), None)
        if back is None:
            result.append((start, start))
        else:
            result.append((start, back))
            left = [edge for edge in left if edge > back]
    return result
