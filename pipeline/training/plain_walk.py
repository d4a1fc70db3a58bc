"""Walk a policy in plain MuJoCo from the files of a training bundle, on hosts with only mjlab and jaxtyping.

2 ms time step, explicit PD control clipped by the torque-speed curve, no noise, commands rate-limited to 1 m/s^2 and
1 rad/s^2. A test compares it with the walk of `pipeline/validation`, which has more conditions.
"""

import functools
import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import mujoco
import numpy as np

from pipeline.deployment.policy import GAINS, PolicyGains, load_policy
from pipeline.deployment.task import ACTION_SCALE, HISTORY, in_order
from pipeline.errors import FileError

STEP_S, CONTROL_EVERY = 0.002, 10
MEASURE_S = 6.0
"""Duration of the measurement at the end of a walk [s]."""
MAX_TILT_COS = 0.5
MIN_SWING_S = 0.04
"""Least duration of a swing that ends with a touchdown [s]."""
START_NOISE = 0.02
"""Largest initial joint offset for seeds other than 0 [rad]."""


@dataclass(frozen=True, kw_only=True)
class Walk:
    """Command, duration and seed of a walk."""

    command: tuple[float, float, float]
    seconds: float = 10.0
    seed: int = 0


@functools.lru_cache(maxsize=1)
def robot_parameters(bundle: Path) -> dict[str, Any]:
    """Read `robot.json`, with lists as arrays."""
    facts = json.loads((bundle / "robot.json").read_text())
    numbers = ("default_joint_pos", "kp", "kd", "effort_limit")
    facts |= {name: np.array(facts[name], dtype=float) for name in numbers}
    stall, no_load = (np.array(facts[name], dtype=float) for name in ("saturation_effort", "no_load_speed"))
    has_curve = np.isfinite(no_load)
    facts["stall"] = np.where(has_curve, stall, 1e3 * facts["effort_limit"])
    facts["no_load"] = np.where(has_curve, no_load, 1e6)
    facts["policy_index"] = np.array([facts["joint_names"].index(name) for name in facts["policy_joints"]])
    return facts


@functools.lru_cache(maxsize=8)
def ground_model(bundle: Path) -> mujoco.MjModel:
    """Compile the robot on a plane."""
    spec = mujoco.MjSpec.from_string((bundle / "robot.xml").read_text())
    spec.option.timestep = STEP_S
    spec.worldbody.add_geom(name="ground", type=mujoco.mjtGeom.mjGEOM_PLANE, size=[0.0, 0.0, 0.05])
    return spec.compile()


class World:
    """State of one walk: MuJoCo data, observation history, joint targets."""

    def __init__(self, bundle: Path, policy: Path, walk: Walk):
        """Raises FileError for a policy that can't be read or belongs to another robot than the bundle."""
        self.facts, self.policy, self.walk = robot_parameters(bundle), load_policy(policy), walk
        names, index = self.facts["joint_names"], self.facts["policy_index"]
        self._history = np.zeros((HISTORY, 9 + 3 * len(index)), dtype=np.float32)
        default = {name: self.facts[name] for name in GAINS}
        gains = self.policy.gains or PolicyGains(joint_names=tuple(names), **default)
        sizes, required = (self.policy.observation_size, self.policy.action_size), (self._history.size, len(index))
        if sizes != required or set(gains.joint_names) != set(names):
            needs = f"{required[0]} observations, {required[1]} actions and the robot's joint names"
            problem = f"it is not a walking policy of '{self.facts['robot']}', which needs {needs}."
            raise FileError(policy, problem, f"Use the bundle of the policy's robot instead of {bundle}.")
        self.kp, self.kd, self.rest = (in_order(getattr(gains, name), gains.joint_names, names) for name in GAINS)
        self.model = ground_model(bundle)
        self.data = mujoco.MjData(self.model)
        noise = np.random.default_rng(walk.seed).uniform(-1.0, 1.0, len(self.rest)) * (START_NOISE if walk.seed else 0)
        self.data.qpos[:7] = [0.0, 0.0, self.facts["default_root_height"], 1.0, 0.0, 0.0, 0.0]
        self.data.qpos[7:] = self.rest + noise
        mujoco.mj_forward(self.model, self.data)
        self.root = self.model.body(self.facts["root_link"]).id
        self.foot_bodies = [int(self.model.site(name).bodyid[0]) for name in self.facts["feet"]]
        self._action, self.target = np.zeros(len(index)), self.rest.copy()

    def update_targets(self) -> None:
        """Evaluate the policy and set new joint targets."""
        data, index = self.data, self.facts["policy_index"]
        command = np.clip(self.walk.command, -data.time, data.time)
        rotation = data.xmat[self.root].reshape(3, 3)
        joints = data.qpos[7:][index] - self.rest[index]
        frame = np.concatenate([data.qvel[3:6], -rotation[2], command, joints, data.qvel[6:][index], self._action])
        self._history = np.vstack([self._history[1:], frame.astype(np.float32)])
        self._action = self.policy.act(self._history.ravel())
        self.target = self.rest.copy()
        self.target[index] += ACTION_SCALE * self._action

    def torque_limits(self) -> tuple[np.ndarray, np.ndarray]:
        """Minimum and maximum torque of each motor at its current speed (j,) [N m]."""
        limit, fall = self.facts["effort_limit"], self.data.qvel[6:] / self.facts["no_load"]
        low, high = (np.clip(self.facts["stall"] * (sign - fall), -limit, limit) for sign in (-1.0, 1.0))
        return low, high

    def step(self) -> np.ndarray:
        """Advance by one physics step; return the torques (j,) [N m]."""
        data = self.data
        low, high = self.torque_limits()
        torque = np.clip(self.kp * (self.target - data.qpos[7:]) - self.kd * data.qvel[6:], low, high)
        data.qfrc_applied[6:] = torque
        mujoco.mj_step(self.model, data)
        return torque

    @property
    def fell(self) -> bool:
        """Whether the trunk is too low or too tilted, or joint targets are not finite (MuJoCo would reset)."""
        upright = self.data.qpos[2] >= self.facts["fall_height"] and self.data.xmat[self.root][8] >= MAX_TILT_COS
        return not (upright and np.isfinite(self.target).all())

    def foot_contacts(self) -> list[bool]:
        """Ground contact of the left and right foot."""
        pairs = {
            (int(self.model.geom_bodyid[a]), int(self.model.geom_bodyid[b]))
            for a, b in self.data.contact.geom[: self.data.ncon]
        }
        return [(0, foot) in pairs or (foot, 0) in pairs for foot in self.foot_bodies]


def measure_walk(bundle: Path, policy: Path, walk: Walk) -> dict[str, float]:
    """Simulate a walk; return its metrics over the last MEASURE_S, or only `fell` and `fell_s` [s] after a fall."""
    world, power, rows = World(bundle, policy, walk), [], []
    steps = round(walk.seconds / STEP_S)
    for step in range(steps):
        if step % CONTROL_EVERY == 0:
            world.update_targets()
        torque, data = world.step(), world.data
        if world.fell:
            return {"fell": 1.0, "fell_s": data.time}
        if step >= steps - round(MEASURE_S / STEP_S):
            power.append(float(np.abs(torque * data.qvel[6:]).sum()))
            if step % CONTROL_EVERY == CONTROL_EVERY - 1:
                heading = np.arctan2(data.xmat[world.root][3], data.xmat[world.root][0])
                rows.append([heading, *data.qvel[:2], *world.foot_contacts()])
    return {"fell": 0.0, "power": float(np.mean(power)), **_figures(np.array(rows, dtype=float))}


def _figures(table: np.ndarray) -> dict[str, float]:
    """Mean velocities in the yaw frame [m/s, rad/s], and touchdowns per minute.

    Args:
        table: (t, 5), one row per control step: heading [rad], world velocity x and y [m/s], contact of the left and
            right foot
    """
    heading, vx, vy = table[:, :3].T
    contact, cos, sin = table[:, 3:] > 0.0, np.cos(heading), np.sin(heading)
    control_s, turned = STEP_S * CONTROL_EVERY, np.unwrap(heading)
    return {
        "forward": float((vx * cos + vy * sin).mean()),
        "lateral": float((vy * cos - vx * sin).mean()),
        "yaw_rate": float((turned[-1] - turned[0]) / ((len(table) - 1) * control_s)),
        "touchdowns_per_min": sum(touchdown_rate(contact[:, foot], control_s) for foot in (0, 1)),
    }


def touchdown_rate(contact: np.ndarray, control_s: float) -> float:
    """Touchdowns per minute of a foot, between the first and the last; over the whole time if these span under half.

    Args:
        contact: (t,) ground contact of the foot at each control step
        control_s: duration of a control step [s]
    """
    landed, air_s = [], 0.0
    for step, on in enumerate(contact):
        if on and air_s >= MIN_SWING_S - 1e-9:
            landed.append(step * control_s)
        air_s = 0.0 if on else air_s + control_s
    duration_s, span_s = len(contact) * control_s, landed[-1] - landed[0] if landed else 0.0
    return 60.0 * ((len(landed) - 1) / span_s if span_s >= 0.5 * duration_s else len(landed) / duration_s)
