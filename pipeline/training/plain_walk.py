"""A policy walked in plain MuJoCo by the files of a training bundle alone, for hosts with mjlab and jaxtyping alone.

A 2 ms step, explicit position control behind the torque-speed lines, no noise, commands slewed at 1 m/s^2 (1 rad/s^2).
A test compares it with the walk of `pipeline/validation`, which has more conditions.
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
"""Time at the end of a walk that is measured [s]."""
MAX_TILT_COS = 0.5
AIR_S = 0.04
"""A touchdown ends a swing of at least this long [s]."""
START_NOISE = 0.02
"""Largest offset of the joints at the start, for seeds other than 0 [rad]."""


@dataclass(frozen=True, kw_only=True)
class Walk:
    """One trial."""

    command: tuple[float, float, float]
    seconds: float = 10.0
    seed: int = 0


@functools.lru_cache(maxsize=1)
def robot_of(bundle: Path) -> dict[str, Any]:
    """The facts of `robot.json`, lists as arrays."""
    facts = json.loads((bundle / "robot.json").read_text())
    numbers = ("default_joint_pos", "kp", "kd", "effort_limit")
    facts |= {name: np.array(facts[name], dtype=float) for name in numbers}
    stall, no_load = (np.array(facts[name], dtype=float) for name in ("saturation_effort", "no_load_speed"))
    known = np.isfinite(no_load)
    facts["stall"] = np.where(known, stall, 1e3 * facts["effort_limit"])
    facts["no_load"] = np.where(known, no_load, 1e6)
    facts["policy_index"] = np.array([facts["joint_names"].index(name) for name in facts["policy_joints"]])
    return facts


@functools.lru_cache(maxsize=8)
def model_of(bundle: Path) -> mujoco.MjModel:
    """The robot on a plane."""
    spec = mujoco.MjSpec.from_string((bundle / "robot.xml").read_text())
    spec.option.timestep = STEP_S
    spec.worldbody.add_geom(name="ground", type=mujoco.mjtGeom.mjGEOM_PLANE, size=[0.0, 0.0, 0.05])
    return spec.compile()


class World:
    """State of one walk: MuJoCo's, the policy's history, and its joint targets."""

    def __init__(self, bundle: Path, policy: Path, walk: Walk):
        """Raises FileError for a policy that can't be read or is not the bundle's robot's."""
        self.facts, self.policy, self.walk = robot_of(bundle), load_policy(policy), walk
        names, index = self.facts["joint_names"], self.facts["policy_index"]
        self._history = np.zeros((HISTORY, 9 + 3 * len(index)), dtype=np.float32)
        bare = {name: self.facts[name] for name in GAINS}
        gains = self.policy.gains or PolicyGains(joint_names=tuple(names), **bare)
        sizes, fitting = (self.policy.observation_size, self.policy.action_size), (self._history.size, len(index))
        if sizes != fitting or set(gains.joint_names) != set(names):
            wanted = f"{fitting[0]} observations, {fitting[1]} actions and its joint names"
            problem = f"it is no walking policy of '{self.facts['robot']}', which takes {wanted}."
            raise FileError(policy, problem, f"The bundle {bundle} is of that robot; give the one of the policy's.")
        self.kp, self.kd, self.rest = (in_order(getattr(gains, name), gains.joint_names, names) for name in GAINS)
        self.model = model_of(bundle)
        self.data = mujoco.MjData(self.model)
        noise = np.random.default_rng(walk.seed).uniform(-1.0, 1.0, len(self.rest)) * (START_NOISE if walk.seed else 0)
        self.data.qpos[:7] = [0.0, 0.0, self.facts["default_root_height"], 1.0, 0.0, 0.0, 0.0]
        self.data.qpos[7:] = self.rest + noise
        mujoco.mj_forward(self.model, self.data)
        self.root = self.model.body(self.facts["root_link"]).id
        self.foot_bodies = [int(self.model.site(name).bodyid[0]) for name in self.facts["feet"]]
        self._action, self.target = np.zeros(len(index)), self.rest.copy()

    def decide(self) -> None:
        """New joint targets of the network."""
        data, index = self.data, self.facts["policy_index"]
        command = np.clip(self.walk.command, -data.time, data.time)
        rotation = data.xmat[self.root].reshape(3, 3)
        joints = data.qpos[7:][index] - self.rest[index]
        frame = np.concatenate([data.qvel[3:6], -rotation[2], command, joints, data.qvel[6:][index], self._action])
        self._history = np.vstack([self._history[1:], frame.astype(np.float32)])
        self._action = self.policy.act(self._history.ravel())
        self.target = self.rest.copy()
        self.target[index] += ACTION_SCALE * self._action

    def bounds(self) -> tuple[np.ndarray, np.ndarray]:
        """Least and largest torque of each motor at its speed [N m]."""
        limit, fall = self.facts["effort_limit"], self.data.qvel[6:] / self.facts["no_load"]
        low, high = (np.clip(self.facts["stall"] * (sign - fall), -limit, limit) for sign in (-1.0, 1.0))
        return low, high

    def step(self) -> np.ndarray:
        """One physics step; the torques [N m]."""
        data = self.data
        low, high = self.bounds()
        torque = np.clip(self.kp * (self.target - data.qpos[7:]) - self.kd * data.qvel[6:], low, high)
        data.qfrc_applied[6:] = torque
        mujoco.mj_step(self.model, data)
        return torque

    @property
    def fell(self) -> bool:
        """Whether the trunk is too low or too tilted, or the joint targets are not finite, which MuJoCo would reset."""
        upright = self.data.qpos[2] >= self.facts["fall_height"] and self.data.xmat[self.root][8] >= MAX_TILT_COS
        return not (upright and np.isfinite(self.target).all())

    def touching(self) -> list[bool]:
        """Which feet touch the ground."""
        pairs = {
            (int(self.model.geom_bodyid[a]), int(self.model.geom_bodyid[b]))
            for a, b in self.data.contact.geom[: self.data.ncon]
        }
        return [(0, foot) in pairs or (foot, 0) in pairs for foot in self.foot_bodies]


def walked(bundle: Path, policy: Path, walk: Walk) -> dict[str, float]:
    """Figures of a walk over its last MEASURE_S; of one that fell, that it did and when."""
    world, power, rows = World(bundle, policy, walk), [], []
    steps = round(walk.seconds / STEP_S)
    for step in range(steps):
        if step % CONTROL_EVERY == 0:
            world.decide()
        torque, data = world.step(), world.data
        if world.fell:
            return {"fell": 1.0, "fell_s": data.time}
        if step >= steps - round(MEASURE_S / STEP_S):
            power.append(float(np.abs(torque * data.qvel[6:]).sum()))
            if step % CONTROL_EVERY == CONTROL_EVERY - 1:
                heading = np.arctan2(data.xmat[world.root][3], data.xmat[world.root][0])
                rows.append([heading, *data.qvel[:2], *world.touching()])
    return {"fell": 0.0, "power": float(np.mean(power)), **_figures(np.array(rows, dtype=float))}


def _figures(table: np.ndarray) -> dict[str, float]:
    """Mean velocities in the yaw frame, and touchdowns a minute.

    Args:
        table: (t, 5), a row a control step: heading [rad], velocity x and y in the world [m/s], and whether the left
            and the right foot touch the ground
    """
    heading, vx, vy = table[:, :3].T
    touch, cos, sin = table[:, 3:] > 0.0, np.cos(heading), np.sin(heading)
    control_s, turned = STEP_S * CONTROL_EVERY, np.unwrap(heading)
    return {
        "forward": float((vx * cos + vy * sin).mean()),
        "lateral": float((vy * cos - vx * sin).mean()),
        "yaw_rate": float((turned[-1] - turned[0]) / ((len(table) - 1) * control_s)),
        "touchdowns_per_min": sum(touchdown_rate(touch[:, foot], control_s) for foot in (0, 1)),
    }


def touchdown_rate(touch: np.ndarray, control_s: float) -> float:
    """Touchdowns a minute of a foot: by the time between them, or their number where they fill less than half the time.

    Args:
        touch: (t,) whether the foot touches the ground at each control step
        control_s: duration of a control step [s]
    """
    landed, air_s = [], 0.0
    for step, on in enumerate(touch):
        if on and air_s >= AIR_S - 1e-9:
            landed.append(step * control_s)
        air_s = 0.0 if on else air_s + control_s
    lasted_s, between_s = len(touch) * control_s, landed[-1] - landed[0] if landed else 0.0
    return 60.0 * ((len(landed) - 1) / between_s if between_s >= 0.5 * lasted_s else len(landed) / lasted_s)
