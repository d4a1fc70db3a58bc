"""How much of the time both feet are on the ground, in the expert's clips by the command that they obey.

On one foot a robot falls to a side as a pendulum does: off balance by little, it is so by up to e^(4.1 t) times as much
t seconds later, with its mass .59 m up. Steps of the clips' time on one foot throughout are .5 s of that; in the clips
both feet are down for half of it, in the walk of the published policy for .4.
"""

from __future__ import annotations

import itertools

import mujoco
import numpy as np
import torch

from pipeline.learning.robot_facts import RobotFacts
from pipeline.learning.training_error import TrainingError
from pipeline.training.bundle import ExpertFrames
from pipeline.training.command_cells import frame_cells
from pipeline.training.step_times import GROUND_PERCENTILE

NEAR_M = 0.01
"""A foot whose lowest corner is less than this above where it usually is on the ground is down [m]."""
CORNERS = np.array(list(itertools.product((-1.0, 1.0), repeat=3)))


def feet_down(expert: ExpertFrames, robot: RobotFacts) -> np.ndarray:
    """Whether the left and the right foot are on the ground (t, 2). Raises TrainingError for a foot that is no box."""
    model = mujoco.MjModel.from_xml_string(robot.mjcf)
    data = mujoco.MjData(model)
    joints = [model.joint(name).qposadr[0] for name in robot.controlled]
    boxes = [_box(model, robot, foot) for foot in robot.feet]
    corners = [CORNERS * model.geom_size[box] for box in boxes]
    lowest = np.zeros((len(expert.frames), len(boxes)))
    for at, frame in enumerate(expert.frames):
        data.qpos[:7], data.qpos[joints] = frame[:7], frame[7 : 7 + len(joints)]
        mujoco.mj_kinematics(model, data)
        for foot, (box, corner) in enumerate(zip(boxes, corners, strict=True)):
            lowest[at, foot] = data.geom_xpos[box, 2] + (corner @ data.geom_xmat[box].reshape(3, 3)[2]).min()
    down = np.zeros(lowest.shape, dtype=bool)
    for first, last in itertools.pairwise(expert.clip_start):
        inside = lowest[first:last]
        down[first:last] = inside < np.percentile(inside, GROUND_PERCENTILE, axis=0) + NEAR_M
    return down


def _box(model: mujoco.MjModel, robot: RobotFacts, foot: str) -> int:
    """The shape of the foot that has this site."""
    body = model.site(foot).bodyid[0]
    shapes = [model.geom(name).id for name in robot.shapes["feet"] if model.geom(name).bodyid[0] == body]
    if len(shapes) != 1 or model.geom_type[shapes[0]] != mujoco.mjtGeom.mjGEOM_BOX:
        raise TrainingError(
            f"the foot of '{foot}' is no box, or has {len(shapes)} shapes; where it touches the ground is known of one "
            "box alone. Train without `double_stance`."
        )
    return shapes[0]


class DoubleStance:
    """The share of the clips' time with both feet on the ground for any command: that of the nearest cell."""

    def __init__(self, expert: ExpertFrames, robot: RobotFacts, device: str):
        both: np.ndarray = feet_down(expert, robot).min(axis=1)
        self._cells = frame_cells(expert.command, device)
        share = [both[member].mean() for member in self._cells.members]
        self._share = torch.tensor(np.array(share), dtype=torch.float32, device=device)

    def __call__(self, command: torch.Tensor) -> torch.Tensor:
        """Shares (n,) for commands (n, 3)."""
        return self._share[self._cells.nearest(command)]
