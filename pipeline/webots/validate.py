"""Check, run and evaluate a project in Webots and in its stand-ins. A result always names the engine it came from.

The project's PROTO and world are compared with the robot that they were made from; every deviation is listed.
"""

import math
import os
import sys
from collections.abc import Iterator, Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import mujoco
import numpy as np

from pipeline.errors import FileError
from pipeline.robot import Kinematics, Robot
from pipeline.simulation.mujoco_plant import added_moments
from pipeline.webots.launch import FINISHED, NOT_RUN, Outcome, launch, launch_webots
from pipeline.webots.project import PIPELINE, Project
from pipeline.webots.proto import CONTROLLER, IMU_SITE, SENSOR_SUFFIX, SENSORS
from pipeline.webots.result import Allowed, WalkResult, WalkSegment, WebotsSettings
from pipeline.webots.scene_model import SceneModel, read_scene
from pipeline.webots.stand_in.mujoco_engine import start_poses
from pipeline.webots.stand_in.ode_engine import NOT_FOUND, OdeNotFoundError, load_ode

WEBOTS, MUJOCO_STAND_IN, ODE_STAND_IN = "webots", "mujoco stand-in", "ode stand-in"
LABELS = {
    WEBOTS: "Webots",
    MUJOCO_STAND_IN: "MuJoCo (stand-in, not Webots)",
    ODE_STAND_IN: "ODE (Webots' engine family, upstream; stand-in, not Webots)",
}
PASSED, FAILED = "passed", "failed"
FAILED_TO_RUN = "failed to run"


@dataclass(frozen=True, kw_only=True)
class WebotsVerdict:
    """Verdict of one engine on a project."""

    engine: str
    status: str
    """`passed`, `failed`, or why there is no verdict: `not run: webots not found` if the program is missing,
    `failed to run: timed out, it was terminated after 300 s` if it gave no result."""
    reasons: tuple[str, ...] = ()
    result: WalkResult | None = None

    @property
    def judged(self) -> bool:
        return self.status in (PASSED, FAILED)

    @property
    def failed_to_run(self) -> bool:
        """Whether the program was found but gave no result."""
        return self.status.startswith(FAILED_TO_RUN)

    def to_dict(self) -> dict[str, Any]:
        """JSON types, without the name of the run, which differs each time."""
        result = None if self.result is None else {**asdict(self.result), "run": ""}
        facts = {"engine": LABELS[self.engine], "status": self.status, "reasons": list(self.reasons)}
        return {**facts, "result": result}


def validate(project: Project, settings: WebotsSettings, allowed: Mapping[str, Allowed]) -> dict[str, WebotsVerdict]:
    """Verdicts of Webots and both stand-ins; a missing engine gives `not run`. `allowed`: see `verdict`."""
    outcomes = {
        WEBOTS: launch_webots(project, settings),
        MUJOCO_STAND_IN: run_stand_in("mujoco", project, settings),
        ODE_STAND_IN: run_stand_in("ode", project, settings),
    }
    return {engine: verdict(engine, outcome, settings, allowed) for engine, outcome in outcomes.items()}


def run_stand_in(engine: str, project: Project, settings: WebotsSettings) -> Outcome:
    """Run the project in the engine `mujoco` or `ode`, with the world, controller and launcher of Webots."""
    if engine == "ode":
        try:
            load_ode()
        except OdeNotFoundError:
            return Outcome(status=NOT_RUN, reason=NOT_FOUND)
    paths = [str(PIPELINE.parent), *filter(None, [os.environ.get("PYTHONPATH")])]
    program = [sys.executable, "-m", "pipeline.webots.stand_in", "--engine", engine]
    return launch(program, project, settings, {"PYTHONPATH": os.pathsep.join(paths)})


def verdict(engine: str, outcome: Outcome, settings: WebotsSettings, allowed: Mapping[str, Allowed]) -> WebotsVerdict:
    """Compare an outcome with the thresholds by segment name; a segment without thresholds is not required."""
    if outcome.status == NOT_RUN:
        return WebotsVerdict(engine=engine, status=f"{NOT_RUN}: {outcome.reason}")
    if outcome.status != FINISHED or outcome.result is None:
        return WebotsVerdict(engine=engine, status=f"{FAILED_TO_RUN}: {outcome.status}, {outcome.reason}")
    reasons = tuple(_reasons(outcome.result, settings, allowed))
    return WebotsVerdict(engine=engine, status=FAILED if reasons else PASSED, reasons=reasons, result=outcome.result)


def _reasons(result: WalkResult, settings: WebotsSettings, allowed: Mapping[str, Allowed]) -> Iterator[str]:
    if not result.policy:
        yield "no policy was active"
    if result.fell_s is not None:
        yield f"fell after {result.fell_s:.2f} s"
    required = [pair for pair in zip(settings.segments, result.segments, strict=True) if pair[0].name in allowed]
    if not required:
        yield "no segment is required (`webots` in the robot's validation.yaml is empty), so that nothing was checked"
    for segment, walked in required:
        where = f"segment '{segment.name}'"
        if not walked.walked:
            yield f"{where}: not walked to its end"
        else:
            yield from (f"{where}: {each}" for each in _off(segment, allowed[segment.name], walked.velocity))


def _off(segment: WalkSegment, allowed: Allowed, reached: tuple[float, float, float]) -> Iterator[str]:
    forward, lateral, yaw_rate = reached
    error = math.hypot(forward - segment.command[0], lateral - segment.command[1])
    if error > allowed.velocity_error_m_s:
        got = f"{forward:.2f}, {lateral:.2f} m/s for {segment.command[0]:g}, {segment.command[1]:g}"
        yield f"walks {got}, off by {error:.3f}, allowed is {allowed.velocity_error_m_s:g}"
    off = abs(yaw_rate - segment.command[2])
    if off > allowed.yaw_rate_error_rad_s:
        got = f"{yaw_rate:.2f} rad/s for {segment.command[2]:g}"
        yield f"turns {got}, off by {off:.3f}, allowed is {allowed.yaw_rate_error_rad_s:g}"


EXACT = 1e-9
"""Tolerance for equal numbers; files hold them with all digits."""


def project_faults(world: Path, robot: Robot) -> tuple[str, ...]:
    """Every deviation of a world file's scene from the robot, as sentences."""
    try:
        scene = read_scene(world)
    except FileError as error:
        return (str(error),)
    wrong_names = tuple(_names(scene, robot))
    if wrong_names:
        return wrong_names  # the other checks look up names
    return (*_motors(scene, robot), *_masses(scene, robot), *_poses(scene, robot), *_world(scene))


def _names(scene: SceneModel, robot: Robot) -> Iterator[str]:
    links = [body.name for body in scene.bodies[1:]]
    if links != list(robot.link_names[1:]):
        yield f"the solids are {', '.join(links)}, expected {', '.join(robot.link_names[1:])}"
    motors = [hinge.motor for _, hinge in scene.hinges]
    if sorted(motors) != sorted(robot.joint_names):
        yield f"the motors are {', '.join(motors)}, expected {', '.join(robot.joint_names)}"


def _motors(scene: SceneModel, robot: Robot) -> Iterator[str]:
    for _, hinge in scene.hinges:
        joint = robot.joint(hinge.motor)
        stops = hinge.stops or (0.0, 0.0)
        wanted = {
            "lower stop": (stops[0], max(robot.joint_lower[joint], -math.pi)),
            "upper stop": (stops[1], min(robot.joint_upper[joint], math.pi)),
            "maxTorque": (hinge.max_torque, robot.torque_limit[joint]),
            "maxVelocity": (hinge.max_velocity, robot.motor_speed_limit[joint]),
            "position": (hinge.position, robot.default_joint_pos[joint]),
        }
        for what, (got, bound) in wanted.items():
            if abs(got - bound) > EXACT:
                yield f"motor '{hinge.motor}': {what} is {got:g}, the robot's is {bound:g}"
        if hinge.sensor != hinge.motor + SENSOR_SUFFIX:
            yield f"motor '{hinge.motor}': its sensor is '{hinge.sensor}', expected '{hinge.motor + SENSOR_SUFFIX}'"


def _masses(scene: SceneModel, robot: Robot) -> Iterator[str]:
    total = sum(body.mass for body in scene.bodies)
    if abs(total - robot.total_mass) > EXACT:
        yield f"the masses sum to {total:.6f} kg, the robot's to {robot.total_mass:.6f}"
    for link, (mass, com, moment) in inertials(robot).items():
        body = scene.bodies[robot.link(link)]
        if abs(body.mass - mass) > EXACT:
            yield f"solid '{link}': mass is {body.mass:g} kg, the robot's is {mass:g}"
        if np.abs(body.com - com).max() > EXACT:
            yield f"solid '{link}': centre of mass is {body.com.tolist()}, the robot's is {com.tolist()}"
        if np.abs(body.moment - moment).max() > EXACT:
            yield f"solid '{link}': inertia is not the link's with its rotor"
        if not body.shapes:
            yield f"solid '{link}': has no bounding object"


def inertials(robot: Robot) -> dict[str, tuple[float, np.ndarray, np.ndarray]]:
    """Mass, centre of mass and inertia with rotor of each link, from the robot's MJCF text."""
    added = added_moments(robot)
    spec, found = mujoco.MjSpec.from_string(robot.mjcf), {}  # the bodies read below live as long as it does
    for body in spec.worldbody.find_all("body"):
        xx, yy, zz, xy, xz, yz = body.fullinertia
        moment = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
        found[body.name] = (body.mass, np.array(body.ipos), moment + added.get(body.name, np.zeros((3, 3))))
    return found


def _poses(scene: SceneModel, robot: Robot) -> Iterator[str]:
    pos, quat = start_poses(scene)
    root, turn = np.array([[0.0, 0.0, robot.default_root_height]]), np.array([[1.0, 0.0, 0.0, 0.0]])
    poses = Kinematics(robot).forward(root, turn, robot.default_joint_pos[None])
    apart = np.linalg.norm(pos - poses.pos_w[0], axis=1)
    turned = 1.0 - np.abs((quat * poses.quat_w[0]).sum(axis=1))
    for index, link in enumerate(robot.link_names):
        if apart[index] > EXACT or turned[index] > EXACT:
            yield f"solid '{link}': its pose differs from the default pose (distance {apart[index]:.2g} m)"


def _world(scene: SceneModel) -> Iterator[str]:
    if scene.bounce != 0.0:
        yield f"contacts of robot and floor bounce ({scene.bounce:g}), expected 0"
    if scene.controller != CONTROLLER:
        yield f"the controller is '{scene.controller}', expected '{CONTROLLER}'"
    wanted = {name: kind for kind, name in SENSORS.items()}
    got = {name: kind for name, (kind, _) in scene.imu.items()}
    if got != wanted:
        yield f"the inertial sensors at site '{IMU_SITE}' are {got}, expected {wanted}"
