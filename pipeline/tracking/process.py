"""KP4 for one reference: its nominal and disturbed rollouts, cut where tracking fails."""

import dataclasses
import hashlib
import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from pipeline.clips.outcome import Clip, Number, Numbers, Outcome, Piece, Reason
from pipeline.clips.robot_clip import RobotClip
from pipeline.errors import ClipError
from pipeline.robot import Robot
from pipeline.robot.size import scaled
from pipeline.simulation.torque_envelope import TorqueEnvelope
from pipeline.tracking.before_after import before_after, tracking_error
from pipeline.tracking.disturbance import NONE, Disturbance, draw
from pipeline.tracking.rollout import Plant, TrackedStretch, rollout
from pipeline.tracking.settings import TrackingSettings
from pipeline.tracking.task import CONTROL_HZ
from pipeline.tracking.tracker import load_tracker

NOT_TRACKED = "not_tracked"
"""Reason code of a reference that the nominal rollout does not follow to its end."""

AS_RETARGETED = ("original", "mirror")
"""Variants with the unmodified retargeted motion."""


@dataclass(frozen=True, kw_only=True)
class Setup:
    """Inputs of rollouts other than the reference."""

    settings: TrackingSettings
    robot: Robot
    envelope: TorqueEnvelope
    tracker: Path


def process(clip: RobotClip, numbers: Numbers, *, setup: Setup) -> Outcome:
    """The rollouts of a reference: `<name>~rollout`, and `<name>~rollout1`, … under disturbances.

    The numbers of a piece have its reference and position in it, its disturbance and its tracking errors; its clip has
    the simulated torques and contact forces. Where tracking fails a rollout is cut, and restarted a little later on the
    reference. A failure of the nominal rollout is a reason against the reference.

    Raises ClipError for a clip of another rate or with fewer than three frames, FileError for a tracker of another
    robot.
    """
    rollouts, settings = _Rollouts(clip, setup), setup.settings
    count = disturbed_count(clip, numbers, settings)
    nominal = rollouts.of(0)
    pieces = rollouts.pieces(nominal, numbers)
    for number in range(1, count + 1):
        pieces += rollouts.pieces(rollouts.of(number), numbers)
    reasons = [_reason(stretch) for stretch in nominal.stretches if stretch.failed]
    if not pieces and not reasons:
        text = f"its rollouts are shorter than {settings.shortest_s:g} s"
        reasons = [Reason(code="too_short", text=text, effect="rejected", value=clip.duration_s, unit="s")]
    disturbed = sum(piece.numbers["rollout"] != 0 for piece in pieces)
    found = _figures(clip, nominal.stretches, setup.robot) | {"rollouts": count + 1, "disturbed_pieces": disturbed}
    return Outcome(pieces=tuple(pieces), reasons=tuple(reasons), numbers=found)


def disturbed_count(clip: RobotClip, numbers: Numbers, settings: TrackingSettings) -> int:
    """Number of disturbed rollouts of a reference; higher for short originals and mirror images."""
    if numbers.get("variant") not in AS_RETARGETED:
        return settings.disturbed_variants
    if not settings.disturbed:
        return 0
    return max(settings.disturbed, math.ceil(settings.disturbed_s / clip.duration_s))


def disturbed_motion(clip: RobotClip, numbers: Numbers, *, setup: Setup, longest_s: float) -> Outcome:
    """The first disturbed rollout of the first `longest_s` seconds of a reference, without forces.

    Raises as `process` does.
    """
    part = clip.cut(0, min(clip.frame_count, round(longest_s * clip.fps)), clip.name)
    rollouts = _Rollouts(part, setup)
    pieces = rollouts.pieces(rollouts.of(1), numbers)
    return Outcome(pieces=tuple(dataclasses.replace(piece, clip=_motion(piece.clip)) for piece in pieces))


def motion_to_failure(clip: RobotClip, numbers: Numbers, *, setup: Setup) -> Outcome:
    """The nominal rollout from the first frame of a reference to the frame at which it fails, without forces.

    Raises as `process` does.
    """
    first = _Rollouts(clip, setup).of(0).stretches[0]
    return Outcome(pieces=(Piece(clip=_motion(first.clip), numbers={"seconds": first.clip.duration_s}),))


def _motion(clip: Clip) -> RobotClip:
    assert isinstance(clip, RobotClip)
    return dataclasses.replace(clip, forces=None)


@dataclass(frozen=True, kw_only=True)
class _Rollout:
    """One rollout of a reference; number 0 is the nominal one."""

    number: int
    disturbance: Disturbance
    stretches: tuple[TrackedStretch, ...]


class _Rollouts:
    """Rollouts of one reference."""

    def __init__(self, clip: RobotClip, setup: Setup):
        if clip.fps != CONTROL_HZ or clip.frame_count < 3:
            got = f"has {clip.frame_count} frames at {clip.fps:g} Hz"
            raise ClipError(clip.name, "rate", f"{got}; at least 3 at {CONTROL_HZ:g} Hz are needed")
        self._clip, self._robot, self._settings = clip, setup.robot, scaled(setup.settings, setup.robot)
        self._plant = Plant(robot=setup.robot, envelope=setup.envelope)
        self._tracker = load_tracker(setup.tracker, setup.robot)

    def of(self, number: int) -> _Rollout:
        """The rollout with a number and its disturbance."""
        clip, settings = self._clip, self._settings
        rng = np.random.default_rng(_seed(clip, settings.seed, number))
        disturbance = draw(settings.disturbance, clip.duration_s, rng) if number else NONE
        stretches = rollout(clip, self._plant, self._tracker, settings.failure, disturbance, rng if number else None)
        return _Rollout(number=number, disturbance=disturbance, stretches=stretches)

    def pieces(self, made: _Rollout, reference: Numbers) -> list[Piece]:
        """Pieces of a rollout with the reference's numbers and their position in the reference's clip."""
        clip, settings, stretches = self._clip, self._settings, made.stretches
        name = f"{clip.name}~rollout{made.number or ''}"
        complete = len(stretches) == 1 and not stretches[0].failed
        followed = sum(stretch.stop - stretch.start for stretch in stretches) / clip.frame_count
        pieces: list[Piece] = []
        for stretch in stretches:
            stop = stretch.stop - (round(settings.failure.before_s * CONTROL_HZ) if stretch.failed else 0)
            if stop - stretch.start < settings.shortest_s * CONTROL_HZ:
                continue
            motion = stretch.clip.cut(0, stop - stretch.start, name if complete else f"{name}+{len(pieces)}")
            error = tracking_error(motion, clip.cut(stretch.start, stop, clip.name), self._robot)
            start_s = float(reference.get("stretch_start_s") or 0.0) + stretch.start / CONTROL_HZ
            numbers = {
                **reference,
                "reference": clip.name,
                "reference_frame": stretch.start,
                "rollout": made.number,
                "seed": settings.seed,
                "seconds": motion.duration_s,
                "survived": complete,
                "followed_share": min(followed, 1.0),
                "body_error_m": float(error.body.mean()),
                "joint_error_rad": float(error.joint.mean()),
                "path_error_m": float(error.path.mean()),
                **made.disturbance.numbers(),
                "stretch_start_s": start_s,
                "stretch_stop_s": start_s + motion.duration_s,
            }
            pieces.append(Piece(clip=motion, numbers=numbers))
        return pieces


def _seed(clip: RobotClip, seed: int, number: int) -> list[int]:
    """Seed of a rollout from the reference's motion, so that it is independent of the reference's name and order."""
    content = hashlib.sha256()
    for values in (clip.root_pos_w, clip.root_quat_w, clip.joint_pos):
        content.update(np.ascontiguousarray(values, dtype="<f8").tobytes())
    return [seed, number, int.from_bytes(content.digest()[:8], "little")]


def _figures(clip: RobotClip, stretches: Sequence[TrackedStretch], robot: Robot) -> dict[str, Number]:
    """Tracking quality of the nominal rollout, failed stretches included; comparison of its longest stretch."""
    references = [clip.cut(stretch.start, stretch.stop, clip.name) for stretch in stretches]
    parts = [tracking_error(each.clip, own, robot) for each, own in zip(stretches, references, strict=True)]
    body, joint, path = (np.concatenate([getattr(part, name) for part in parts]) for name in ("body", "joint", "path"))
    frames = np.concatenate([np.arange(each.start, each.stop) for each in stretches])
    first = stretches[0]
    longest = max(range(len(stretches)), key=lambda index: references[index].frame_count)
    return {
        **before_after(references[longest], stretches[longest].clip, robot),
        "survived": len(stretches) == 1 and not first.failed,
        "followed_s": (first.stop - first.start) / CONTROL_HZ,
        "body_error_m": float(body.mean()),
        "joint_error_rad": float(joint.mean()),
        "path_error_m": float(path.mean()),
        "worst_body_error_m": float(body.max()),
        "worst_at_s": float(frames[np.argmax(body)]) / CONTROL_HZ,
    }


def _reason(stretch: TrackedStretch) -> Reason:
    at_s = (stretch.stop - 1) / CONTROL_HZ
    return Reason(
        code=NOT_TRACKED,
        text=f"the tracker cannot follow it: at {at_s:.2f} s {stretch.failed}",
        effect="rejected",
        start_s=stretch.start / CONTROL_HZ,
        stop_s=at_s,
    )
