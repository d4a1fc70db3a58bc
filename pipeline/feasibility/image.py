"""The assessment of a mirror image by that of the motion that it shows, where the robot is symmetric.

What the criteria measure is then the same on both sides, to the tolerance within which the robot is its own mirror
image. Evaluated for each of the two are only a few criteria (`OWN`), and images that break one, as its message names a
side.
"""

import dataclasses
from dataclasses import dataclass

import numpy as np

from pipeline import rotation
from pipeline.clips.outcome import Numbers
from pipeline.clips.robot_clip import RobotClip
from pipeline.feasibility.assess import Assessment, assess, parted
from pipeline.feasibility.criterion import MOTION, results
from pipeline.feasibility.motion import FPS, at_database_rate, motion_of
from pipeline.feasibility.reference import CLIP, CONTENT
from pipeline.feasibility.settings import FeasibilitySettings
from pipeline.quality.sole import sole_motion
from pipeline.robot import Kinematics, Robot
from pipeline.robot.mirror_image import MARK, POSITION, mirror_clip, mirror_corners
from pipeline.simulation.mujoco_plant import self_collision

OWN = (
    *("joint_limit_excess", "joint_speed_ratio", "joint_speed_over_share", "joint_speed_over_run_s"),
    *("foot_slip_mean", "foot_inferred_slip_mean", "foot_slip_p95"),
)
"""Criteria that are evaluated on the image itself: limits, which may differ between left and right, and slip, whose
last digits depend on the order of the corners."""

TOLERANCE_M = 1e-5
"""A robot is symmetric where links, soles and overlaps of its shapes in mirrored poses differ by less than this [m].
The overlaps of MuJoCo's shapes are exact to some 1e-6 m."""

POSES = 32
"""Random poses that show whether a robot is symmetric."""


@dataclass
class LastAssessed:
    """The assessment of the motion that a process evaluated last: its mirror image often comes next."""

    whole: Assessment | None = None

    def of(self, clip: RobotClip) -> Assessment | None:
        """The assessment, if it is that of a clip with these frames."""
        if self.whole is None:
            return None
        last, names = self.whole.motion.clip, ("root_pos_w", "root_quat_w", "joint_pos", "contacts")
        same = all(_equal(getattr(clip, name), getattr(last, name)) for name in names)
        return self.whole if same else None


def _equal(one: np.ndarray | None, other: np.ndarray | None) -> bool:
    if one is None or other is None:
        return one is other
    return np.array_equal(one, other)


def nothing_assessed(_: RobotClip) -> LastAssessed:
    """What clips that are evaluated one after the other share, before the first."""
    return LastAssessed()


def pair(name: str) -> str:
    """The name that a motion and its mirror image have in common."""
    return name.replace(MARK, "")


def is_rollout(clip: RobotClip, numbers: Numbers) -> bool:
    """Whether a clip is what a simulated robot did, or tracked a reference."""
    return bool(clip.forces is not None or numbers.get(CLIP) or numbers.get(CONTENT))


def is_image(clip: RobotClip, numbers: Numbers, robot: Robot) -> bool:
    """Whether a clip is a mirror image that need not be evaluated by itself.

    Rollouts are: a policy is not symmetric, and their reference is not mirrored with them.
    """
    return bool(numbers.get("mirrored")) and not is_rollout(clip, numbers) and is_symmetric(robot)


def assess_clip(clip: RobotClip, robot: Robot, settings: FeasibilitySettings, last: LastAssessed) -> Assessment:
    """The assessment of a clip that is no rollout; that of the last one where the frames are the same."""
    clip = at_database_rate(clip)
    known = last.of(clip)
    if known is None:
        known = last.whole = assess(motion_of(clip, robot, settings), settings)
    return dataclasses.replace(known, motion=dataclasses.replace(known.motion, clip=clip))


def assess_image(image: RobotClip, robot: Robot, settings: FeasibilitySettings, last: LastAssessed) -> Assessment:
    """The assessment of a mirror image, which does not depend on whether the motion that it shows was assessed last."""
    shown = assess_clip(mirror_clip(image, robot, image.name), robot, settings, last)
    motion = shown.motion.mirrored(at_database_rate(image))
    own = {each.code: each for each in results(motion, settings, MOTION, OWN)}
    verdicts, skipped = parted([own.get(each.code, each) for each in (*shown.verdicts, *shown.skipped)])
    found = Assessment(motion=motion, verdicts=verdicts, skipped=skipped)
    return found if found.holds else assess(motion, settings)


def is_symmetric(robot: Robot) -> bool:
    """Whether the robot is its own mirror image within `TOLERANCE_M`, but for the limits of its joints."""
    if robot.mjcf not in _SYMMETRIC:
        _SYMMETRIC[robot.mjcf] = asymmetry(robot) <= TOLERANCE_M
    return _SYMMETRIC[robot.mjcf]


_SYMMETRIC: dict[str, bool] = {}
"""Model -> whether it is symmetric."""


def asymmetry(robot: Robot) -> float:
    """Largest difference between random poses and their mirror images: in places of links and of the soles' corners,
    and in the overlap of the robot's shapes [m]."""
    rng = np.random.default_rng(0)
    shape = (POSES, len(robot.joint_names))
    root_quat_w = rotation.normalize(rng.normal(size=(POSES, 4)))
    joint_pos = rng.uniform(robot.joint_lower, robot.joint_upper, shape)
    clip = robot.clip("random poses", FPS, np.zeros((POSES, 3)), root_quat_w, joint_pos)
    image = mirror_clip(clip, robot, clip.name)
    kinematics = Kinematics(robot)
    links, mirrored = (
        kinematics.forward(each.root_pos_w, each.root_quat_w, each.joint_pos).pos_w for each in (clip, image)
    )
    apart = [np.abs(mirrored - links[:, robot.link_mirror_index] * POSITION).max()]
    corners, mirrored = (sole_motion(each, robot).corner_pos_w for each in (clip, image))
    apart.append(np.abs(mirrored - mirror_corners(corners, robot)).max())
    depth, mirrored = (self_collision(each, robot).depth for each in (clip, image))
    return float(max(*apart, np.abs(mirrored - depth).max()))
