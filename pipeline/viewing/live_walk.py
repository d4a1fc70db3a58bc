"""Interactive walk of a policy in MuJoCo: command, pushes, terrain and friction can change at any time."""

import numpy as np

from pipeline import rotation
from pipeline.clips.robot_clip import RobotClip
from pipeline.simulation.mujoco_plant import MujocoPlant
from pipeline.simulation.plant import PlantState
from pipeline.simulation.run import fall_height, has_fallen, steps_of
from pipeline.simulation.terrain import FlatGround, Ground
from pipeline.simulation.torque_envelope import PdControl
from pipeline.validation.deployed import Deployed
from pipeline.validation.trial import SLEW, Conditions, GroundSpec
from pipeline.validation.walk import Worlds

TERRAINS: dict[str, GroundSpec | None] = {
    "flat": None,
    "slope up 6°": GroundSpec(kind="slope", size=6.0),
    "slope down 6°": GroundSpec(kind="slope", size=-6.0),
    "slope across 6°": GroundSpec(kind="cross_slope", size=6.0),
    "bump 4 cm": GroundSpec(kind="bump", size=0.04),
    "gravel 2 cm": GroundSpec(kind="gravel", size=0.02),
    "stepping stones 2 cm": GroundSpec(kind="stones", size=0.02),
    "hills 3 cm": GroundSpec(kind="rough", size=0.03),
}
"""Terrains to choose from."""

PUSH_S = 0.1
"""Duration of a push [s]."""


class LiveWalk:
    """A walk that is simulated one control step at a time.

    After a fall the robot stays on the ground until `restart`. It is deterministic: equal calls give equal states.
    """

    def __init__(self, one: Deployed, terrain: str = "flat", friction: float = 1.0) -> None:
        self.one = one
        self._worlds = Worlds(one)
        self.goal = np.zeros(3)
        """Commanded forward and lateral velocity [m/s] and yaw rate [rad/s]."""
        self.place(terrain, friction)

    @property
    def control_s(self) -> float:
        """Duration of a control step [s]."""
        return 1.0 / self.one.task.control_hz

    @property
    def state(self) -> PlantState:
        return self._plant.state()

    @property
    def ground(self) -> Ground:
        return self._plant.ground

    def place(self, terrain: str, friction: float) -> None:
        """Restart on a terrain of `TERRAINS` with a coefficient of sliding friction."""
        self._plant: MujocoPlant = self._worlds.plant(Conditions(friction=friction, ground=TERRAINS[terrain]))
        self.restart()

    def restart(self) -> None:
        """Reset to the default pose at rest at the start; the commanded goal is kept."""
        one = self.one
        self._plant.reset()
        self._controller = one.controller()
        self._controller.reset()
        self._motors: PdControl = one.motors()
        self.command = np.zeros(3)
        """Rate-limited command of the policy, which approaches the goal."""
        self.time_s = 0.0
        self.fallen = False
        self._force_w, self._push_left_s = np.zeros(3), 0.0
        self._rows: list[tuple[np.ndarray, np.ndarray, np.ndarray]] = []

    def push(self, impulse: float, direction: float) -> None:
        """Push the trunk for `PUSH_S`.

        Args:
            impulse: impulse of the push [N s]
            direction: direction relative to the robot's heading, about the vertical [rad]: 0 forward, pi / 2 left
        """
        angle = float(rotation.yaw_of(self.state.root_quat_w[None])[0]) + direction
        self._force_w = impulse / PUSH_S * np.array([np.cos(angle), np.sin(angle), 0.0])
        self._push_left_s = PUSH_S

    def step(self) -> None:
        """Simulate one control step (0.02 s for the shipped policies)."""
        one, plant = self.one, self._plant
        most = SLEW * self.control_s
        self.command = self.command + np.clip(self.goal - self.command, -most, most)
        state = plant.state()
        target = self._controller.targets(one.reads.read(state), self.command)
        for _ in range(steps_of(one.task.control_hz, plant.timestep_s)):
            state = plant.state()
            pushed = self._push_left_s > 1e-9
            torque = self._motors.torque(target, state.joint_pos, state.joint_vel)
            plant.step(torque, self._force_w if pushed else None)
            self._push_left_s -= plant.timestep_s
        self.time_s += self.control_s
        state = plant.state()
        flat = isinstance(plant.ground, FlatGround)
        lowest = fall_height(one.robot)
        self.fallen = self.fallen or has_fallen(state, lowest, None if flat else plant.ground.height)
        self._rows.append((state.root_pos_w, state.root_quat_w, state.joint_pos))

    def record(self) -> RobotClip:
        """The motion since the last start, one frame per control step."""
        poses = (np.array(rows) for rows in zip(*self._rows, strict=True))
        return self.one.robot.clip("walk", self.one.task.control_hz, *poses)


def surface(
    ground: Ground, along: tuple[float, float], across: tuple[float, float], step: float
) -> tuple[np.ndarray, np.ndarray]:
    """A ground's surface as vertices (v, 3) [m], `step` [m] apart, and triangles (f, 3) over ranges of x and y [m]."""
    xs, ys = np.arange(along[0], along[1] + step / 2, step), np.arange(across[0], across[1] + step / 2, step)
    vertices = np.array([[x, y, ground.height(float(x), float(y))] for x in xs for y in ys])
    row, column = np.meshgrid(np.arange(len(xs) - 1), np.arange(len(ys) - 1), indexing="ij")
    corner = (row * len(ys) + column).ravel()
    lower = np.stack([corner, corner + len(ys), corner + len(ys) + 1], axis=1)
    upper = np.stack([corner, corner + len(ys) + 1, corner + 1], axis=1)
    return vertices, np.concatenate([lower, upper])
