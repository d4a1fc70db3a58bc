"""Arrays of a tracker file from a checkpoint: network, robot, joints, links, gains and action scale."""

from typing import Any

import numpy as np

from pipeline.learning.policy_file import policy_arrays
from pipeline.learning.robot_facts import RobotFacts
from pipeline.tracking.task import ACTION_SCALE, OBSERVATION


def tracker_arrays(state: dict[str, Any], robot: RobotFacts) -> dict[str, np.ndarray]:
    """Arrays for rollouts from a checkpoint. Raises TrainingError if the network has another structure."""
    return policy_arrays(state, robot) | {
        "robot": np.array(robot.name),
        "controlled": np.array(robot.controlled),
        "key_links": np.array(robot.key_links),
        "action_scale": np.array(ACTION_SCALE),
        "observation": np.array(OBSERVATION),
    }
