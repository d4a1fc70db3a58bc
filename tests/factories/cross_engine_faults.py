"""Planted deployment faults that the comparison must detect."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable

import numpy as np
from jaxtyping import Float

from pipeline import rotation
from pipeline.deployment import Policy, Reading
from pipeline.simulation.plant import PlantState
from pipeline.simulation.sensors import PerfectSensors
from pipeline.simulation.torque_envelope import TorqueEnvelope
from pipeline.validation.deployed import Deployed

Fault = Callable[[Deployed], Deployed]


class GyroInWorldFrame(PerfectSensors):
    """Angular velocity in the world frame instead of the trunk frame."""

    def read(self, state: PlantState) -> Reading:
        reading = super().read(state)
        return dataclasses.replace(reading, gyro_b=rotation.rotate(state.root_quat_w, reading.gyro_b))


class GyroInDegrees(PerfectSensors):
    """Angular velocity in deg/s instead of rad/s."""

    def read(self, state: PlantState) -> Reading:
        reading = super().read(state)
        return dataclasses.replace(reading, gyro_b=np.degrees(reading.gyro_b))


def gyro_in_world_frame(clean: Deployed) -> Deployed:
    return dataclasses.replace(clean, reads=GyroInWorldFrame())


def gyro_in_degrees(clean: Deployed) -> Deployed:
    return dataclasses.replace(clean, reads=GyroInDegrees())


def left_and_right_swapped(clean: Deployed) -> Deployed:
    """Each joint is read and driven under the name of its mirror partner."""
    names = tuple(clean.robot.joint_names[index] for index in clean.robot.mirror_index)
    return dataclasses.replace(clean, task=dataclasses.replace(clean.task, joint_names=names))


def reversed_history(clean: Deployed) -> Deployed:
    """The network reads the newest frame first."""
    task, policy = clean.task, clean.policy
    order = np.arange(task.observation_size).reshape(task.history, task.frame_size)[::-1].ravel()
    (weight, bias), *others = policy.layers
    layers = ((weight[:, order], bias), *others)
    turned = dataclasses.replace(policy, mean=policy.mean[order], scale=policy.scale[order], layers=layers)
    return dataclasses.replace(clean, policy=turned)


def wrong_joint_order(clean: Deployed) -> Deployed:
    """The network's joints in hardware order."""
    joints = tuple(name for name in clean.task.joint_names if name in clean.task.policy_joints)
    return dataclasses.replace(clean, task=dataclasses.replace(clean.task, policy_joints=joints))


def action_scale_halved(clean: Deployed) -> Deployed:
    task = dataclasses.replace(clean.task, action_scale=0.5 * clean.task.action_scale)
    return dataclasses.replace(clean, task=task)


def torque_at_60_percent(clean: Deployed) -> Deployed:
    envelope: TorqueEnvelope = dataclasses.replace(clean.envelope, limit=0.6 * clean.envelope.limit)
    return dataclasses.replace(clean, envelope=envelope)


def half_kp(clean: Deployed) -> Deployed:
    return dataclasses.replace(clean, task=dataclasses.replace(clean.task, kp=0.5 * clean.task.kp))


def with_normalizer(policy: Policy, mean: Float[np.ndarray, " n"], scale: Float[np.ndarray, " n"]) -> Policy:
    """The same function with another normalizer, compensated in the first layer.

    The published policy has the identity, so leaving it out would be no fault.
    """
    (weight, bias), *others = policy.layers
    raw = weight / policy.scale
    layers = ((raw * scale, bias + raw @ (mean - policy.mean)), *others)
    return dataclasses.replace(policy, mean=mean, scale=scale, layers=layers)


def normalizer_left_out(clean: Deployed) -> Deployed:
    size = clean.policy.observation_size
    bare: Policy = dataclasses.replace(clean.policy, mean=np.zeros(size), scale=np.ones(size))
    return dataclasses.replace(clean, policy=bare)


FAULTS: dict[str, Fault] = {
    "gyro in the world frame": gyro_in_world_frame,
    "gyro in deg/s": gyro_in_degrees,
    "left and right swapped": left_and_right_swapped,
    "reversed history": reversed_history,
    "wrong joint order": wrong_joint_order,
    "action scale halved": action_scale_halved,
    "60 % torque": torque_at_60_percent,
    "half Kp": half_kp,
    "normalizer left out": normalizer_left_out,
}
"""Faults by name. A delay of 20 to 40 ms and 5 % noise on the weights are survived in every engine and not included."""
