"""KP4 for one clip: the original and its variants, each with name and numbers; and the settings."""

import dataclasses
from collections.abc import Iterator
from dataclasses import dataclass, fields
from typing import Annotated

import numpy as np

from pipeline.augment.mirror import mirror_numbers, time_scale_clip, time_scale_numbers
from pipeline.augment.perturb import perturb
from pipeline.clips.outcome import LABELS, Number, Numbers, Outcome, Piece, Reason
from pipeline.clips.robot_clip import RobotClip
from pipeline.files.ranges import OneOf, Range
from pipeline.quality.sole import ContactSettings
from pipeline.robot import Robot
from pipeline.robot.mirror_image import MARK, mirror_clip

_SPEEDS = ("forward_m_s", "lateral_m_s")
"""Numbers that are proportional to the step length."""


@dataclass(frozen=True)
class Strength(Range):
    """Check that a strength is in its range and not neutral."""

    neutral: float = 0.0
    """Strength without effect."""
    number: str = ""
    """Key of the strength among a variant's numbers."""

    def problem(self, value: float) -> str | None:
        return f"is {value:g}, which is the original" if value == self.neutral else super().problem(value)


KINDS: dict[str, Strength] = {
    "step_length": Strength(0.7, 1.3, neutral=1.0, number="step_length"),
    "step_width": Strength(-0.05, 0.1, number="step_width_m"),
    "foot_lift": Strength(0.0, 0.08, number="foot_lift_m"),
    "trunk_lean": Strength(-10.0, 10.0, number="trunk_lean_deg"),
}
"""Kind of perturbation -> allowed strengths."""


@dataclass(frozen=True, kw_only=True)
class Strengths:
    """Variants to add to each clip: one for each strength of each kind. Empty: none."""

    step_length: Annotated[tuple[float, ...], KINDS["step_length"]] = ()
    """Step length relative to the original, at the same cadence."""
    step_width: Annotated[tuple[float, ...], KINDS["step_width"]] = ()
    """Additional step width [m]."""
    foot_lift: Annotated[tuple[float, ...], KINDS["foot_lift"]] = ()
    """Additional foot height at the highest point of each swing [m]."""
    trunk_lean: Annotated[tuple[float, ...], KINDS["trunk_lean"]] = ()
    """Additional lean of the trunk about the lateral axis through the hips [deg]; forward is positive."""

    def each(self) -> Iterator[tuple[str, float]]:
        """Every kind with every strength, in a fixed order."""
        for field in fields(self):
            for strength in getattr(self, field.name):
                yield field.name, strength


def perturbed_numbers(numbers: Numbers, kind: str, strength: float) -> dict[str, Number]:
    """Numbers of earlier stages for the variant, and the strength of each kind (neutral for the others).

    Longer steps at the same cadence are proportionally faster. KP3's figures are those of the original, since they
    compare human and robot without intentional changes.
    """
    found = dict(numbers)
    for name in _SPEEDS if kind == "step_length" else ():
        value = found.get(name)
        if isinstance(value, (int, float)):
            found[name] = value * strength
    return found | {each.number: strength if name == kind else each.neutral for name, each in KINDS.items()}


@dataclass(frozen=True)
class _Scale(Range):
    """Check that a time scale is in its range and not 1."""

    def problem(self, value: float) -> str | None:
        return "is 1, which is the original" if value == 1.0 else super().problem(value)


@dataclass(frozen=True, kw_only=True)
class AugmentSettings:
    """`data/augment.yaml`."""

    mirror: bool
    """Add each clip reflected in the robot's left-right plane."""
    time_scales: Annotated[tuple[float, ...], _Scale(0.5, 2.0)]
    """Time scales to add to the original: 1.1 makes all velocities 1.1 times as high."""
    unscaled_skills: Annotated[tuple[str, ...], OneOf(LABELS)]
    """Skills that are not time-scaled, such as standing."""
    perturbations: Strengths
    """Variants with other steps or another posture."""
    contact: ContactSettings
    """Limits for inferring contacts in a recording without labels, for perturbations."""


def process(clip: RobotClip, numbers: Numbers, *, settings: AugmentSettings, robot: Robot) -> Outcome:
    """The clip, its mirror image, and time-scaled and perturbed variants of both, according to the settings.

    The numbers of a piece have its `variant`, `mirrored`, `time_scale`, `parent` (the original clip; variants of one
    parent share a weight later) and the strength of each perturbation. A perturbation that is infeasible or has no
    effect gives a reason instead of a piece.
    """
    originals = [_piece(clip, numbers, clip.name, mirrored=False, scale=1.0)]
    if settings.mirror:
        image = mirror_clip(clip, robot, f"{clip.name}{MARK}")
        originals.append(_piece(image, mirror_numbers(numbers), clip.name, mirrored=True, scale=1.0))
    pieces = list(originals)
    if numbers.get("skill") not in settings.unscaled_skills:
        for scale in settings.time_scales:
            faster = time_scale_clip(clip, scale, clip.name)
            pieces += [_scaled(piece, faster, scale, clip.name, robot) for piece in originals]
    perturbed, reasons = _perturbed(originals, settings.perturbations, robot, settings.contact)
    pieces += perturbed
    return Outcome(pieces=tuple(pieces), reasons=tuple(reasons), numbers={"variants": len(pieces)})


def _scaled(piece: Piece, faster: RobotClip, scale: float, parent: str, robot: Robot) -> Piece:
    """The piece at another speed.

    `faster` is not mirrored; it is mirrored here for a mirrored piece. Splines
    overshoot where a joint rests at its limit, so joint positions are clipped to the limits, or to the range of the
    piece where that is wider.

    Args:
        piece: original or mirrored piece at its own speed
        faster: the original clip, time-scaled
        scale: speed over the original's
        parent: name of the original clip
        robot: robot of the clip
    """
    clip, name = piece.clip, f"{piece.clip.name}~x{scale:g}"
    assert isinstance(clip, RobotClip)
    mirrored = bool(piece.numbers["mirrored"])
    faster = mirror_clip(faster, robot, name) if mirrored else dataclasses.replace(faster, name=name)
    lower = np.minimum(robot.joint_lower, clip.joint_pos.min(axis=0))
    upper = np.maximum(robot.joint_upper, clip.joint_pos.max(axis=0))
    faster = dataclasses.replace(
        faster,
        root_pos_w=faster.root_pos_w + 0.0,  # a spline has no negative zeros
        root_quat_w=faster.root_quat_w + 0.0,
        joint_pos=np.clip(faster.joint_pos, lower, upper) + 0.0,
    )
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
