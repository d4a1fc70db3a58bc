"""GMR for comparison: the same repaired human clips retargeted by GMR, in a separate Python environment.

GMR takes the joints of a LAFAN1 BVH file, global, z up. A repaired clip is in canonical frames; each body's constant
rotation from its joint's frame in the file (the skeleton map's rest frame) is taken back out.
"""

from __future__ import annotations

import os
import subprocess
import tempfile
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from pipeline import rotation
from pipeline.clips.human_clip import HumanClip, body
from pipeline.clips.robot_clip import RobotClip
from pipeline.readers.bvh import read_bvh
from pipeline.readers.match_skeleton import match_skeleton
from pipeline.robot import Robot

WORKER = Path(__file__).with_name("gmr_worker.py")

BODIES = {
    "Hips": "pelvis",
    "Spine2": "chest",
    "LeftUpLeg": "left_hip",
    "RightUpLeg": "right_hip",
    "LeftLeg": "left_knee",
    "RightLeg": "right_knee",
    "LeftArm": "left_shoulder",
    "RightArm": "right_shoulder",
    "LeftForeArm": "left_elbow",
    "RightForeArm": "right_elbow",
    "LeftHand": "left_wrist",
    "RightHand": "right_wrist",
}
"""GMR's names of the tracked bodies."""

FEET = {"LeftFootMod": ("left_ankle", "left_toe"), "RightFootMod": ("right_ankle", "right_toe")}
"""GMR's feet: position from the first body, orientation from the second."""


@dataclass(frozen=True, kw_only=True)
class Gmr:
    """Where GMR is installed."""

    python: Path
    """Python interpreter of its environment."""
    repo: Path
    """Its repository, checked out."""

    def retarget(
        self, human: HumanClip, file: Path, robot: Robot, repeat: int = 0
    ) -> tuple[RobotClip, tuple[float, ...]]:
        """Retarget a clip of the BVH `file` with GMR; return it, and the CPU time of `repeat` further runs [s]."""
        names, pos_w, quat_w = joints_of(human, file)
        with tempfile.TemporaryDirectory() as folder:
            source, out = Path(folder) / "human.npz", Path(folder) / "robot.npz"
            np.savez(source, names=names, pos=pos_w, quat=quat_w)
            command = [self.python, WORKER, self.repo, source, out, str(repeat)]
            one_core = {**os.environ, "OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}
            subprocess.run(command, check=True, env=one_core)
            with np.load(out) as result:
                qpos, joints, cpu_s = result["qpos"], result["joint_names"].tolist(), tuple(result["cpu_s"].tolist())
        return _clip(human, qpos, joints, robot), cpu_s


def joints_of(human: HumanClip, file: Path) -> tuple[list[str], np.ndarray, np.ndarray]:
    """GMR's body names (b,), positions (t, b, 3) [m] and orientations wxyz (t, b, 4) of the file's joints."""
    motion = read_bvh(file)
    skeleton, turned = match_skeleton(motion)
    sources = {**{name: (one, one) for name, one in BODIES.items()}, **FEET}
    pos_w = np.stack([human.body_pos_w[:, body(place)] for place, _ in sources.values()], axis=1)
    quats = []
    for _, orientation in sources.values():
        (rest,) = skeleton.rest_frames(turned, (orientation,))
        quats.append(rotation.multiply(human.body_quat_w[:, body(orientation)], rotation.conjugate(rest)))
    return list(sources), pos_w, np.stack(quats, axis=1)


def _clip(human: HumanClip, qpos: np.ndarray, joints: list[str], robot: Robot) -> RobotClip:
    """Build the robot clip; joints that GMR's model lacks (the head's) keep their default position."""
    joint_pos = np.tile(robot.default_joint_pos, (len(qpos), 1))
    for column, name in enumerate(joints):
        joint_pos[:, robot.joint(name)] = qpos[:, 7 + column]
    return RobotClip(
        name=human.name,
        fps=human.fps,
        robot=robot.name,
        joint_names=robot.joint_names,
        root_pos_w=qpos[:, :3],
        root_quat_w=rotation.make_continuous(rotation.normalize(qpos[:, 3:7])),
        joint_pos=joint_pos,
    )
