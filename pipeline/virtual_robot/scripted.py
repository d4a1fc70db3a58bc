"""A controller that plays scripted joint targets, for logs without a policy."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from pipeline.deployment.task import DeploymentTask
from pipeline.files import digest


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
        self.last_action: Float[np.ndarray, " a"] = np.zeros(len(self.task.policy_joints))
        self._tick = 0

    def targets(
        self,
        gyro_b: Float[np.ndarray, " 3"],
        gravity_b: Float[np.ndarray, " 3"],
        command: Float[np.ndarray, " 3"],
        joint_pos: Float[np.ndarray, " j"],
        joint_vel: Float[np.ndarray, " j"],
    ) -> Float[np.ndarray, " j"]:
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
