"""A teacher in another posture: it sees its joints where they would be without a shift, and moves them with it.

A policy may have the clips' stride in a posture of its own, with toes in and legs close together where the clips have
toes out and legs apart. Turned by a tenth of a rad its legs still walk: who is shifted takes joints for straight that
are turned. The network that it teaches learns the posture with the stride.
"""

from __future__ import annotations

import math
from collections.abc import Mapping

import torch

from pipeline.learning.robot_facts import RobotFacts
from pipeline.learning.training_error import TrainingError
from pipeline.training.action import SCALE
from pipeline.training.observations import COMMAND, HISTORY, newest_command

MOST_RAD = 0.3
"""Most that a joint is shifted by [rad]: beyond it the policy's walk is another one."""
SHAPE = "it must look like Left_Hip_Yaw:.09,Left_Hip_Roll:.08 (joint:rad)"


class PostureShift:
    """By how much joints of one side, and of the other side as their mirror images, are shifted."""

    def __init__(
        self, text: str, robot: RobotFacts, device: str, fades_m_s: tuple[float, float] = (math.inf, math.inf)
    ):
        """From `joint:rad,joint:rad,…`; told to walk ahead at the first of `fades_m_s` it begins to shrink, and is
        gone at the second. Raises TrainingError for what is no shift, and for joints that the policy does not move or
        that have no mirror image of their own."""
        shift = torch.zeros(len(robot.policy_joints))
        for name, angle in _angles(text).items():
            if name not in robot.policy_joints:
                moved = ", ".join(robot.policy_joints)
                raise TrainingError(f"--shift names '{name}', which the policy does not move; it moves {moved}.")
            joint = robot.joint_names.index(name)
            partner = robot.joint_names[int(robot.mirror_index[joint])]
            if partner == name:
                raise TrainingError(f"--shift names '{name}', which is its own mirror image; name joints of one side.")
            if shift[robot.policy_joints.index(name)] != 0.0:
                raise TrainingError(f"--shift names '{name}' and '{partner}', its mirror image; name one of them.")
            shift[robot.policy_joints.index(name)] = angle
            shift[robot.policy_joints.index(partner)] = angle * float(robot.mirror_sign[joint])
        self._shift, self._fades = shift.to(device), fades_m_s

    def of(self, observation: torch.Tensor) -> torch.Tensor:
        """The shift (n, a) [rad] of those who see (n, o), by what they are told."""
        first, last = self._fades
        speed = newest_command(observation)[:, :1]
        share = torch.ones_like(speed) if math.isinf(first) else ((last - speed) / (last - first)).clamp(0.0, 1.0)
        return share * self._shift

    def seen_as(self, observation: torch.Tensor, shift: torch.Tensor) -> torch.Tensor:
        """What an actor sees (n, o) without a shift (n, a) of joints and of what they were told, in all frames; those
        from before an episode stay 0."""
        frames = observation.unflatten(1, (HISTORY, -1)).clone()
        first, count = COMMAND.stop, shift.shape[1]
        less = shift[:, None] * (frames != 0.0).any(dim=2, keepdim=True)
        frames[:, :, first : first + count] -= less
        frames[:, :, first + 2 * count :] -= less / SCALE
        return frames.flatten(1)


def told_with(action: torch.Tensor, shift: torch.Tensor) -> torch.Tensor:
    """What a teacher does (n, a) with a shift (n, a) [rad]."""
    return action + shift / SCALE


def fades_of(text: str) -> tuple[float, float]:
    """From `first:last` [m/s]; raises TrainingError where the second is not over the first."""
    try:
        first, last = (float(part) for part in text.split(":"))
    except ValueError as error:
        raise TrainingError(f"--shift-fades is '{text}'; it must look like 1.1:1.5 (from:to, m/s).") from error
    if not 0.0 <= first < last < math.inf:
        raise TrainingError(f"--shift-fades is '{text}'; it must be two speeds, 0 or more, the second the higher.")
    return first, last


def _angles(text: str) -> Mapping[str, float]:
    found: dict[str, float] = {}
    for part in text.split(","):
        name, _, angle = (each.strip() for each in part.partition(":"))
        try:
            value = float(angle)
        except ValueError as error:
            raise TrainingError(f"--shift is '{text}'; {SHAPE}.") from error
        if not name:
            raise TrainingError(f"--shift is '{text}'; {SHAPE}.")
        if name in found:
            raise TrainingError(f"--shift names '{name}' twice; name it once.")
        if not abs(value) <= MOST_RAD:
            raise TrainingError(f"--shift of {name} is {angle} rad; it must be from -{MOST_RAD} to {MOST_RAD}.")
        found[name] = value
    return found
