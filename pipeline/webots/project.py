"""A self-contained Webots project folder: PROTO, world, controller with policy and modules."""

import ast
import json
import sys
from collections.abc import Iterator
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any

import numpy as np

from pipeline.deployment import DeploymentTask, Policy, save_policy
from pipeline.errors import FileError, PipelineError
from pipeline.files import atomic
from pipeline.physics import GRAVITY
from pipeline.robot import Robot
from pipeline.robot.build import build_robot
from pipeline.robot.description import Description
from pipeline.simulation.run import FALL_TILT_COS, fall_height
from pipeline.simulation.torque_envelope import TorqueEnvelope
from pipeline.webots.proto import CONTROLLER, MATERIAL, SENSOR_SUFFIX, SENSORS, VERSION, proto_name, robot_proto
from pipeline.webots.result import WebotsSettings
from pipeline.webots.vrml import Node, Scene, node, to_text

TIMESTEPS_MS = (1.0, 5.0)
"""Allowed `basicTimeStep` [ms]: 1 as in Booster's own world, 5 as in training."""
FLOOR = "floor"
README = "README.md"
ERP, CFM = 0.2, 1e-5
SOFT_ERP, SOFT_CFM = 0.2, 1e-3
"""Webots' defaults, stated explicitly: error reduction and softness of a contact."""


def robot_world(robot: Robot, timestep_ms: float, friction: float) -> Scene:
    """The world file beside `protos/`; bodies at rest stay simulated. Raises PipelineError for another timestep."""
    if timestep_ms not in TIMESTEPS_MS:
        allowed = " or ".join(f"{each:g}" for each in TIMESTEPS_MS)
        raise PipelineError(f"a basicTimeStep of {timestep_ms:g} ms is not supported; choose {allowed} ms.")
    soft = {"bounce": (0.0,), "bounceVelocity": (0.0,), "softERP": (SOFT_ERP,), "softCFM": (SOFT_CFM,)}
    contacts = [
        node("ContactProperties", material1=MATERIAL, material2=other, coulombFriction=[friction], **soft)
        for other in (FLOOR, MATERIAL)
    ]
    info = node(
        "WorldInfo",
        title=f"Booster Lab: {robot.name}",
        gravity=(GRAVITY,),
        CFM=(CFM,),
        ERP=(ERP,),
        basicTimeStep=(timestep_ms,),
        physicsDisableLinearThreshold=(0.0,),
        physicsDisableAngularThreshold=(0.0,),
        coordinateSystem="ENU",
        contactProperties=contacts,
    )
    look = node("PBRAppearance", baseColor=(0.5, 0.5, 0.5), roughness=(1.0,))
    plane = node("Plane", size=(100.0, 100.0))
    shape = node("Shape", appearance=look, geometry=plane)
    nodes = (
        info,
        node("Viewpoint", orientation=(0.0, 1.0, 0.0, 0.12), position=(-3.5, 0.0, 1.2), follow=robot.name),
        node("Background", skyColor=[0.7, 0.8, 0.9]),
        node("DirectionalLight", direction=(-0.4, 0.3, -1.0)),
        node("Solid", children=[shape], name=FLOOR, contactMaterial=FLOOR, boundingObject=plane),
        Node(kind=proto_name(robot), name="ROBOT"),
    )
    extern = (f"../protos/{proto_name(robot)}.proto",)
    return Scene(version=VERSION, extern=extern, protos=(), nodes=nodes)


RESULT = "result.json"
"""Result file, written by the controller into its folder."""


@dataclass(frozen=True, kw_only=True)
class Project:
    """Paths in a project folder."""

    folder: Path
    robot: str

    @property
    def world(self) -> Path:
        return self.folder / "worlds" / f"{self.robot}.wbt"

    @property
    def controller(self) -> Path:
        """Folder of the controller."""
        return self.folder / "controllers" / CONTROLLER

    @property
    def run(self) -> Path:
        """The commands that the controller walks."""
        return self.controller / "run.json"

    @property
    def result(self) -> Path:
        return self.controller / RESULT


def write_project(
    folder: Path,
    source: Description,
    task: DeploymentTask,
    envelope: TorqueEnvelope,
    policy: Policy | None,
    settings: WebotsSettings,
) -> Project:
    """Write the project of a robot folder's tables; equal arguments give equal bytes.

    Args:
        folder: project folder, created if missing; its other files are kept
        source: the robot's tables
        task: joints and gains
        envelope: torque limits of the motors
        policy: the policy that walks; None: the robot holds its default pose
        settings: timestep, friction and commands

    Raises FileError if a file can't be written, or if a file exists that is not of an earlier project.
    """
    robot = build_robot(source)
    project = Project(folder=folder, robot=robot.name)
    foreign = [path for path in (folder / README, project.world) if path.exists()]
    if foreign and not project.controller.is_dir():
        problem = "it exists, and the folder has no project of Booster Lab."
        raise FileError(foreign[0], problem, "Name an empty folder.")
    world = robot_world(robot, settings.timestep_ms, settings.friction)
    home = project.controller
    atomic.write_text(home / PROGRAM.name, PROGRAM.read_text(encoding="utf-8"))
    for name, path in needed_modules().items():
        atomic.write_text(home / name, path.read_text(encoding="utf-8"))
    atomic.write_text(home / "shims" / "jaxtyping.py", JAXTYPING_SHIM)
    atomic.write_text(home / "task.json", _json(_task(task, envelope, fall_height(robot))))
    atomic.write_text(project.run, _json(run_plan(settings, run="by hand")))
    if policy is None:
        (home / "policy.npz").unlink(missing_ok=True)
    else:
        save_policy(home / "policy.npz", policy)
    atomic.write_text(folder / "protos" / f"{proto_name(robot)}.proto", to_text(robot_proto(source, robot)))
    atomic.write_text(project.world, to_text(world))
    atomic.write_text(folder / README, _readme(project))
    return project


def run_plan(settings: WebotsSettings, run: str) -> dict[str, Any]:
    """Content of `run.json`: the commands, and the name of the run, which its result must repeat."""
    names = ("name", "seconds", "command", "slew")
    segments = [{name: getattr(each, name) for name in names} for each in settings.segments]
    return {"run": run, "result": RESULT, "measured_s": settings.measured_s, "segments": segments}


def _task(task: DeploymentTask, envelope: TorqueEnvelope, lowest: float) -> dict[str, Any]:
    """Content of `task.json`; read by `task_of` and `motors_of` of the controller."""
    kinds = {"gyro": "Gyro", "inertial_unit": "InertialUnit", "accelerometer": "Accelerometer"}
    devices = {name: SENSORS[kind] for name, kind in kinds.items()}
    return {
        **{each.name: _plain(getattr(task, each.name)) for each in fields(task)},
        "fall": {"height_m": lowest, "tilt_cos": FALL_TILT_COS},
        "motors": {each.name: _plain(getattr(envelope, each.name)) for each in fields(envelope)},
        "devices": {**devices, "sensor_suffix": SENSOR_SUFFIX},
    }


def _plain(value: Any) -> Any:
    return value.tolist() if isinstance(value, np.ndarray) else value


def _json(value: Any) -> str:
    return json.dumps(value, indent=1, allow_nan=False) + "\n"


def _readme(project: Project) -> str:
    world = project.world.relative_to(project.folder).as_posix()
    return f"""# Booster Lab's {project.robot} in Webots

Written by `booster-lab webots-project`; do not edit it by hand.

    webots {world}

opens the world. The controller needs a Python with numpy. It follows the commands in
`controllers/{CONTROLLER}/run.json` and writes `controllers/{CONTROLLER}/{RESULT}`. Webots has no armature, so rotor
inertia is added to the driven links.
"""


PIPELINE = Path(__file__).resolve().parents[1]
PROGRAM = Path(__file__).resolve().with_name("booster_lab.py")
ELSEWHERE = frozenset({"numpy", "jaxtyping", "controller"})
"""Allowed imports besides the standard library: numpy, Webots' module, and jaxtyping, which gets a shim."""

JAXTYPING_SHIM = '''"""Array shapes for readers; not checked here."""


class Float:
    def __class_getitem__(cls, key):
        return cls


Int = Bool = Float
'''


def needed_modules() -> dict[str, Path]:
    """Path below the controller's folder -> needed source file. Raises PipelineError for one outside Webots' Python."""
    found: set[Path] = set()
    waiting = [PROGRAM]
    while waiting:
        path = waiting.pop()
        for module in _imports(ast.parse(path.read_text(encoding="utf-8"))):
            top = module.partition(".")[0]
            if top == "pipeline":
                waiting += set(_files(module)) - found
                found.update(_files(module))
            elif top not in ELSEWHERE and top not in sys.stdlib_module_names:
                raise PipelineError(
                    f"module '{path.stem}' imports '{top}', which the Webots project would then need; the controller "
                    f"may use {', '.join(sorted(ELSEWHERE))} and the standard library."
                )
    return {path.relative_to(PIPELINE.parent).as_posix(): path for path in sorted(found)}


def _files(module: str) -> Iterator[Path]:
    """The file of a module and the `__init__` files of the packages above it."""
    place = PIPELINE
    yield place / "__init__.py"
    for part in module.split(".")[1:]:
        place = place / part
        file = place / "__init__.py" if place.is_dir() else place.with_suffix(".py")
        if file.is_file():
            yield file


def _imports(node: ast.AST) -> Iterator[str]:
    """Modules that a file imports at run time, without those under `TYPE_CHECKING`."""
    if isinstance(node, ast.Import):
        yield from (alias.name for alias in node.names)
    elif isinstance(node, ast.ImportFrom) and node.module:
        yield from (f"{node.module}.{alias.name}" for alias in node.names)
    only_for_types = isinstance(node, ast.If) and isinstance(node.test, ast.Name) and node.test.id == "TYPE_CHECKING"
    for child in node.orelse if only_for_types else ast.iter_child_nodes(node):
        yield from _imports(child)
