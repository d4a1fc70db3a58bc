"""People and robots that glide over the floor in one posture, at velocities that are known."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from pipeline import rotation
from pipeline.clips.human_clip import BODIES, HumanClip
from pipeline.clips.robot_clip import RobotClip
from tests.factories.human_clips import standing

FINE_HZ = 600.0
"""Rate of the integration; a multiple of the rates that tests ask for."""

Leg = tuple[float, float, float, float]
"""Seconds, forward [m/s], to the left [m/s], yaw rate [rad/s]."""


def path(legs: Sequence[Leg], fps: float) -> tuple[np.ndarray, np.ndarray]:
    """Place (t, 2) and yaw (t,) of a body that goes through the legs one after the other."""
    each = [np.tile(leg[1:], (round(leg[0] * FINE_HZ), 1)) for leg in legs]
    forward, left, rate = np.concatenate(each).T
    yaw = np.concatenate([[0.0], np.cumsum(rate)[:-1]]) / FINE_HZ
    velocity = np.stack([forward * np.cos(yaw) - left * np.sin(yaw), forward * np.sin(yaw) + left * np.cos(yaw)], 1)
    place = np.concatenate([np.zeros((1, 2)), np.cumsum(velocity, axis=0)[:-1]]) / FINE_HZ
    step = round(FINE_HZ / fps)
    return place[::step], yaw[::step]


def gliding_person(legs: Sequence[Leg], fps: float = 60.0, name: str = "test/glide") -> HumanClip:
    """A person standing upright who is carried along the legs."""
    place, yaw = path(legs, fps)
    posture = standing(seconds=0.1).body_pos_w[0]
    posture = posture - np.array([posture[0, 0], posture[0, 1], 0.0])
    turn = rotation.about_z(yaw)
    pos = rotation.rotate(turn[:, None], posture[None])
    pos[:, :, :2] += place[:, None]
    quat = np.repeat(turn[:, None], len(BODIES), axis=1)
    return HumanClip(name=name, fps=fps, body_pos_w=pos, body_quat_w=quat)


def gliding_robot(legs: Sequence[Leg]) -> RobotClip:
    """A robot whose root is carried along the legs."""
    place, yaw = path(legs, 50.0)
    height = np.full((len(place), 1), 0.6)
    return RobotClip(
        name="test/robot",
        fps=50.0,
        robot="t1",
        joint_names=("hip", "knee"),
        root_pos_w=np.concatenate([place, height], axis=1),
        root_quat_w=rotation.about_z(yaw),
        joint_pos=np.zeros((len(place), 2)),
    )
