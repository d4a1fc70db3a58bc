"""Interface of a physics engine for rollouts: set and read the state, step with joint torques, push, foot forces."""

from abc import ABC, abstractmethod
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from pipeline import rotation
from pipeline.errors import PipelineError
from pipeline.robot import Robot
from pipeline.simulation.terrain import FlatGround, Ground, tilt_at_start

FLAT = FlatGround()


@dataclass(frozen=True, kw_only=True)
class Push:
    """A constant force at the centre of mass of the root link for a while."""

    start_s: float
    duration_s: float
    force_w: Float[np.ndarray, " 3"]
    """[N]"""


@dataclass(frozen=True, kw_only=True)
class Kick:
    """A sudden change of the whole robot's velocity."""

    start_s: float
    delta_v_w: Float[np.ndarray, " 3"]
    """[m/s]"""


@dataclass(frozen=True, kw_only=True)
class Throw:
    """A ball thrown at the root link, for plants with a ball."""

    start_s: float
    direction_w: Float[np.ndarray, " 3"]
    """Horizontal, unit."""
    speed: float
    """[m/s]"""
    duration_s: float
    """After this time the ball is removed [s]."""


Event = Push | Kick | Throw


class NoBallError(PipelineError):
    """Raised for a throw in a plant without a ball."""

    def __init__(self, plant: object):
        super().__init__(f"{type(plant).__name__} has no ball to throw; push with a force or a kick there.")


@dataclass(frozen=True, kw_only=True)
class PlantState:
    """Pose and velocity of a robot with J joints, in the robot's order."""

    root_pos_w: Float[np.ndarray, " 3"]
    """Origin of the root link [m]."""
    root_quat_w: Float[np.ndarray, " 4"]
    root_lin_vel_w: Float[np.ndarray, " 3"]
    """Velocity of the root link's origin [m/s]."""
    root_ang_vel_b: Float[np.ndarray, " 3"]
    """In the root link's frame [rad/s]."""
    joint_pos: Float[np.ndarray, " j"]
    joint_vel: Float[np.ndarray, " j"]


def standing_state(robot: Robot, ground: Ground = FLAT) -> PlantState:
    """State at rest in the default pose, with the soles on the ground's plane at the origin."""
    tilt = np.array([*tilt_at_start(ground), 0.0])
    height = robot.default_root_height / float(np.cos(np.linalg.norm(tilt)))  # above the origin of a tilted plane
    return PlantState(
        root_pos_w=np.array([0.0, 0.0, height + ground.height(0.0, 0.0)]),
        root_quat_w=rotation.from_rotvec(tilt),
        root_lin_vel_w=np.zeros(3),
        root_ang_vel_b=np.zeros(3),
        joint_pos=np.array(robot.default_joint_pos),
        joint_vel=np.zeros(len(robot.joint_names)),
    )


class Plant(ABC):
    """A robot on a ground in a physics engine. Deterministic: equal calls give bit-identical results."""

    timestep_s: float

    @abstractmethod
    def reset(self, state: PlantState | None = None) -> None:
        """Restart from a state; by default the default pose at rest on the ground."""

    @abstractmethod
    def state(self) -> PlantState:
        """A copy of the current state."""

    @abstractmethod
    def step(self, torque: Float[np.ndarray, " j"], force_w: Float[np.ndarray, " 3"] | None = None) -> None:
        """One timestep with joint torques [N m] and a force [N] at the centre of mass of the root link."""

    @abstractmethod
    def foot_wrench_w(self) -> Float[np.ndarray, "2 6"]:
        """Force [N] and moment about the foot link's origin [N m] of the ground on the left and right foot, world
        frame, that acted at the start of the last step."""

    @abstractmethod
    def kick(self, delta_v_w: Float[np.ndarray, " 3"]) -> None:
        """Change the velocity of the whole robot instantaneously [m/s]; joint velocities are unchanged."""

    def acceleration(self) -> Float[np.ndarray, " v"] | None:
        """Acceleration of root (world), root angular (root frame) and joints at the start of the last step, or None."""
        return None

    def throw(self, direction_w: Float[np.ndarray, " 3"], speed: float) -> None:
        """Throw a ball at the root link along a horizontal unit direction at a speed [m/s]. Raises NoBallError."""
        raise NoBallError(self)

    def remove_ball(self) -> None:
        """Remove the ball. Raises NoBallError."""
        raise NoBallError(self)
