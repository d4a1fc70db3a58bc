"""Stretches in which the recording stood still: real motion is never equal to the last bit.

Which of a body's rests are the person's, `holds.py` tells.
"""

import numpy as np
from jaxtyping import Float

from pipeline import rotation, time_series
from pipeline.clips.human_clip import BODIES, PARENT
from pipeline.repair.defect import Defect, spans
from pipeline.repair.holds import Hold, Limits, aligned, find_holds
from pipeline.repair.settings import DetectionSettings
from pipeline.repair.tree import FEET_BODIES, BodyMask, FrameMask, PerBody
from pipeline.repair.unsteadiness import Seen, slow_rate, turn_limits

POSE_BODIES = 12
"""Where so many joints keep their rotation the whole pose is not the person's."""

TORN_M = 0.005
"""No bone of a leg changes its length by more while the foot stands [m]: those of one bone keep theirs."""

PULLED_M = 0.001
"""From where its bone is pulled by this much the foot does not stand [m]."""


LOCKED_SHARE = 0.5
"""An angle that is kept for more than this share of the clip is where a joint is locked, or there is none."""


def find_frozen(seen: Seen, lost: BodyMask, fps: float, settings: DetectionSettings) -> list[Defect]:
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
    seen: Seen, still_pos: BodyMask, whole: FrameMask, lost: BodyMask, fps: float, settings: DetectionSettings
) -> list[Defect]:
    """Joints that stand still to the last bit and jump out of it (`frozen_joint`), or into it as well (`dropout`)."""
    unknown = np.asarray(lost | whole[:, None])
    torn, stood = _torn_feet(seen, still_pos & ~whole[:, None], lost, settings)
    moved = _moved(seen, still_pos, unknown | stood, fps, settings)
    unknown = unknown | stood | moved["dropout"] | moved["frozen_joint"]
    unknown[:, 1:] |= unknown[:, list(PARENT[1:])]
    defects = []
    for code, mask in _turned(seen, unknown, fps, settings).items():
        mask[mask.sum(axis=1) >= POSE_BODIES] = True
        posed = np.repeat(mask.all(axis=1, keepdims=True), mask.shape[1], axis=1)
        defects += spans(code, "{names} keep their rotation to the last bit", mask, pos=posed, rot=mask)
    for code, mask in moved.items():
        defects += spans(code, "{names} keep their place to the last bit", mask, pos=mask, rot=mask)
    return defects + spans("frozen_joint", "{names} keep their place while the leg moves on", torn, pos=torn, rot=torn)


def _turned(seen: Seen, unknown: BodyMask, fps: float, settings: DetectionSettings) -> dict[str, BodyMask]:
    """Frames in which each body's rotation in its parent's frame is held; the pelvis has no parent."""
    still = _step(rotation.length(seen.local_turns)) < settings.still_step
    entering = turn_limits(settings) * slow_rate(fps)
    holds: list[list[Hold]] = [[] for _ in BODIES]
    for index in (1 + np.flatnonzero(still[:, 1:].any(axis=0))).tolist():
        limits = Limits(
            jump=settings.release_turn,
            short=settings.short_release_turn,
            entering=float(entering[index]),
            frames=settings.still_frames,
            longest=LOCKED_SHARE * len(still),
            excursion=settings.longest_spike_s * fps,
        )
        value, jump = rotation.to_matrix(seen.local[1][:, index]).reshape(-1, 9), seen.unsteadiness.turn[:, index]
        holds[index] = find_holds(still[:, index], value, jump, unknown[:, index], limits)
    return _marked(aligned(holds), len(still))


def _moved(
    seen: Seen, still: BodyMask, unknown: BodyMask, fps: float, settings: DetectionSettings
) -> dict[str, BodyMask]:
    """Frames in which each body's place in the world is held, and with an ankle its toes.

    Feet jump where their place in the parent's frame does, too: else it is the whole leg that jumps.
    """
    world, place = seen.unsteadiness.world, seen.unsteadiness.place
    jump = np.minimum(world, place)
    body = [index for index in range(len(BODIES)) if index not in FEET_BODIES]
    jump[:, body] = np.where(world > settings.position_jump, world, jump)[:, body]
    limits = Limits(
        jump=settings.release_place,
        short=settings.position_jump,
        entering=2.0 * slow_rate(fps) * settings.position_jump,
        frames=settings.still_frames,
        longest=np.inf,
        excursion=settings.longest_spike_s * fps,
    )
    holds: list[list[Hold]] = [[] for _ in BODIES]
    for index in np.flatnonzero(still.any(axis=0)).tolist():
        feet, value = index in FEET_BODIES, seen.pos_w[:, index]
        holds[index] = find_holds(still[:, index], value, jump[:, index], unknown[:, index], limits, anywhere=feet)
    held = _marked(aligned(holds), len(still))
    for mask in held.values():
        for index in FEET_BODIES:
            mask[:, index] |= mask[:, PARENT[index]] & still[:, index]
    return held


def _marked(holds: list[list[Hold]], count: int) -> dict[str, BodyMask]:
    """Frames in which each body is held, by the name under which it is reported."""
    held = {code: np.zeros((count, len(BODIES)), dtype=bool) for code in ("dropout", "frozen_joint")}
    for index, body in enumerate(holds):
        for one in body:
            held["dropout" if one.entered else "frozen_joint"][one.start : one.stop, index] = True
    return held


def _torn_feet(
    seen: Seen, still_pos: BodyMask, lost: BodyMask, settings: DetectionSettings
) -> tuple[BodyMask, BodyMask]:
    """Ankles and toes that keep their place as planted feet do, but off which the bone above them is pulled.

    From where that begins on, and from where they keep it: the foot may have stood first. The next bone of the leg
    keeps its length, else it is the joint between them that is elsewhere.
    """
    torn, stood = np.zeros_like(still_pos), np.zeros_like(still_pos)
    for index in FEET_BODIES:
        parent = PARENT[index]
        for start, stop in time_series.runs(still_pos[:, index]):
            span = slice(start - 1, stop)
            if stop - start >= settings.still_frames and not lost[span][:, [index, parent]].any():
                chain = seen.pos_w[span][:, [index, parent, PARENT[parent]]]
                lengths = rotation.length(np.diff(chain, axis=1))
                change = np.ptp(lengths, axis=0)
                if change[0] > TORN_M >= change[1]:
                    off = np.abs(lengths[1:, 0] - lengths[0, 0]) > PULLED_M
                    torn[start + int(np.argmax(off)) : stop, index] = True
                    stood[start:stop, index] = True
    return torn, stood


def _still_places(seen: Seen, settings: DetectionSettings) -> BodyMask:
    """Joints that are where they were in the frame before."""
    x, y, z = np.moveaxis(np.abs(np.diff(seen.pos_w, axis=0)), -1, 0)
    return _step(np.maximum(np.maximum(x, y), z)) < settings.still_step


def _step(size: Float[np.ndarray, "s 19"]) -> PerBody:
    """Steps from the frame before; the first frame has none and counts as moving."""
    return np.concatenate([np.full((1, size.shape[1]), np.inf), size])
