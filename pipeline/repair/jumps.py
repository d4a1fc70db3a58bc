"""Detect jumps: discontinuities of a body's pose between two frames, with or without a return."""

import dataclasses
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from pipeline import rotation
from pipeline.clips.human_clip import BODIES, PARENT
from pipeline.repair.defect import Defect, names
from pipeline.repair.settings import DetectionSettings
from pipeline.repair.tree import TOES, BodyMask, FrameMask, Orientations, Positions
from pipeline.repair.unsteadiness import USUAL_PERCENTILE, MotionFeatures, limits, slow_rate, turn_limits

SLOW_SPREAD = 10.0
"""At low frame rates a limit rises to at most this many times the body's usual unsteadiness."""
AT_THE_ENDS = 2.0
"""Factor on the limits of the first and the last step, which have neighbours on one side only."""
COMEBACK_SPEED = 1.5
"""A joint has returned if the speed across the gap is at most this many times its usual top speed."""
CHAIN_FRAMES = 3
"""Distance of two jumps up to which they are one disturbance [frames]."""
TOE_SHARE = 2.0
"""Factor on the limits of toes, which bend fast at touchdown."""
SMALL_S = 0.15
"""Time within which a small jump must be reversed to count [s]; locking knees jump slightly, too."""
EVERYBODY = tuple(range(len(BODIES)))


@dataclass(frozen=True, kw_only=True)
class Edges:
    """Frames into which each body jumps (t, 19)."""

    place: BodyMask
    turn: BodyMask
    large: BodyMask
    """Jumps that are reported alone; a smaller one must be reversed soon."""


def find_jumps(features: MotionFeatures, lost: BodyMask, fps: float, settings: DetectionSettings) -> list[Defect]:
    """Jumps of the whole body (`teleport`, `heading_jump`, `opening_pose`) and of single joints (`joint_jump`).

    The stretch between a jump and the body's return is lost (`dropout`, `spike`); a jump without a return is a cut. The
    usual unsteadiness is measured on frames without `lost` samples.
    """
    pos_w, quat_w = features.pos_w, features.quat_w
    if len(pos_w) < 6:
        return []
    edges = _edges(features, lost, fps, settings)
    offset, local_turn = features.local
    defects = _root_defects(pos_w, quat_w, edges.place[:, 0], edges.turn[:, 0], fps, settings)
    taken = np.zeros(len(pos_w), dtype=bool)
    for defect in defects:
        taken[max(defect.start - 1, 0) : defect.stop + 2] = True
    jumps = edges.place | edges.turn
    for index in np.flatnonzero((jumps & ~taken[:, None]).any(axis=0)).tolist():
        if index > 0:
            at, large = jumps[:, index] & ~taken, edges.large[:, index] & ~taken
            defects += _joint_defects(index, at, large, edges.place[:, index], offset, local_turn, fps, settings)
    return defects


def _edges(features: MotionFeatures, lost: BodyMask, fps: float, settings: DetectionSettings) -> Edges:
    measured, rate, usual = features.unsteadiness, slow_rate(fps), np.asarray(~lost.any(axis=1))
    least = turn_limits(settings)
    near = np.full(len(EVERYBODY), settings.position_jump)
    near[0] = settings.root_jump
    ends = np.ones((len(features.pos_w), 1))
    ends[[1, -1]] = AT_THE_ENDS
    place = measured.place > limits(measured.place, near, settings.jump_spread, usual) * ends
    turn_limit = limits(measured.turn, least, settings.jump_spread, usual)
    turn_limit[1:] = np.maximum(turn_limit[1:], _slow(measured.turn[usual, 1:], least[1:], rate))
    turn_limit[list(TOES)] = np.maximum(turn_limit[list(TOES)], TOE_SHARE * settings.angle_jump * rate)
    alone = np.maximum(turn_limit, settings.angle_jump * rate)
    fast = np.zeros_like(place)
    fast[1:] = rotation.length(features.local_turns) * fps > settings.angular_speed
    turn = (measured.turn > turn_limit * ends) | fast
    visible = (measured.world > settings.position_jump / 2) | (measured.world_turn > least / 2)
    visible[:, 0] = True
    bridged = lost.copy()
    bridged[:, 1:] |= lost[:, list(PARENT[1:])]
    bridged[1:] |= bridged[:-1].copy()
    place &= visible & ~bridged
    turn &= (visible | fast) & ~bridged
    return Edges(place=place, turn=turn, large=place | fast | (measured.turn > alone * ends))


def joined(defects: list[Defect], known: list[Defect]) -> list[Defect]:
    """Merge a joint's jump at the edge of another joint's lost stretch into that stretch."""
    lost = [one for one in (*known, *defects) if not one.is_cut and (one.pos or one.rot)]
    stretches = sorted({(one.start, one.stop) for one in lost})

    def stretch_of(cut: Defect) -> Defect:
        if cut.code == "joint_jump":
            for start, stop in stretches:
                if min(abs(cut.start - start), abs(cut.start - stop)) <= 1:
                    return dataclasses.replace(cut, code="dropout", start=start, stop=stop)
        return cut

    return [stretch_of(one) if one.is_cut else one for one in defects]


def _slow(size: Float[np.ndarray, "t n"], floor: Float[np.ndarray, " n"], rate: float) -> Float[np.ndarray, " n"]:
    """Least limits at a low frame rate: higher for bodies that are often unsteady, such as landing feet."""
    if rate <= 1.0 or not len(size):
        return floor
    return np.clip(SLOW_SPREAD * np.percentile(size, USUAL_PERCENTILE, axis=0), floor, floor * rate)


def _steps(
    pos: Float[np.ndarray, "t 3"], quat: Float[np.ndarray, "t 4"], percentile: float, slack_m: float, slack_rad: float
) -> tuple[Float[np.ndarray, " t"], Float[np.ndarray, " t"], Callable[[int, int], bool]]:
    """Translation [m] and rotation [rad] of a body into each frame, and a test for its return at `stop` to its motion
    before `start`.

    The fastest return is `COMEBACK_SPEED` times a percentile of the body's own steps; the slack is always allowed.
    """
    way = np.concatenate([[0.0], np.linalg.norm(np.diff(pos, axis=0), axis=1)])
    angle = np.concatenate([[0.0], rotation.angle_between(quat[:-1], quat[1:])])
    top_way, top_angle = (COMEBACK_SPEED * np.percentile(size, percentile) for size in (way, angle))

    def came_back(start: int, stop: int) -> bool:
        moved = np.linalg.norm(pos[stop] - pos[start - 1])
        turned = rotation.angle_between(quat[start - 1], quat[stop])
        frames = stop - start + 1
        return bool(moved <= top_way * frames + slack_m and turned <= top_angle * frames + slack_rad)

    return way, angle, came_back


def _pose_at_end(start: int, stop: int, count: int) -> str | None:
    """Defect code of a stretch at the clip's beginning or end, which is a pose and not motion."""
    if start == stop or (start > 0 and stop < count):
        return None
    return "opening_pose" if start == 0 else "closing_pose"


def _root_defects(
    pos_w: Positions, quat_w: Orientations, place: FrameMask, turn: FrameMask, fps: float, settings: DetectionSettings
) -> list[Defect]:
    way, angle, came_back = _steps(pos_w[:, 0], quat_w[:, 0], 90, 0.02, 0.05)
    defects = []
    for start, stop in _stretches(np.flatnonzero(place | turn), len(pos_w), came_back, fps, settings):
        edge = start if start > 0 else stop
        jump = "dropout" if stop > start else ("teleport" if place[start] else "heading_jump")
        defects.append(
            Defect(
                code=_pose_at_end(start, stop, len(pos_w)) or jump,
                text=f"the pelvis jumps by {way[edge]:.2f} m and {np.rad2deg(angle[edge]):.0f} deg",
                start=start,
                stop=stop,
                bodies=EVERYBODY,
                value=float(way[edge] if place[edge] else angle[edge]),
                limit=settings.root_jump if place[edge] else settings.angle_jump,
                unit="m" if place[edge] else "rad",
            )
        )
    return defects


def _joint_defects(
    index: int,
    edges: FrameMask,
    large: FrameMask,
    place: FrameMask,
    offset: Positions,
    turn: Orientations,
    fps: float,
    settings: DetectionSettings,
) -> list[Defect]:
    way, angle, came_back = _steps(offset[:, index], turn[:, index], 95, 0.01, 0.1)
    defects = []
    for start, stop in _stretches(np.flatnonzero(edges), len(edges), came_back, fps, settings):
        brief = start > 0 and start < stop < min(len(edges), start + SMALL_S * fps)
        if not (brief or large[start : stop + 1].any()):
            continue
        edge, pose = start if start > 0 else stop, _pose_at_end(start, stop, len(edges))
        jump = "joint_jump" if start == stop else ("spike" if stop - start <= 2 else "dropout")
        defects.append(
            Defect(
                code=pose or jump,
                text=f"{names([index])} jumps by {np.rad2deg(angle[edge]):.0f} deg and {way[edge]:.3f} m",
                start=start,
                stop=stop,
                bodies=EVERYBODY if pose else (index,),
                pos=pose is not None or bool(place[max(start, 1) : stop + 1].any()),
                value=float(angle[edge]),
                limit=settings.angle_jump,
                unit="rad",
            )
        )
    return defects


def _stretches(
    edges: np.ndarray, frame_count: int, came_back: Callable[[int, int], bool], fps: float, settings: DetectionSettings
) -> list[tuple[int, int]]:
    """Lost stretches [start, stop) and cuts (start == stop) that result from a body's sorted jumps."""
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
        chain = _chain(start, left)
        if back is None and len(chain) > 1:
            result.append((start, chain[-1]))
            left = left[len(chain) :]
        elif back is None:
            result.append((start, start))
        else:
            result.append((start, back))
            left = [edge for edge in left if edge > back]
    return result


def _chain(start: int, later: list[int]) -> list[int]:
    """The `later` edges that follow `start` within a few frames each; together they are one disturbance."""
    chain, last = [], start
    for edge in later:
        if edge - last > CHAIN_FRAMES:
            break
        chain.append(edge)
        last = edge
    return chain
