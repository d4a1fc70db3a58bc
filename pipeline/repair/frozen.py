"""Detect frozen stretches: real motion never repeats a value bit by bit.

`holds.py` distinguishes a person's rest from a frozen pose.
"""

import numpy as np
from jaxtyping import Float

from pipeline import rotation, time_series
from pipeline.clips.human_clip import BODIES, PARENT
from pipeline.repair.defect import Defect, spans
from pipeline.repair.holds import Hold, Limits, aligned, find_holds
from pipeline.repair.settings import DetectionSettings
from pipeline.repair.tree import FEET_BODIES, BodyMask, FrameMask, PerBody
from pipeline.repair.unsteadiness import MotionFeatures, slow_rate, turn_limits

POSE_BODIES = 12
"""Number of joints with a frozen rotation from which the whole pose counts as frozen."""

TORN_M = 0.005
"""Largest length change of a leg's bone while the foot is in stance [m]."""

PULLED_M = 0.001
"""Length change of the bone above a foot from which the foot is no longer in stance [m]."""


LOCKED_SHARE = 0.5
"""Share of the clip above which a constant angle is a locked or missing joint, not a frozen one."""


def find_frozen(features: MotionFeatures, lost: BodyMask, fps: float, settings: DetectionSettings) -> list[Defect]:
    """Frames equal to the previous one: of the whole body (`frozen`; a single frame `repeated_frame`) or of one joint.

    `lost` samples are interpolated in `features`; the lengths of bones at such samples are not used.
    """
    if len(features.pos_w) < 6:
        return []
    still_pos = _still_places(features, settings)
    whole = np.asarray(still_pos.all(axis=1))
    whole[1:] &= (rotation.length(features.world_turns) < settings.still_step).all(axis=1)
    jumped = features.unsteadiness.place[:, 0] > settings.root_jump * slow_rate(fps)
    defects = []
    for start, stop in time_series.runs(whole):
        first = start - 1 if jumped[start - 1] else start  # the pose was entered with a jump
        defects.append(
            Defect(
                code="repeated_frame" if stop - start == 1 else "frozen",
                text=f"all joints equal to the frame before for {(stop - start) / fps:.3f} s",
                start=first,
                stop=stop,
                bodies=tuple(range(len(BODIES))),
            )
        )
    return defects + _frozen_joints(features, still_pos, whole, lost, fps, settings)


def _frozen_joints(
    features: MotionFeatures,
    still_pos: BodyMask,
    whole: FrameMask,
    lost: BodyMask,
    fps: float,
    settings: DetectionSettings,
) -> list[Defect]:
    """Joints whose pose is exactly constant and is left with a jump (`frozen_joint`), or also entered with one
    (`dropout`)."""
    unknown = np.asarray(lost | whole[:, None])
    torn, stood = _torn_feet(features, still_pos & ~whole[:, None], lost, settings)
    moved = _moved(features, still_pos, unknown | stood, fps, settings)
    unknown = unknown | stood | moved["dropout"] | moved["frozen_joint"]
    unknown[:, 1:] |= unknown[:, list(PARENT[1:])]
    defects = []
    for code, mask in _turned(features, unknown, fps, settings).items():
        mask[mask.sum(axis=1) >= POSE_BODIES] = True
        posed = np.repeat(mask.all(axis=1, keepdims=True), mask.shape[1], axis=1)
        defects += spans(code, "{names} keep their rotation to the last bit", mask, pos=posed, rot=mask)
    for code, mask in moved.items():
        defects += spans(code, "{names} keep their place to the last bit", mask, pos=mask, rot=mask)
    return defects + spans("frozen_joint", "{names} keep their place while the leg moves on", torn, pos=torn, rot=torn)


def _turned(
    features: MotionFeatures, unknown: BodyMask, fps: float, settings: DetectionSettings
) -> dict[str, BodyMask]:
    """Frames in which each body's rotation in its parent's frame is frozen; not for the pelvis."""
    still = _step(rotation.length(features.local_turns)) < settings.still_step
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
        value, jump = (
            rotation.to_matrix(features.local[1][:, index]).reshape(-1, 9),
            features.unsteadiness.turn[:, index],
        )
        holds[index] = find_holds(still[:, index], value, jump, unknown[:, index], limits)
    return _marked(aligned(holds), len(still))


def _moved(
    features: MotionFeatures, still: BodyMask, unknown: BodyMask, fps: float, settings: DetectionSettings
) -> dict[str, BodyMask]:
    """Frames in which each body's world position is frozen; with an ankle also its toes.

    A foot counts as jumping only if its position in the parent's frame jumps too; otherwise the whole leg jumps.
    """
    world, place = features.unsteadiness.world, features.unsteadiness.place
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
        feet, value = index in FEET_BODIES, features.pos_w[:, index]
        holds[index] = find_holds(still[:, index], value, jump[:, index], unknown[:, index], limits, anywhere=feet)
    held = _marked(aligned(holds), len(still))
    for mask in held.values():
        for index in FEET_BODIES:
            mask[:, index] |= mask[:, PARENT[index]] & still[:, index]
    return held


def _marked(holds: list[list[Hold]], count: int) -> dict[str, BodyMask]:
    """Mask of the frames in which each body is frozen, by defect code."""
    held = {code: np.zeros((count, len(BODIES)), dtype=bool) for code in ("dropout", "frozen_joint")}
    for index, body in enumerate(holds):
        for one in body:
            held["dropout" if one.entered else "frozen_joint"][one.start : one.stop, index] = True
    return held


def _torn_feet(
    features: MotionFeatures, still_pos: BodyMask, lost: BodyMask, settings: DetectionSettings
) -> tuple[BodyMask, BodyMask]:
    """Ankles and toes that are stationary like planted feet although the bone above them changes its length.

    First mask: from the start of the length change; second: from the start of the rest, since the foot may have been in
    stance first. The next bone of the leg must keep its length, otherwise the joint between them is wrong.
    """
    torn, stood = np.zeros_like(still_pos), np.zeros_like(still_pos)
    for index in FEET_BODIES:
        parent = PARENT[index]
        for start, stop in time_series.runs(still_pos[:, index]):
            span = slice(start - 1, stop)
            if stop - start >= settings.still_frames and not lost[span][:, [index, parent]].any():
                chain = features.pos_w[span][:, [index, parent, PARENT[parent]]]
                lengths = rotation.length(np.diff(chain, axis=1))
                change = np.ptp(lengths, axis=0)
                if change[0] > TORN_M >= change[1]:
                    off = np.abs(lengths[1:, 0] - lengths[0, 0]) > PULLED_M
                    torn[start + int(np.argmax(off)) : stop, index] = True
                    stood[start:stop, index] = True
    return torn, stood


def _still_places(features: MotionFeatures, settings: DetectionSettings) -> BodyMask:
    """Joints with the same world position as in the previous frame."""
    x, y, z = np.moveaxis(np.abs(np.diff(features.pos_w, axis=0)), -1, 0)
    return _step(np.maximum(np.maximum(x, y), z)) < settings.still_step


def _step(size: Float[np.ndarray, "s 19"]) -> PerBody:
    """Step sizes per frame; the first frame, which has no step, counts as moving."""
    return np.concatenate([np.full((1, size.shape[1]), np.inf), size])
