"""A controller that plays scripted joint targets, for logs without a policy."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from pipeline.deployment.controller import Reading
from pipeline.deployment.task import DeploymentTask
from pipeline.files import digest
from pipeline.physics import GRAVITY
from pipeline.robot import Robot
from pipeline.simulation.mujoco_plant import MujocoOptions, MujocoPlant
from pipeline.simulation.plant import PlantState


@dataclass(frozen=True, kw_only=True)
class Hold:
    """Time span and motion of the hold."""

    start_s: float
    stop_s: float
    lift: float = 0.06
    """Height of the lift [m]."""
    rise_s: float = 0.6
    """Duration of the lift [s]."""
    tilt_rad: float = 0.0
    """Forward tilt while held [rad]."""


class HeldPlant(MujocoPlant):
    """The robot in MuJoCo with a hand on its trunk: spring and damper towards the hand's pose."""

    def __init__(self, robot: Robot, options: MujocoOptions, hold: Hold):
        self._hold = hold
        super().__init__(robot, options)

    def reset(self, state: PlantState | None = None) -> None:
        super().reset(state)
        self._grip: np.ndarray | None = None

    def step(self, torque: Float[np.ndarray, " j"], force_w: Float[np.ndarray, " 3"] | None = None) -> None:
        hold, now = self._hold, self.data.time
        self.data.xfrc_applied[1, 3:] = 0.0
        if hold.start_s <= now < hold.stop_s:
            hand, moment = self._hand(hold, now)
            force_w = hand if force_w is None else force_w + hand
            self.data.xfrc_applied[1, 3:] = moment
        super().step(torque, force_w)

    def _hand(self, hold: Hold, now: float) -> tuple[np.ndarray, np.ndarray]:
        """Force [N] and moment [N m] of the hand."""
        mass = float(self.model.body_subtreemass[1])
        if self._grip is None:
            self._grip = self.data.xipos[1].copy()
        part = min((now - hold.start_s) / hold.rise_s, 1.0)
        target = self._grip + np.array([0.0, 0.0, hold.lift * part])
        stiffness, damping = 60.0 * mass, 12.0 * mass
        force = stiffness * (target - self.data.xipos[1]) - damping * self.data.qvel[:3]
        force[2] += part * mass * GRAVITY
        up = self.data.xmat[1].reshape(3, 3)[:, 2]
        forward = self.data.xmat[1].reshape(3, 3)[:, 0] * np.array([1.0, 1.0, 0.0])
        forward /= max(float(np.linalg.norm(forward)), 1e-6)
        target_up = np.array([0.0, 0.0, np.cos(hold.tilt_rad * part)]) + np.sin(hold.tilt_rad * part) * forward
        moment = 120.0 * np.cross(up, target_up) - 12.0 * self.data.cvel[1, :3]
        return force, moment


@dataclass(frozen=True, kw_only=True)
class Script:
    """Offsets [rad] from the default pose at times [s], linearly interpolated; other joints stay."""

    name: str
    offsets: Mapping[str, tuple[tuple[float, float], ...]]
    """Joint -> (time, offset), times increasing."""

    @property
    def digest(self) -> str:
        """Digest that replaces a policy's digest in a log."""
        return digest.of_json([self.name, {joint: list(map(list, rows)) for joint, rows in self.offsets.items()}])


class ScriptedController:
    """Plays a script, ignoring the robot's state."""

    def __init__(self, task: DeploymentTask, script: Script):
        self.task, self.script = task, script
        self.reset()

    def reset(self) -> None:
        self._tick = 0

    def targets(self, reading: Reading, command: Float[np.ndarray, " 3"]) -> Float[np.ndarray, " j"]:
        """Targets of this control step [rad]."""
        time_s = self._tick / self.task.control_hz
        self._tick += 1
        targets = self.task.default_joint_pos.copy()
        for joint, rows in self.script.offsets.items():
            times, values = np.array(rows).T
            targets[self.task.joint_names.index(joint)] += np.interp(time_s, times, values)
        return targets


STEPS_IN_PLACE_S = 1.0
"""Period of `SWAY` [s]."""

SWAY = Script(
    name="sway",
    offsets={
        joint: tuple(
            (0.5 * STEPS_IN_PLACE_S * beat, sign * (0.0 if beat in (0, 16) else 0.03 * (-1) ** beat))
            for beat in range(17)
        )
        for joint, sign in {
            "Left_Hip_Roll": 1.0,
            "Right_Hip_Roll": 1.0,
            "Left_Ankle_Roll": -1.0,
            "Right_Ankle_Roll": -1.0,
        }.items()
    },
)
"""The T1 standing and shifting its weight between its feet."""

TOPPLE_LEFT = Script(
    name="topple left",
    offsets={
        "Left_Hip_Roll": ((3.0, 0.0), (3.6, 0.05)),
        "Right_Hip_Roll": ((3.0, 0.0), (3.6, 0.35)),
        "Left_Knee_Pitch": ((3.0, 0.0), (3.4, 0.9)),
        "Left_Hip_Pitch": ((3.0, 0.0), (3.4, -0.45)),
        "Left_Ankle_Pitch": ((3.0, 0.0), (3.4, -0.45)),
    },
)
"""The left leg gives way and the robot falls over it, as if unable to step to the left."""
