"""A policy as a task folder of Booster's deployment program (booster_deploy).

    tasks/booster_lab/__init__.py    registers the task
    tasks/booster_lab/walk.py        gains, pose and joints of the policy on the vendor's robot
    tasks/booster_lab/models/policy.pt

The vendor's locomotion policy class reads the observation that ours is trained on, so that no code is copied: `walk.py`
only has numbers. Gains are listed by joint name and sorted into the order of the vendor's robot; the import fails if a
joint is missing on one side.
"""

import math
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

from pipeline.deployment import DeploymentTask, Policy
from pipeline.errors import SettingsError
from pipeline.export.networks import to_torch_script
from pipeline.files import atomic, settings
from pipeline.files.ranges import Allowed
from pipeline.robot.load import ROBOTS

TASK = "booster_lab_walk"
"""Name under which the task is registered."""
FOLDER = Path("tasks") / "booster_lab"
MODEL = "models/policy.pt"
PROGRAMS = "deployment.yaml"
"""File in the folder of a robot with its names in deployment programs."""


@dataclass(frozen=True)
class Identifier(Allowed):
    """A Python identifier."""

    def problem(self, value: str) -> str | None:
        return None if value.isidentifier() else f"is {value!r}, expected a Python identifier"


@dataclass(frozen=True, kw_only=True)
class Programs:
    """`robots/<robot>/deployment.yaml`."""

    booster_deploy: Annotated[str, Identifier()]
    """The robot's configuration in `booster_deploy.robots.booster`."""


MAX_COMMAND = (1.0, 0.6, 1.0)
"""Largest joystick commands in both directions: forward [m/s], lateral [m/s], yaw rate [rad/s]."""


def vendor_robot(robot: str) -> str:
    """The configuration of a robot in booster_deploy. Raises SettingsError for a robot without one."""
    path = ROBOTS / robot / PROGRAMS
    if not path.is_file():
        problem = f"booster_deploy has no configuration of '{robot}' that is known here."
        raise SettingsError(path, f"{problem} Write the file: booster_deploy: NAME_OF_ITS_CONFIGURATION.")
    return settings.read(path, Programs).booster_deploy


def write_task_folder(folder: Path, task: DeploymentTask, policy: Policy, root_height: float) -> list[Path]:
    """Write the task folder below `folder` and return its files. Raises SettingsError for an unsupported robot."""
    vendor = vendor_robot(task.robot)
    place = folder / FOLDER
    atomic.write_text(place / "__init__.py", _INIT.format(task=TASK))
    atomic.write_text(place / "walk.py", _walk(task, vendor, root_height))
    atomic.write_bytes(place / MODEL, to_torch_script(task, policy))
    atomic.write_text(folder / "README.md", _README.format(task=TASK, robot=vendor))
    return [place / "__init__.py", place / "walk.py", place / MODEL, folder / "README.md"]


def _walk(task: DeploymentTask, vendor: str, root_height: float) -> str:
    rows = zip(task.joint_names, task.default_joint_pos.tolist(), task.kp.tolist(), task.kd.tolist(), strict=True)
    return _WALK.format(
        robot=vendor,
        joints="\n".join(f'    "{name}": ({pos!r}, {kp!r}, {kd!r}),' for name, pos, kp, kd in rows),
        order="\n".join(f'    "{name}",' for name in task.policy_joints),
        policy_dt=1.0 / task.control_hz,
        history=task.history,
        action_scale=task.action_scale,
        model=MODEL,
        height=math.ceil(root_height * 100.0) / 100.0,
        forward=MAX_COMMAND[0],
        lateral=MAX_COMMAND[1],
        yaw_rate=MAX_COMMAND[2],
    )


_INIT = '''"""Registers the walking policy that Booster Lab exported."""

from booster_deploy.utils.registry import register_task

from .walk import BoosterLabWalkControllerCfg

register_task("{task}", BoosterLabWalkControllerCfg())
'''

_WALK = '''"""Numbers of an exported policy, written by Booster Lab; the golden vectors are in the export."""

from pathlib import Path

from booster_deploy.controllers.controller_cfg import ControllerCfg, MujocoControllerCfg, VelocityCommandCfg
from booster_deploy.robots.booster import {robot}
from booster_deploy.utils.isaaclab.configclass import configclass
from tasks.locomotion.locomotion import LocomotionPolicyCfg

JOINTS = {{
{joints}
}}
"""Joint -> default position [rad], stiffness [N m/rad], damping [N m s/rad]."""

POLICY_JOINTS = [
{order}
]
"""The joints of the network, in its order."""

mismatched = sorted(set(JOINTS) ^ set({robot}.joint_names))
if mismatched:
    raise ValueError(f"joints of the policy are not those of {robot}: {{mismatched}}")


@configclass
class BoosterLabWalkControllerCfg(ControllerCfg):
    """Walks, runs and turns by a velocity command."""

    policy_dt: float = {policy_dt!r}
    robot = {robot}.replace(
        default_joint_pos=[JOINTS[name][0] for name in {robot}.joint_names],
        joint_stiffness=[JOINTS[name][1] for name in {robot}.joint_names],
        joint_damping=[JOINTS[name][2] for name in {robot}.joint_names],
    )
    vel_command: VelocityCommandCfg = VelocityCommandCfg(vx_max={forward!r}, vy_max={lateral!r}, vyaw_max={yaw_rate!r})
    policy: LocomotionPolicyCfg = LocomotionPolicyCfg(
        checkpoint_path=str(Path(__file__).resolve().parent / "{model}"),
        actor_obs_history_length={history!r},
        action_scale={action_scale!r},
        obs_dof_vel_scale=1.0,
        policy_joint_names=POLICY_JOINTS,
    )
    mujoco: MujocoControllerCfg = MujocoControllerCfg(init_pos=[0.0, 0.0, {height!r}])
'''

_README = """# The policy in booster_deploy

Copy `tasks/booster_lab` into `tasks/` of a checkout of booster_deploy. Edit nothing there.

    python scripts/deploy.py --list
    python scripts/deploy.py --task {task} --mujoco

In MuJoCo, type a command as `x y yaw`. On the robot, leave out `--mujoco`; first read the model card and the release
report. Joint order is checked against `{robot}` when the task is imported.
"""
