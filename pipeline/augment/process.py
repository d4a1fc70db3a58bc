"""KP4 on one clip: the original and its variants, each with its name and numbers."""

from __future__ import annotations

import dataclasses

import numpy as np

from pipeline.augment.mirror import mirror_clip, mirror_numbers, time_scale_clip, time_scale_numbers
from pipeline.augment.perturb import perturb
from pipeline.augment.settings import AugmentSettings, Strengths, perturbed_numbers
from pipeline.clips.outcome import Numbers, Outcome, Piece, Reason
from pipeline.clips.robot_clip import RobotClip
from pipeline.quality.sole import ContactSettings
from pipeline.robot import Robot


def process(clip: RobotClip, numbers: Numbers, *, settings: AugmentSettings, robot: Robot) -> Outcome:
    """The clip, its mirror image, and both at other playing speeds and with perturbations, as the settings say.

    Each piece says its `variant`, whether it is `mirrored`, its `time_scale` and, as `parent`, the name of
    the clip it was made from: variants of one parent share a weight later. A perturbed one says the strength of each
    kind too. A perturbation that the robot can't follow, or that changes nothing, is a reason and no piece.
    """
    originals = [_piece(clip, numbers, clip.name, mirrored=False, scale=1.0)]
    if settings.mirror:
        image = mirror_clip(clip, robot, f"{clip.name}~mirror")
        originals.append(_piece(image, mirror_numbers(numbers), clip.name, mirrored=True, scale=1.0))
    pieces = list(originals)
    if numbers.get("skill") not in settings.unscaled_skills:
        pieces += [_scaled(piece, scale, clip.name, robot) for scale in settings.time_scales for piece in originals]
    perturbed, reasons = _perturbed(originals, settings.perturbations, robot, settings.contact)
    pieces += perturbed
    return Outcome(pieces=tuple(pieces), reasons=tuple(reasons), numbers={"variants": len(pieces)})


def _scaled(piece: Piece, scale: float, parent: str, robot: Robot) -> Piece:
    """The piece at another speed. Splines overshoot where a joint rests at its limit: what they pass it by is cut."""
    clip = piece.clip
    assert isinstance(clip, RobotClip)
    faster = time_scale_clip(clip, scale, f"{clip.name}~x{scale:g}")
    lower = np.minimum(robot.joint_lower, clip.joint_pos.min(axis=0))
    upper = np.maximum(robot.joint_upper, clip.joint_pos.max(axis=0))
    faster = dataclasses.replace(faster, joint_pos=np.clip(faster.joint_pos, lower, upper))
    mirrored = bool(piece.numbers["mirrored"])
    return _piece(faster, time_scale_numbers(piece.numbers, scale), parent, mirrored=mirrored, scale=scale)


def _perturbed(
    originals: list[Piece], strengths: Strengths, robot: Robot, contact: ContactSettings
) -> tuple[list[Piece], list[Reason]]:
    pieces: list[Piece] = []
    reasons: list[Reason] = []
    for kind, strength in strengths.each():
        for piece in originals:
            clip, mark = piece.clip, f"{kind}{strength:g}"
            assert isinstance(clip, RobotClip)
            variant = f"mirror~{mark}" if piece.numbers["mirrored"] else mark
            made = perturb(clip, robot, kind, strength, f"{clip.name}~{mark}", contact)
            if isinstance(made, Reason):
                reasons.append(dataclasses.replace(made, text=f"{variant} {made.text}"))
                continue
            numbers = {**perturbed_numbers(piece.numbers, kind, strength), "variant": variant}
            pieces.append(Piece(clip=made, numbers=numbers))
    return pieces, reasons


def _piece(clip: RobotClip, numbers: Numbers, parent: str, *, mirrored: bool, scale: float) -> Piece:
    parts = (["mirror"] if mirrored else []) + ([f"x{scale:g}"] if scale != 1.0 else [])
    made = {
        "variant": "~".join(parts) or "original",
        "mirrored": mirrored,
        "time_scale": scale,
        "parent": parent,
        "seconds": clip.duration_s,
    }
    return Piece(clip=clip, numbers={**numbers, **made})
