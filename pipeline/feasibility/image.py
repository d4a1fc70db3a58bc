"""Assess a mirrored motion by its original, if the robot is symmetric.

The numbers of the criteria are then equal for both, within the tolerance of the robot's symmetry. Only the criteria in
`OWN` are evaluated on the mirror image itself, and all criteria if one fails, because its message names a side.
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
"""Criteria that are evaluated on the image itself: joint limits, which may differ between left and right, and slip,
whose last digits depend on the order of the corners."""

TOLERANCE_M = 1e-5
"""Largest difference of links, soles and shape overlaps between mirrored poses of a symmetric robot [m]. MuJoCo's
overlaps are accurate to about 1e-6 m."""

POSES = 32
"""Number of random poses for the symmetry test."""


@dataclass
class LastAssessed:
    """Cache of the last assessment in a process; the mirror image of a motion often follows it."""

    whole: Assessment | None = None

    def of(self, clip: RobotClip) -> Assessment | None:
        """The cached assessment if it is of a clip with these frames, else None."""
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
    """An empty cache, for the first clip of a process."""
    return LastAssessed()


def pair(name: str) -> str:
    """The common name of a motion and its mirror image."""
    return name.replace(MARK, "")


def is_rollout(clip: RobotClip, numbers: Numbers) -> bool:
    """Whether a clip is a simulated rollout or tracked a reference."""
    return bool(clip.forces is not None or numbers.get(CLIP) or numbers.get(CONTENT))


def is_image(clip: RobotClip, numbers: Numbers, robot: Robot) -> bool:
    """Whether a clip is a mirror image that can be assessed by its original.

    Rollouts cannot: a policy is not symmetric, and their reference is not mirrored with them.
    """
    return bool(numbers.get("mirrored")) and not is_rollout(clip, numbers) and is_symmetric(robot)


def assess_clip(clip: RobotClip, robot: Robot, settings: FeasibilitySettings, last: LastAssessed) -> Assessment:
    """Assess a clip that is not a rollout, or return the cached assessment for equal frames."""
    clip = at_database_rate(clip)
    known = last.of(clip)
    if known is None:
        known = last.whole = assess(motion_of(clip, robot, settings), settings)
    return dataclasses.replace(known, motion=dataclasses.replace(known.motion, clip=clip))


def assess_image(image: RobotClip, robot: Robot, settings: FeasibilitySettings, last: LastAssessed) -> Assessment:
    """Assess a mirror image; the result does not depend on the cache."""
    shown = assess_clip(mirror_clip(image, robot, image.name), robot, settings, last)
    motion = shown.motion.mirrored(at_database_rate(image))
    own = {each.code: each for each in results(motion, settings, MOTION, OWN)}
    verdicts, skipped = parted([own.get(each.code, each) for each in (*shown.verdicts, *shown.skipped)])
    found = Assessment(motion=motion, verdicts=verdicts, skipped=skipped)
    return found if found.holds else assess(motion, settings)


def is_symmetric(robot: Robot) -> bool:
    """Whether the robot is mirror-symmetric within `TOLERANCE_M`, apart from joint limits."""
    if robot.mjcf not in _SYMMETRIC:
        _SYMMETRIC[robot.mjcf] = asymmetry(robot) <= TOLERANCE_M
    return _SYMMETRIC[robot.mjcf]


_SYMMETRIC: dict[str, bool] = {}
"""Digest of a model -> whether it is symmetric."""


def asymmetry(robot: Robot) -> float:
    """Largest difference between random poses and their mirror images [m]: in positions of links and sole corners, and
    in the overlap of the robot's shapes."""
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
