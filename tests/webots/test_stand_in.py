"""The controller, unchanged, in the stand-in: launcher, world, PROTO and sensors together."""

from __future__ import annotations

import dataclasses
import json
import os
import sys
from pathlib import Path

import numpy as np
import pytest

from pipeline import rotation
from pipeline.deployment import deployment_task, load_policy
from pipeline.files.settings import read
from pipeline.robot import Robot
from pipeline.robot.load import read_description
from pipeline.simulation.torque_envelope import TorqueEnvelope
from pipeline.validation.bars import read_validation
from pipeline.validation.derived_bars import allowed_of
from pipeline.webots.launch import Outcome
from pipeline.webots.project import Project, write_project
from pipeline.webots.result import WebotsSettings
from pipeline.webots.scene_model import SceneModel, read_scene
from pipeline.webots.stand_in import __main__ as stand_in_command
from pipeline.webots.stand_in.mujoco_engine import MujocoEngine
from pipeline.webots.stand_in.ode_engine import OdeEngine, OdeNotFoundError, load_ode
from pipeline.webots.stand_in.serve import Simulation
from pipeline.webots.validate import MUJOCO_STAND_IN, ODE_STAND_IN, run_stand_in, verdict
from tests.factories.webots_bars import STILL


def ode_is_there() -> bool:
    try:
        load_ode()
    except OdeNotFoundError:
        return False
    return True


@pytest.fixture(scope="module")
def stood(template: Project, short_walk: WebotsSettings) -> Outcome:
    """The template in the stand-in."""
    return run_stand_in("mujoco", template, short_walk)


def test_the_robot_stands_in_the_stand_in(stood: Outcome, short_walk: WebotsSettings, robot: Robot):
    outcome = stood
    assert outcome.status == "finished", outcome.tail
    assert outcome.result is not None
    assert outcome.result.fell_s is None
    assert outcome.result.seconds == pytest.approx(1.2)
    for segment in outcome.result.segments:
        assert segment.walked
        assert segment.height_m == pytest.approx(robot.default_root_height, abs=0.01)
    assert verdict(MUJOCO_STAND_IN, outcome, short_walk, STILL).reasons == ("no policy was active",)


def test_a_project_is_run_from_a_folder_that_is_named_from_here(
    project: Project, short_walk: WebotsSettings, monkeypatch: pytest.MonkeyPatch
):
    monkeypatch.chdir(project.folder.parent)
    here = dataclasses.replace(project, folder=Path(project.folder.name))
    outcome = run_stand_in("mujoco", here, short_walk)
    assert outcome.status == "finished", outcome.tail


def test_a_stand_in_gives_the_same_result_again(stood: Outcome, project: Project, short_walk: WebotsSettings):
    again = run_stand_in("mujoco", project, short_walk)
    one, two = (verdict(MUJOCO_STAND_IN, each, short_walk, STILL) for each in (stood, again))
    assert one.to_dict() == two.to_dict()
    assert one.result is not None and two.result is not None and one.result.run != two.result.run


def test_a_fall_ends_the_walk(project: Project, short_walk: WebotsSettings):
    task = json.loads((project.controller / "task.json").read_text())
    task["kp"] = [0.0] * len(task["kp"])
    (project.controller / "task.json").write_text(json.dumps(task))
    segments = tuple(dataclasses.replace(each, seconds=2.0) for each in short_walk.segments)
    settings = dataclasses.replace(short_walk, segments=segments)
    said = verdict(MUJOCO_STAND_IN, run_stand_in("mujoco", project, settings), settings, STILL)
    assert said.result is not None and said.result.fell_s is not None
    assert said.status == "failed"
    assert any(reason.startswith("fell after") for reason in said.reasons)
    assert "segment 'second': not walked to its end" in said.reasons


def test_a_controller_that_dies_is_a_crash(project: Project, short_walk: WebotsSettings):
    (project.controller / "task.json").write_text("{")
    outcome = run_stand_in("mujoco", project, short_walk)
    assert outcome.status == "crashed"
    assert "JSONDecodeError" in outcome.tail


def test_a_world_that_names_a_missing_controller_is_a_sentence(project: Project, short_walk: WebotsSettings):
    (project.controller / "booster_lab.py").unlink()
    outcome = run_stand_in("mujoco", project, short_walk)
    assert outcome.status == "crashed"
    assert "the controller that the world names is missing." in outcome.reason


def test_a_missing_ode_is_not_run_and_never_passed(
    project: Project, short_walk: WebotsSettings, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
):
    monkeypatch.setitem(sys.modules, "ode", None)  # what an import finds where the package is missing
    monkeypatch.delenv("BOOSTER_LAB_ODE", raising=False)
    monkeypatch.setattr("pipeline.webots.stand_in.ode_engine.DEBIAN_FOLDER", tmp_path)
    said = verdict(ODE_STAND_IN, run_stand_in("ode", project, short_walk), short_walk, STILL)
    assert said.status == "not run: ode not found"
    assert not said.judged and said.result is None


def test_a_folder_called_ode_is_not_ode(monkeypatch: pytest.MonkeyPatch, tmp_path: Path):
    (tmp_path / "ode").mkdir()
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.delitem(sys.modules, "ode", raising=False)
    monkeypatch.delenv("BOOSTER_LAB_ODE", raising=False)
    monkeypatch.setattr("pipeline.webots.stand_in.ode_engine.DEBIAN_FOLDER", tmp_path / "none")
    with pytest.raises(OdeNotFoundError, match=r"^ode not found \(the installed module 'ode' is not pyode\)"):
        load_ode()


class RecordedOde:
    """pyode's calls written down instead of done: what the engine asks of it can be looked at without it."""

    ContactSoftERP, ContactSoftCFM, ContactApprox1, ParamLoStop, ParamHiStop = 1, 2, 4, 8, 16

    def __init__(self) -> None:
        self.made: list[tuple[str, Recorded]] = []

    def __getattr__(self, kind: str):
        def make(*arguments: object) -> Recorded:
            one = Recorded(arguments)
            self.made.append((kind, one))
            return one

        return make

    def of(self, kind: str) -> list[Recorded]:
        return [one for name, one in self.made if name == kind]


class Recorded:
    def __init__(self, arguments: tuple) -> None:
        self.arguments, self.calls = arguments, {}

    def __getattr__(self, name: str):
        def call(*arguments: object) -> None:
            self.calls.setdefault(name, []).append(arguments)

        return call


def test_ode_is_told_the_scene(project: Project):
    """Bodies at their centres of mass with the PROTO's inertia, hinges about world axes, stops about the start."""
    scene, ode = read_scene(project.world), RecordedOde()
    OdeEngine(scene, ode)
    (world,) = ode.of("World")
    assert world.calls["setGravity"] == [((0.0, 0.0, -9.81),)]
    assert (world.calls["setERP"], world.calls["setCFM"]) == ([(0.2,)], [(1e-05,)])
    masses = [mass.calls["setParameters"][0] for mass in ode.of("Mass")]
    assert sum(each[0] for each in masses) == pytest.approx(31.734357782)
    assert all(each[1:4] == (0.0, 0.0, 0.0) for each in masses)
    assert masses[0][4:] == pytest.approx(scene.bodies[0].moment[[0, 1, 2, 0, 0, 1], [0, 1, 2, 1, 2, 2]])
    (trunk, *_), hinges = ode.of("Body"), ode.of("HingeJoint")
    wanted = scene.bodies[0].pos + scene.bodies[0].com
    assert trunk.calls["setPosition"][0][0] == pytest.approx(tuple(wanted))
    assert len(hinges) == 23
    knee = next(index for index, (_, hinge) in enumerate(scene.hinges) if hinge.motor == "Left_Knee_Pitch")
    stops = dict(hinges[knee].calls["setParam"])
    assert stops == {8: pytest.approx(0.0 - 0.4), 16: pytest.approx(2.1817 - 0.4)}
    axis = np.array(hinges[knee].calls["setAxis"][0][0])
    np.testing.assert_allclose(axis, [0.0, 1.0, 0.0], atol=1e-12)


@pytest.mark.skipif(not ode_is_there(), reason="ode not found")
def test_the_robot_stands_in_ode(project: Project, short_walk: WebotsSettings, robot: Robot):
    outcome = run_stand_in("ode", project, short_walk)
    assert outcome.status == "finished", outcome.tail
    assert outcome.result is not None and outcome.result.fell_s is None
    assert outcome.result.segments[1].height_m == pytest.approx(robot.default_root_height, abs=0.01)


def test_sensors_say_what_the_engine_does(project: Project):
    """A robot in free fall that turns: the accelerometer reads nothing, the gyro and the attitude the truth."""
    scene = _raised(read_scene(project.world))
    engine = MujocoEngine(scene)
    engine.data.qvel[3:6] = [0.0, 0.0, 1.0]
    simulation = Simulation(scene, engine)
    enabled = {name: 5 for name in (*simulation.sensors, *scene.imu)}
    said = simulation.step({"step": 50, "torque": {}, "enabled": enabled})["values"]
    root = engine.root()
    np.testing.assert_allclose(said["imu_gyro"], rotation.rotate_inverse(root.quat_w, root.ang_vel_w), atol=1e-12)
    np.testing.assert_allclose(np.roll(said["imu_orientation"], 1), root.quat_w, atol=1e-12)
    assert np.linalg.norm(said["imu_accelerometer"]) < 1.5
    joints = np.array([said[hinge.sensor][0] for _, hinge in scene.hinges])
    np.testing.assert_allclose(joints, engine.joint_pos(), atol=1e-12)


def test_a_supervisor_is_told_the_velocity_of_the_centre_of_mass(project: Project):
    """As by Webots, whose bodies have their origin there: of a trunk that turns on the spot it isn't zero."""
    scene = _raised(read_scene(project.world))
    engine = MujocoEngine(scene)
    engine.data.qvel[5] = 2.0
    truth = Simulation(scene, engine).truth()
    x, y, _ = scene.bodies[0].com
    assert x == pytest.approx(0.0551365401)
    np.testing.assert_allclose(truth["velocity"], [-2.0 * y, 2.0 * x, 0.0, 0.0, 0.0, 2.0], atol=1e-12)
    np.testing.assert_allclose(truth["position"], scene.bodies[0].pos, atol=1e-12)


def test_an_accelerometer_at_rest_reads_gravity(project: Project):
    scene = read_scene(project.world)
    engine = MujocoEngine(scene)
    engine.data.xfrc_applied[1, 2] = 31.734357782 * 9.81  # held up by the trunk
    simulation = Simulation(scene, engine)
    still = {"step": 5, "torque": {}, "enabled": {"imu_accelerometer": 5}}
    said = simulation.step(still)["values"]["imu_accelerometer"]
    assert np.linalg.norm(said) == pytest.approx(9.81, abs=0.6)
    assert said[2] > 9.0


def test_a_torque_beyond_the_motor_is_cut(project: Project):
    """By the module `controller`, as Webots does."""
    import importlib.util

    from pipeline.webots.stand_in.serve import API

    spec = importlib.util.spec_from_file_location("stand_in_controller", API / "controller.py")
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    robot = object.__new__(module.Robot)
    robot._torque = {}
    module.Motor(robot, "knee", 60.0).setTorque(-90.0)
    assert robot._torque == {"knee": -60.0}


@pytest.mark.shared
def test_the_published_policy_walks_in_the_stand_in(tmp_path: Path, policies: Path, root: Path, robot: Robot):
    """As commanded and judged, the first half of the walk of data/webots.yaml."""
    settings = read(root / "data" / "webots.yaml", WebotsSettings)
    settings = dataclasses.replace(settings, segments=settings.segments[:4])
    kd = np.where(["Ankle" in name for name in robot.joint_names], 2.0, robot.kd)
    project = write_project(
        tmp_path,
        read_description(root / "robots" / "t1"),
        deployment_task(robot, kd=kd),
        TorqueEnvelope(limit=robot.torque_limit),
        load_policy(policies / "t1_walk.npz"),
        settings,
    )
    rules = read_validation(root / "data/validation.yaml", root / "robots/t1/validation.yaml")
    said = verdict(MUJOCO_STAND_IN, run_stand_in("mujoco", project, settings), settings, allowed_of(rules.webots))
    assert said.status == "passed", said.reasons
    assert said.result is not None
    assert said.result.segments[1].forward_m_s == pytest.approx(0.495, abs=0.03)  # that of the bridge
    assert os.environ.get("BOOSTER_LAB_STAND_IN") is None


def _raised(scene: SceneModel) -> SceneModel:
    root = dataclasses.replace(scene.bodies[0], pos=np.array([0.0, 0.0, 5.0]))
    return dataclasses.replace(scene, bodies=(root, *scene.bodies[1:]))


def test_the_command_takes_the_flags_of_webots_and_no_others(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    served: list[tuple[Path, str]] = []
    monkeypatch.setattr(stand_in_command, "serve", lambda world, engine: served.append((world, engine)) or 0)
    world = tmp_path / "world.wbt"
    for flags in (["--batch", "--mode", "fast", "--port", "1234"], ["--no-rendering", "--mode=fast"]):
        monkeypatch.setattr(sys, "argv", ["stand_in", "--engine", "mujoco", *flags, str(world)])
        assert stand_in_command.main() == 0
    assert served == [(world, "mujoco")] * 2
    monkeypatch.setattr(sys, "argv", ["stand_in", "--engine", "mujoco", "--bach", str(world)])
    with pytest.raises(SystemExit):
        stand_in_command.main()
