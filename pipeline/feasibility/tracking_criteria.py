"""Criteria on tracking: the error of a rollout to its reference, and whether it recovers.

Joint angles are compared directly; key bodies (links, hands, soles) relative to the root in its heading frame. Root
height, gravity direction in the root's frame and the heights of hands and soles are compared as in BeyondMimic's
terminations. The root's path is compared after the best horizontal rigid fit, so that position and heading do not
count, but short steps do.
"""

from dataclasses import dataclass
from typing import Annotated

import numpy as np
from jaxtyping import Float

from pipeline import rotation, time_series
from pipeline.clips.outcome import Numbers
from pipeline.clips.robot_clip import RobotClip
from pipeline.feasibility.criterion import (
    NUMBERS,
    WHOLE_CLIP,
    Criterion,
    Result,
    Seconds,
    ShareOfFrames,
    Skipped,
    Verdict,
    criterion,
)
from pipeline.feasibility.motion import NO_ROLLOUT, Motion
from pipeline.feasibility.over_time import windowed_mean
from pipeline.feasibility.reference import CONTENT
from pipeline.files.ranges import Range
from pipeline.files.sourced import LENGTH, Unit
from pipeline.quality.retargeting import percentile_of_least
from pipeline.robot import Kinematics, Robot

GROUP = "tracking stability"

NOT_CUT = "no rollout of KP4"

_Angle = Annotated[float, Range(0.0, 3.2, open_low=True), Unit("rad")]
_Length = Annotated[float, Range(0.0, 2.0, open_low=True), Unit("m"), LENGTH]


@dataclass(frozen=True, kw_only=True)
class TrackingSettings:
    """Limits for the error of a rollout to its reference at the same time."""

    followed: ShareOfFrames
    """Least share of its reference that a rollout follows before tracking fails."""
    window_s: Annotated[float, Range(0.02, 10.0), Unit("s")]
    """Length of the windows for means; the worst and the last window are evaluated [s]."""
    joint_p95: _Angle
    """Largest 95th percentile over frames of the joints' RMS error [rad]."""
    joint_worst: _Angle
    """Largest windowed mean of the joints' RMS error [rad]."""
    body_p95: _Length
    """Largest 95th percentile over frames of the largest key body error, relative to the root [m]."""
    body_worst: _Length
    """Largest windowed mean of the largest key body error [m]."""
    growth: _Length
    """Largest difference between that mean of the last window and its median over windows [m]."""
    away_s: Seconds
    """Longest uninterrupted time of that error above `body_p95` [s]."""
    root_height: _Length
    """Largest difference of the root's height [m]."""
    gravity: Annotated[float, Range(0.0, 2.0, open_low=True), Unit("-")]
    """Largest difference of the z component of the gravity direction in the root's frame."""
    end_height: _Length
    """Largest difference in height of a hand or a sole [m]."""
    path: _Length
    """Largest distance of the root's path from the reference's, after the best horizontal fit [m]."""


@dataclass(frozen=True, kw_only=True)
class TrackingError:
    """Tracking error of each frame."""

    joint: Float[np.ndarray, " t"]
    """RMS error over the controlled joints [rad]."""
    body: Float[np.ndarray, " t"]
    """Largest key body error, relative to the root in its heading frame [m]."""
    root_height: Float[np.ndarray, " t"]
    """Error of the root height [m]."""
    gravity: Float[np.ndarray, " t"]
    """Error of the z component of the gravity direction in the root's frame."""
    end_height: Float[np.ndarray, " t"]
    """Largest height error of hands and soles [m]."""
    path: Float[np.ndarray, " t"]
    """Horizontal distance of the root after the best horizontal rigid fit of both paths [m]."""


@criterion(
    Criterion(
        "tracking_followed",
        GROUP,
        "tracking.followed",
        "of frames",
        "share of the reference that the tracker followed",
        cuts=WHOLE_CLIP,
        lower=True,
        of=NUMBERS,
    )
)
def followed(numbers: Numbers, settings: TrackingSettings) -> tuple[Result, ...]:
    """Verdict on the share of its reference that a KP4 rollout followed; skipped for other motions."""
    share = numbers.get("followed_share")
    if share is None:
        return (Skipped(code="tracking_followed", not_applicable=NOT_CUT if numbers.get(CONTENT) else NO_ROLLOUT),)
    text = f"the tracker follows {100 * float(share):.0f} % of the reference"
    return (Verdict(code="tracking_followed", value=float(share), limit=settings.followed, text=text),)


CRITERIA = (
    Criterion("tracking_joint_p95", GROUP, "tracking.joint_p95", "rad", "RMS joint error, 95th percentile"),
    Criterion("tracking_joint_worst", GROUP, "tracking.joint_worst", "rad", "RMS joint error, worst mean over 0.5 s"),
    Criterion(
        "tracking_body_p95",
        GROUP,
        "tracking.body_p95",
        "m",
        "largest position error of a link, hand or sole relative to the root, 95th percentile",
    ),
    Criterion("tracking_body_worst", GROUP, "tracking.body_worst", "m", "the same error, worst mean over 0.5 s"),
    Criterion("tracking_growth", GROUP, "tracking.growth", "m", "mean error in the last 0.5 s minus the median error"),
    Criterion("tracking_away_s", GROUP, "tracking.away_s", "s", "longest time above `tracking.body_p95`"),
    Criterion("tracking_root_height", GROUP, "tracking.root_height", "m", "largest error of the root height"),
    Criterion("tracking_gravity", GROUP, "tracking.gravity", "-", "largest error of gravity in the root frame"),
    Criterion("tracking_end_height", GROUP, "tracking.end_height", "m", "largest height error of a hand or sole"),
    Criterion(
        "tracking_path", GROUP, "tracking.path", "m", "largest root position error after the best fit of the paths"
    ),
)


@criterion(*CRITERIA)
def tracking(motion: Motion, settings: TrackingSettings) -> tuple[Result, ...]:
    """Verdicts on a tracked rollout; skipped without a reference."""
    if motion.reference is None:
        return tuple(Skipped(code=each.code, not_applicable=motion.no_reference) for each in CRITERIA)
    error = tracking_error(motion.clip, motion.reference, motion.robot)
    width = 2 * round(settings.window_s * motion.clip.fps / 2) + 1
    joint, body = windowed_mean(error.joint, width), windowed_mean(error.body, width)
    least = motion.least_frames
    return (
        _often("joint_p95", error.joint, settings.joint_p95, least, "joints are more than {:.2f} rad off"),
        _worst("joint_worst", joint, settings.joint_worst, "joints are {:.2f} rad off on average", motion),
        _often("body_p95", error.body, settings.body_p95, least, "a key body is more than {:.2f} m off"),
        _worst("body_worst", body, settings.body_worst, "a key body is {:.2f} m off on average", motion),
        _growth(body, settings, motion),
        _away(error.body, settings, motion),
        _peak("root_height", error.root_height, settings.root_height, "the root's height is {:.2f} m off"),
        _peak("gravity", error.gravity, settings.gravity, "the vertical in the root's frame is {:.2f} off"),
        _peak("end_height", error.end_height, settings.end_height, "a hand or sole is {:.2f} m off in height"),
        _peak("path", error.path, settings.path, "the root is {:.2f} m away from"),
    )


def tracking_error(clip: RobotClip, reference: RobotClip, robot: Robot) -> TrackingError:
    """Error of a rollout to its reference at each frame."""
    moved = robot.controlled_index
    joint = np.sqrt(np.mean((clip.joint_pos - reference.joint_pos)[:, moved] ** 2, axis=1))
    here, there = _key_bodies(clip, robot), _key_bodies(reference, robot)
    ends = slice(-len((*robot.hands, *robot.feet)), None)
    end_height = here[:, ends, 2] + clip.root_pos_w[:, None, 2] - there[:, ends, 2] - reference.root_pos_w[:, None, 2]
    return TrackingError(
        joint=joint,
        body=np.linalg.norm(here - there, axis=2).max(axis=1),
        root_height=np.abs(clip.root_pos_w[:, 2] - reference.root_pos_w[:, 2]),
        gravity=np.abs(_up_b(clip)[:, 2] - _up_b(reference)[:, 2]),
        end_height=np.abs(end_height).max(axis=1),
        path=_path_distance(clip.root_pos_w[:, :2], reference.root_pos_w[:, :2]),
    )


def _path_distance(path_w: Float[np.ndarray, "t 2"], reference_w: Float[np.ndarray, "t 2"]) -> Float[np.ndarray, " t"]:
    """Distance at each frame after the planar rigid fit with the least sum of squares (Kabsch) [m]."""
    here, there = path_w - path_w.mean(axis=0), reference_w - reference_w.mean(axis=0)
    turn = np.arctan2(np.sum(here[:, 0] * there[:, 1] - here[:, 1] * there[:, 0]), np.sum(here * there))
    cos, sin = np.cos(turn), np.sin(turn)
    turned = np.stack([cos * here[:, 0] - sin * here[:, 1], sin * here[:, 0] + cos * here[:, 1]], axis=1)
    return np.linalg.norm(turned - there, axis=1)


def _key_bodies(clip: RobotClip, robot: Robot) -> Float[np.ndarray, "t k 3"]:
    """Positions of key links, hands and soles relative to the root, in its heading frame [m]."""
    kinematics = Kinematics(robot)
    poses = kinematics.forward(clip.root_pos_w, clip.root_quat_w, clip.joint_pos)
    links = poses.pos_w[:, [robot.link(name) for name in robot.key_links]]
    sites = kinematics.site_pos_w(poses, (*robot.hands, *robot.feet))
    away = np.concatenate([links, sites], axis=1) - clip.root_pos_w[:, None]
    return rotation.rotate(rotation.about_z(-rotation.yaw_of(clip.root_quat_w))[:, None], away)


def _up_b(clip: RobotClip) -> Float[np.ndarray, "t 3"]:
    """The world's z axis in the root's frame."""
    return rotation.rotate_inverse(clip.root_quat_w, np.array([0.0, 0.0, 1.0]))


def _often(name: str, values: np.ndarray, limit: float, least: int, text: str) -> Verdict:
    value = percentile_of_least(values, 95, least)
    sentence = f"{text.format(value)} the motion that was tracked in 5 % of the time"
    return _verdict(name, value, limit, sentence, values > limit)


def _worst(name: str, means: np.ndarray, limit: float, text: str, motion: Motion) -> Verdict:
    at = int(np.argmax(means))
    sentence = f"around {at / motion.clip.fps:.2f} s {text.format(means[at])} the motion that was tracked"
    return _verdict(name, float(means[at]), limit, sentence, means > limit)


def _peak(name: str, values: np.ndarray, limit: float, text: str) -> Verdict:
    at = int(np.argmax(values))
    sentence = f"frame {at}: {text.format(values[at])} the motion that was tracked"
    return _verdict(name, float(values[at]), limit, sentence, values > limit)


def _growth(means: np.ndarray, settings: TrackingSettings, motion: Motion) -> Verdict:
    """Verdict on the error of the last window relative to the median; marks the frames since the error grew."""
    usual = float(np.median(means))
    value = max(float(means[-1]) - usual, 0.0)
    near = np.flatnonzero(means <= usual + settings.growth)
    bad = np.zeros(len(means), dtype=bool)
    bad[near[-1] + 1 if len(near) else 0 :] = True
    sentence = (
        f"the error grows: at the end a key body is {means[-1]:.2f} m off the motion that was tracked, {usual:.2f} m "
    )
    return _verdict("growth", value, settings.growth, f"{sentence}at most times", bad)


def _away(body: np.ndarray, settings: TrackingSettings, motion: Motion) -> Verdict:
    """Verdict on the longest time without recovery."""
    fps = motion.clip.fps
    spans = time_series.runs(body > settings.body_p95)
    longest = max(spans, key=lambda span: span[1] - span[0], default=(0, 0))
    value = (longest[1] - longest[0]) / fps
    bad = np.zeros(len(body), dtype=bool)
    for start, stop in spans:
        bad[start:stop] = (stop - start) / fps > settings.away_s
    sentence = (
        f"from {longest[0] / fps:.2f} s on a key body is more than {settings.body_p95:g} m off the motion that was "
    )
    return _verdict("away_s", value, settings.away_s, f"{sentence}tracked for {value:.2f} s in a row", bad)


def _verdict(name: str, value: float, limit: float, text: str, bad: np.ndarray) -> Verdict:
    return Verdict(code=f"tracking_{name}", value=value, limit=limit, text=text, bad=bad)
