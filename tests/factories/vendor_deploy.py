"""A stand-in for booster_deploy: modules of its names with what an exported task takes from them.

Configurations are plain dataclasses with `replace`. The locomotion policy loads its module, keeps its history (10
frames, the oldest first, clamped to 100) and makes joint targets from 0.25 of the action, as the vendor's does.
"""

from __future__ import annotations

import dataclasses
import importlib.util
import sys
import types
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import torch

from pipeline.robot import Robot


def configclass(cls: type) -> type:
    """A dataclass of every plain attribute of the class and of those above it."""
    hints: dict[str, Any] = {}
    for base in reversed(cls.__mro__[:-1]):
        for name, value in vars(base).items():
            if name.startswith("_") or isinstance(value, types.FunctionType):
                continue
            hints[name] = Any
            if value.__class__.__hash__ is None:
                setattr(cls, name, field(default_factory=lambda value=value: value))
    cls.__annotations__ = hints
    return dataclass(cls)


@dataclass
class RobotCfg:
    joint_names: list[str]
    joint_stiffness: list[float]
    joint_damping: list[float]
    default_joint_pos: list[float]
    effort_limit: list[float]

    def replace(self, **changes: Any) -> RobotCfg:
        return dataclasses.replace(self, **changes)


@dataclass
class VelocityCommandCfg:
    vx_max: float
    vy_max: float
    vyaw_max: float


@dataclass
class MujocoControllerCfg:
    init_pos: list[float]
    decimation: int = 10


@dataclass
class LocomotionPolicyCfg:
    checkpoint_path: str
    actor_obs_history_length: int
    action_scale: float
    obs_dof_vel_scale: float
    policy_joint_names: list[str]


class ControllerCfg:
    policy_dt = 0.0


@contextmanager
def vendor_modules(robot: Robot) -> Iterator[dict[str, Any]]:
    """The vendor's modules while the context lasts; what was registered, by task name."""
    registered: dict[str, Any] = {}
    vendor = RobotCfg(
        joint_names=list(robot.joint_names),
        joint_stiffness=[1.0] * len(robot.joint_names),
        joint_damping=[1.0] * len(robot.joint_names),
        default_joint_pos=[9.0] * len(robot.joint_names),
        effort_limit=robot.torque_limit.tolist(),
    )
    contents: dict[str, dict[str, Any]] = {
        "booster_deploy.controllers.controller_cfg": {
            "ControllerCfg": ControllerCfg,
            "MujocoControllerCfg": MujocoControllerCfg,
            "VelocityCommandCfg": VelocityCommandCfg,
        },
        "booster_deploy.robots.booster": {"T1_23DOF_CFG": vendor},
        "booster_deploy.utils.isaaclab.configclass": {"configclass": configclass},
        "booster_deploy.utils.registry": {"register_task": registered.__setitem__},
        "tasks.locomotion.locomotion": {"LocomotionPolicyCfg": LocomotionPolicyCfg},
    }
    made = {}
    for path, content in contents.items():
        parts = path.split(".")
        for end in range(1, len(parts) + 1):
            made.setdefault(".".join(parts[:end]), types.ModuleType(".".join(parts[:end])))
        vars(made[path]).update(content)
    before = {path: sys.modules.get(path) for path in made}
    sys.modules.update(made)
    try:
        yield registered
    finally:
        for path, module in before.items():
            if module is None:
                del sys.modules[path]
            else:
                sys.modules[path] = module


def import_task(folder: Path) -> None:
    """Import the package of a task folder, as the vendor's program does with everything below `tasks`."""
    spec = importlib.util.spec_from_file_location(
        "tasks.exported", folder / "__init__.py", submodule_search_locations=[str(folder)]
    )
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules["tasks.exported"] = module
    try:
        spec.loader.exec_module(module)
    finally:
        for path in [each for each in sys.modules if each.startswith("tasks.exported")]:
            del sys.modules[path]


class VendorPolicy:
    """Inference as the vendor's locomotion policy does it, with a task's configuration."""

    def __init__(self, cfg: Any):
        self.cfg = cfg
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", DeprecationWarning)  # of torch.jit, which the vendor uses
            self.module = torch.jit.load(cfg.policy.checkpoint_path, map_location="cpu").eval()
        names = cfg.robot.joint_names
        self.index = torch.tensor([names.index(name) for name in cfg.policy.policy_joint_names])
        self.default = torch.tensor(cfg.robot.default_joint_pos, dtype=torch.float32)
        count = len(self.index)
        self.history = torch.zeros(cfg.policy.actor_obs_history_length, 9 + 3 * count)
        self.last_action = torch.zeros(count)

    def targets(self, gyro_b: Any, gravity_b: Any, command: Any, joint_pos: Any, joint_vel: Any) -> np.ndarray:
        """Joint targets [rad] for one step's readings."""
        gyro, gravity, wanted, pos, vel = (
            torch.tensor(each, dtype=torch.float32) for each in (gyro_b, gravity_b, command, joint_pos, joint_vel)
        )
        away = pos[self.index] - self.default[self.index]
        speed = vel[self.index] * self.cfg.policy.obs_dof_vel_scale
        newest = torch.cat([gyro, gravity, wanted, away, speed, self.last_action])
        self.history = self.history.roll(-1, 0)
        self.history[-1] = newest.clamp(-100.0, 100.0)
        with torch.no_grad():
            self.last_action = self.module(self.history.flatten()).squeeze(0).clamp(-100.0, 100.0)
        targets = self.default.clone()
        targets.scatter_reduce_(0, self.index, self.last_action * self.cfg.policy.action_scale, reduce="sum")
        return targets.numpy()
