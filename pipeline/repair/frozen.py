"""Stretches in which the recording stood still: real motion is never equal to the last bit."""

from __future__ import annotations

import numpy as np
from jaxtyping import Bool, Float

from pipeline import rotation, time_series
from pipeline.clips.human_clip import BODIES
from pipeline.repair.defect import Defect
from pipeline.repair.missing import spans
from pipeline.repair.settings import DetectionSettings
from pipeline.repair.tree import FEET_BODIES, PARENT
from pipeline.repair.unsteadiness import Seen, slow_rate, turn_limits

POSE_BODIES = 12
"""Where so many joints keep their rotation the whole pose is not the person's."""

TORN_M = 0.005
"""No bone of a leg changes its length by more while the foot stands [m]: those of one bone keep theirs."""


def find_frozen(seen: Seen, lost: Bool[np.ndarray, "t 19"], fps: float, settings: DetectionSettings) -> list[Defect]:
    """Frames equal to the one before: the whole body (`frozen`; alone `repeated_frame`) or one joint.

    What is `lost` is bridged in what is `seen`, and tells nothing of the bones it is at the ends of.
    """
    if len(seen.pos_w) < 6:
        return []
    still_pos = _still_places(seen, settings)
    whole = np.asarray(still_pos.all(axis=1))
    whole[1:] &= (rotation.length(seen.world_turns) < settings.still_step).all(axis=1)
    jumped = seen.unsteadiness.place[:, 0] > settings.root_jump * slow_rate(fps)
    defects = []
    for start, stop in time_series.runs(whole):
        first = start - 1 if jumped[start - 1] else start  # what was frozen came from elsewhere
        defects.append(
            Defect(
                code="repeated_frame" if stop - start == 1 else "frozen",
                text=f"all joints equal to the frame before for {(stop - start) / fps:.3f} s",
                start=first,
                stop=stop,
                bodies=tuple(range(len(BODIES))),
            )
        )
    return defects + _frozen_joints(seen, still_pos, whole, lost, fps, settings)


def _frozen_joints(
    seen: Seen,
    still_pos: Bool[np.ndarray, "t 19"],
    whole: Bool[np.ndarray, " t"],
    lost: Bool[np.ndarray, "t 19"],
    fps: float,
    settings: DetectionSettings,
) -> list[Defect]:
    """Joints that stand still to the last bit and jump out of it (`frozen_joint`), or into it as well (`dropout`).

    Standing still alone is nothing: knees are locked, arms held and feet planted without a jump. Nor is a pose that
    the joint holds at other times, too: that is where it is locked, and what it jumps to from there is the defect.
    """
    measured = seen.unsteadiness
    slow = turn_limits(settings.lever_jump, settings.least_angle, settings.angle_jump) * slow_rate(fps)
    still_turn = _step(rotation.length(seen.local_turns)) < settings.still_step
    release = np.minimum(settings.release_turn, slow)
    steps = _step(rotation.length(seen.local_turns)) * fps
    turned = _marked(
        still_turn, whole, (measured.turn, steps / settings.stop_speed), (release, slow), seen.local[1], settings
    )
    own = still_pos.copy()
    own[:, list(FEET_BODIES)] = False
    near = np.full(own.shape[1], settings.position_jump)
    jump = (measured.world, _step(rotation.length(np.diff(seen.pos_w, axis=0))) * fps / settings.stop_speed_m_s)
    moved = _marked(own, whole, jump, (near, 2.0 * slow_rate(fps) * near), seen.pos_w, settings)
    defects = []
    for code, mask in turned.items():
        mask[mask.sum(axis=1) >= POSE_BODIES] = True
        posed = np.repeat(mask.all(axis=1, keepdims=True), mask.shape[1], axis=1)
        defects += spans(code, "{names} keep their rotation to the last bit", mask, pos=posed, rot=mask)
    for code, mask in moved.items():
        for index in FEET_BODIES:
            mask[:, index] = mask[:, PARENT[index]] & still_pos[:, index]
        defects += spans(code, "{names} keep their place to the last bit", mask, pos=mask, rot=mask)
    torn = _torn_feet(seen, still_pos & ~whole[:, None], lost, settings)
    return defects + spans("frozen_joint", "{names} keep their place while the leg moves on", torn, pos=torn, rot=torn)


def _torn_feet(
    seen: Seen, still_pos: Bool[np.ndarray, "t 19"], lost: Bool[np.ndarray, "t 19"], settings: DetectionSettings
) -> Bool[np.ndarray, "t 19"]:
    """Ankles and toes that keep their place as planted feet do, but off which the bone above them is pulled.

    The next bone of the leg keeps its length, else it is the joint between them that is elsewhere.
    """
    torn = np.zeros_like(still_pos)
    for index in FEET_BODIES:
        parent = PARENT[index]
        for start, stop in time_series.runs(still_pos[:, index]):
            span = slice(start - 1, stop)
            if stop - start >= settings.still_frames and not lost[span][:, [index, parent]].any():
                chain = seen.pos_w[span][:, [index, parent, PARENT[parent]]]
                change = np.ptp(rotation.length(np.diff(chain, axis=1)), axis=0)
                torn[start:stop, index] = change[0] > TORN_M >= change[1]
    return torn


def _marked(
    still: Bool[np.ndarray, "t 19"],
    whole: Bool[np.ndarray, " t"],
    jumps: tuple[Float[np.ndarray, "t 19"], Float[np.ndarray, "t 19"]],
    limits: tuple[Float[np.ndarray, " 19"], Float[np.ndarray, " 19"]],
    value: Float[np.ndarray, "t 19 d"],
    settings: DetectionSettings,
) -> dict[str, Bool[np.ndarray, "t 19"]]:
    """Frames in which each body is frozen.

    `jumps` are how unsteady the step into each frame is, and its speed over the one that nobody stops from within a
    frame; `limits` are those of the jump out of a pose that is held once, and of other jumps. A pose held once that is
    stopped at and left at speed is frozen, too.
    """
    marked = {code: np.zeros_like(still) for code in ("dropout", "frozen_joint")}
    (jump, speed), (released, entering) = jumps, limits
    for index in np.flatnonzero((still & ~whole[:, None]).any(axis=0)):
        for start, stop in time_series.runs(still[:, index]):
            if stop - start < settings.still_frames or whole[start:stop].all():
                continue
            if still[max(start - 4, 0) : start - 1, index].any() or still[stop + 1 : stop + 4, index].any():
                continue  # at rest before or after, too
            entered = jump[start - 1, index] > entering[index] and start > settings.still_frames
            ended, out = stop == len(still), jump[min(stop, len(still) - 1), index]
            inner = start > 1 and stop + 1 < len(still)
            stopped = inner and min(speed[start - 1, index], speed[stop + 1, index]) > 1.0
            if not (entered if ended else stopped or out > min(released[index], entering[index])):
                continue
            alone = not _held_elsewhere(value[:, index], still[:, index], start - 1, stop, settings.still_step)
            left = out > released[index] or stopped if alone else entered and out > entering[index]
            if alone if ended else left:
                code = "dropout" if entered else "frozen_joint"
                marked[code][start - entered : stop, index] = True
    return marked


def _held_elsewhere(
    value: Float[np.ndarray, "t d"], still: Bool[np.ndarray, " t"], start: int, stop: int, still_step: float
) -> bool:
    """Whether the pose that a body keeps in frames [start, stop) is one that it keeps at another time, too."""
    apart = np.abs(value - value[stop - 1]).max(axis=1)
    if value.shape[1] == 4:
        apart = np.minimum(apart, np.abs(value + value[stop - 1]).max(axis=1))
    there = still & (apart < still_step)
    there[start:stop] = False
    return bool(there.any())


def _still_places(seen: Seen, settings: DetectionSettings) -> Bool[np.ndarray, "t 19"]:
    """Joints that are where they were in the frame before."""
    x, y, z = np.moveaxis(np.abs(np.diff(seen.pos_w, axis=0)), -1, 0)
    return _step(np.maximum(np.maximum(x, y), z)) < settings.still_step


def _step(size: Float[np.ndarray, "s 19"]) -> Float[np.ndarray, "t 19"]:
    """Steps from the frame before; the first frame has none and counts as moving."""
    return np.concatenate([np.full((1, size.shape[1]), np.inf), size])
