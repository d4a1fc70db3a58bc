"""Generate a recipe's motion: ground truth as a HumanClip, and the same motion as BVH."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from pipeline import rotation
from pipeline.clips.human_clip import BODIES, HumanClip
from pipeline.generator import bvh, command, feet, footsteps, pelvis, skeleton
from pipeline.generator.command import GRID_HZ, LEAD_S, Recipe
from pipeline.generator.skeleton import Motion

SOURCE = "booster_lab"
"""Source name, the prefix of clip names."""
SIDES = ("Left", "Right")


@dataclass(frozen=True, kw_only=True)
class Generated:
    """A generated motion."""

    clip: HumanClip
    """The ground truth, with contacts."""
    bvh: str
    """The same as the text of a BVH file."""


def generate(recipe: Recipe) -> Generated:
    """The motion of a recipe: equal recipes give equal bytes. Raises ValueError for an infeasible recipe."""
    motion, contacts = make_motion(recipe)
    return Generated(clip=to_clip(recipe.name, motion, contacts), bvh=bvh.to_text(bvh.channels(motion), motion.fps))


def make_motion(recipe: Recipe) -> tuple[Motion, np.ndarray]:
    """Joint rotations and root of a recipe at its rate, and foot contacts (t, 2)."""
    commands = command.plan_commands(recipe)
    stride = footsteps.plan_steps(recipe, commands)
    both_feet = [feet.move_foot(recipe, commands, stances) for stances in stride.stances]
    root_pos_w, root_quat_w = pelvis.move_pelvis(recipe, commands, stride, both_feet)
    joints_w = {"Hips": root_quat_w, **pelvis.move_trunk(recipe, commands, stride)}
    for side, (name, foot) in enumerate(zip(SIDES, both_feet, strict=True)):
        hip_w = root_pos_w + rotation.rotate(root_quat_w, skeleton.offset(f"{name}UpLeg"))
        joints_w[f"{name}UpLeg"], joints_w[f"{name}Leg"] = skeleton.solve_leg(hip_w, foot.ankle_w, foot.yaw)
        joints_w[f"{name}Foot"] = skeleton.foot_orientation(foot.yaw, foot.pitch)
        joints_w[f"{name}Toe"] = skeleton.foot_orientation(foot.yaw, foot.pitch - foot.toe_bend)
        upper, fore = pelvis.move_arm(recipe, commands, stride, joints_w["Chest"], side)
        joints_w[f"{name}Shoulder"] = joints_w["Chest"]
        joints_w[f"{name}Arm"] = rotation.multiply(upper, hanging(side))
        joints_w[f"{name}ForeArm"] = joints_w[f"{name}Hand"] = rotation.multiply(fore, hanging(side))
    frames = (int(LEAD_S * GRID_HZ) + np.arange(recipe.frame_count) * GRID_HZ / recipe.fps).astype(int)
    motion = Motion(
        fps=recipe.fps,
        root_pos_w=root_pos_w[frames],
        quat_w={joint.name: joints_w[joint.name][frames] for joint in skeleton.JOINTS},
    )
    return motion, np.stack([foot.contact[frames] for foot in both_feet], axis=-1)


def hanging(side: int) -> Float[np.ndarray, " 4"]:
    """Rotation of an arm joint, straight out at rest, from a hanging arm's canonical frame."""
    return rotation.from_axis_angle(np.array([1.0, 0.0, 0.0]), -np.pi / 2 if side == 0 else np.pi / 2)


def to_clip(name: str, motion: Motion, contacts: np.ndarray | None) -> HumanClip:
    """A motion on the canonical skeleton, in which a hanging arm is upright."""
    positions = motion.positions_w()
    names = [skeleton.JOINT_OF_BODY[body] for body in BODIES]
    quat = {}
    for joint in names:
        arm = joint.endswith(("Arm", "Hand"))
        turn = rotation.conjugate(hanging(0 if joint.startswith("Left") else 1)) if arm else rotation.IDENTITY
        quat[joint] = rotation.make_continuous(rotation.multiply(motion.quat_w[joint], turn))
    return HumanClip(
        name=f"{SOURCE}/{name}",
        fps=motion.fps,
        body_pos_w=np.stack([positions[joint] for joint in names], axis=1),
        body_quat_w=np.stack([quat[joint] for joint in names], axis=1),
        contacts=contacts,
    )
