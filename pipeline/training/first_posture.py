"""The posture that exploration begins around: the clips' own as they walk, where it isn't the default pose.

A network that knows nothing answers with nearly no action, which is the default pose: the T1's stands with straighter
hips (-.2 for the -.5 rad of the shipped clips at 1.0 m/s) and leads to short steps.
"""

from __future__ import annotations

import numpy as np
import torch
from torch import nn

from pipeline.learning.training_error import TrainingError
from pipeline.training.action import SCALE
from pipeline.training.bundle import Bundle, ExpertFrames
from pipeline.training.expert_sampling import cell_weights
from pipeline.training.options import Options

MOVES = 0.1
"""Commands of more than this [m/s, rad/s] are walked."""


def walking_posture(expert: ExpertFrames, options: Options, seed: int) -> np.ndarray:
    """Mean of the controlled joints (a,) [rad] over all frames that walk, weighted as the commands are asked for.

    Raises TrainingError where no clip walks.
    """
    moves = (np.abs(expert.command) > MOVES).any(axis=1)
    if not moves.any():
        raise TrainingError("no clip of the expert database walks; 'init_posture' must be 'default'.")
    starts = np.flatnonzero(moves)
    weight = cell_weights(expert, starts, options.changed(standing_share=0.0), seed)
    return weight @ expert.frames[starts, 7 : 7 + expert.controlled]


def first_action(bundle: Bundle, options: Options, seed: int) -> np.ndarray:
    """The action (a,), in the policy's order of joints, that holds this posture."""
    robot = bundle.robot
    posture = dict(zip(robot.controlled, walking_posture(bundle.expert, options, seed), strict=True))
    default = robot.default_joint_pos[robot.index(robot.policy_joints)]
    wanted = [posture.get(name, rest) for name, rest in zip(robot.policy_joints, default, strict=True)]
    return (np.array(wanted) - default) / SCALE


def begin_at(actor: nn.Module, action: np.ndarray) -> None:
    """Let a new actor answer with this action (a,) on average: the bias of its last layer."""
    last = [layer for layer in actor.modules() if isinstance(layer, nn.Linear)][-1]
    with torch.no_grad():
        last.bias.copy_(torch.from_numpy(action).to(last.bias))
