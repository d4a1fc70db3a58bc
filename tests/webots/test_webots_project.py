"""The project folder: its scene is the robot, its controller needs numpy alone, and an altered file is found out."""

from __future__ import annotations

import ast
import re
import subprocess
import sys
from pathlib import Path

import mujoco
import numpy as np
import pytest

from pipeline.deployment import deployment_task
from pipeline.errors import PipelineError, SettingsError
from pipeline.files.settings import read
from pipeline.robot import Robot, mujoco_model
from pipeline.robot.load import read_description
from pipeline.simulation.mujoco_plant import put_armature_on_links
from pipeline.simulation.torque_envelope import TorqueEnvelope
from pipeline.webots.project import Project, needed_modules, robot_world, write_project
from pipeline.webots.result import WebotsSettings
from pipeline.webots.scene_model import read_scene
from pipeline.webots.stand_in.mujoco_engine import mujoco_scene
from pipeline.webots.validate import project_faults
from pipeline.webots.vrml import from_text
from tests.factories.policies import still_policy


def proto_of(project: Project) -> Path:
    (path,) = (project.folder / "protos").iterdir()
    return path


def test_the_scene_is_the_robot(project: Project, robot: Robot):
    assert project_faults(project.world, robot) == ()


def test_masses_sum_to_the_published_mass(project: Project):
    """31.7344 kg, as the URDF of the manufacturer and Webots' own converter have it."""
    scene = read_scene(project.world)
    assert len(scene.bodies) == 24
    assert sum(body.mass for body in scene.bodies) == pytest.approx(31.7344, abs=1e-4)


@pytest.mark.parametrize(
    ("pattern", "replacement", "fault"),
    [
        (r"maxTorque 60", "maxTorque 61", r"motor 'Left_Knee_Pitch': maxTorque is 61, the robot's is 60"),
        (r"maxVelocity 12\.57", "maxVelocity 12", r"maxVelocity is 12, the robot's is 12\.57"),
        (r"minStop -1\.0472", "minStop -1", r"lower stop is -1, the robot's is -1\.0472"),
        (r"maxStop 2\.1817", "maxStop 3", r"upper stop is 3"),
        (r"position 0\.4\n", "position 0.3\n", r"position is 0\.3, the robot's is 0\.4"),
        (r"mass 11\.7\n", "mass 11.8\n", r"the masses sum to 31\.834358 kg"),
        (r"inertiaMatrix \[ 0\.0915287235", "inertiaMatrix [ 0.1", r"solid 't1'|solid 'Trunk': inertia"),
        (r"centerOfMass \[ 0\.0551365401", "centerOfMass [ 0.06", r"centre of mass is"),
        (r'name "Left_Hip_Roll"', 'name "Right_Hip_Roll_2"', r"the motors are .*Right_Hip_Roll_2"),
        (r'name "Left_Hip_Roll_sensor"', 'name "hip"', r"its sensor is 'hip'"),
        (r"anchor 0 0 -0\.28", "anchor 0 0 -0.28", None),
        (r"translation 0 0 -0\.28\n", "translation 0 0 -0.29\n", r"differs from the default pose \(distance 0\.01 m\)"),
        (r"Gyro \{", "Accelerometer {", r"the inertial sensors"),
    ],
)
def test_an_altered_proto_is_found_out(
    project: Project, robot: Robot, pattern: str, replacement: str, fault: str | None
):
    path = proto_of(project)
    text, count = re.subn(pattern, replacement, path.read_text(), count=1)
    assert count == 1
    path.write_text(text)
    faults = project_faults(project.world, robot)
    assert not faults if fault is None else any(re.search(fault, each) for each in faults), faults


def test_a_bouncing_floor_is_found_out(project: Project, robot: Robot):
    project.world.write_text(project.world.read_text().replace("bounce 0\n", "bounce 0.5\n"))
    assert any("bounce" in fault for fault in project_faults(project.world, robot))


def test_a_broken_proto_is_one_sentence(project: Project, robot: Robot):
    path = proto_of(project)
    path.write_text(path.read_text()[:2000])
    (fault,) = project_faults(project.world, robot)
    assert path.name in fault and "ends inside a node" in fault


def test_dynamics_of_the_proto_are_those_of_the_model(project: Project, robot: Robot):
    """Mass matrix, gravity and Coriolis forces at random states: MuJoCo built from the PROTO against the robot's."""
    ours = mujoco_scene(read_scene(project.world))
    theirs = mujoco_model(robot)
    put_armature_on_links(theirs, robot)
    rng = np.random.default_rng(0)
    for _ in range(3):
        share = rng.uniform(0.1, 0.9, len(robot.joint_names))
        joints = robot.joint_lower + share * (robot.joint_upper - robot.joint_lower)
        quat = rng.normal(size=4)
        state = np.concatenate([[0.0, 0.0, 5.0], quat / np.linalg.norm(quat), joints]), rng.normal(size=ours.nv)
        found = []
        for model in (ours, theirs):
            data, mass = mujoco.MjData(model), np.zeros((model.nv, model.nv))
            data.qpos[:], data.qvel[:] = state
            mujoco.mj_forward(model, data)
            mujoco.mj_fullM(model, data, mass)
            found.append((mass, data.qfrc_bias.copy(), data.xpos.copy()))
        for got, wanted in zip(*found, strict=True):
            np.testing.assert_allclose(got, wanted, atol=2e-6)


def test_bounding_objects_are_the_collision_shapes(project: Project, robot: Robot):
    """Sizes and places of all primitives against MuJoCo's geoms of the robot's own model."""
    model = mujoco_model(robot)
    scene = read_scene(project.world)
    wanted = {name: [] for name in robot.link_names}
    for geom in range(model.ngeom):
        if model.geom_contype[geom]:
            place = [*model.geom_pos[geom].round(9), *model.geom_size[geom].round(9)]
            wanted[model.body(model.geom_bodyid[geom]).name].append(place)
    for link, body in zip(robot.link_names, scene.bodies, strict=True):
        shapes = [shape for shape in body.shapes if shape.kind != "sphere" or shape.size[0] > 0.002]
        assert len(shapes) == len(wanted[link])
        for shape, place in zip(shapes, wanted[link], strict=True):
            np.testing.assert_allclose(shape.pos, place[:3], atol=1e-8)
            half = np.array(shape.size) / ([2.0] * 3 if shape.kind == "box" else [1.0, 2.0][: len(shape.size)])
            np.testing.assert_allclose(half, place[3 : 3 + len(half)], atol=1e-8)


def test_equal_robots_give_equal_bytes(tmp_path: Path, root: Path, robot: Robot, short_walk: WebotsSettings):
    source, task = read_description(root / "robots" / "t1"), deployment_task(robot)
    envelope = TorqueEnvelope(limit=robot.torque_limit)
    folders = [tmp_path / name for name in ("one", "two")]
    for folder in folders:
        write_project(folder, source, task, envelope, None, short_walk)
    one, two = ({path.relative_to(f): path.read_bytes() for path in f.rglob("*") if path.is_file()} for f in folders)
    assert one == two


def test_the_controller_is_copied_to_the_byte(project: Project):
    for name, source in needed_modules().items():
        assert (project.controller / name).read_bytes() == source.read_bytes()


def test_the_copied_modules_need_numpy_alone(project: Project):
    """Imported where neither the project's checkout nor jaxtyping, scipy, mujoco or torch can be found."""
    code = """
import sys, builtins
real = builtins.__import__
def only(name, *arguments, **named):
    if name.partition('.')[0] in ('scipy', 'mujoco', 'torch', 'pinocchio', 'pandas', 'jaxtyping'):
        if not (name == 'jaxtyping' and 'shims' in sys.path[-1]):
            raise ImportError(name)
    return real(name, *arguments, **named)
import numpy
sys.path[:] = [sys.argv[1]] + [p for p in sys.path if 'site-packages' in p or 'lib/python' in p]
builtins.__import__ = only
sys.path.insert(1, sys.argv[1] + '/shims')
sys.path.append(sys.argv[1] + '/shims')
import booster_lab, pipeline, jaxtyping
assert pipeline.__file__.startswith(sys.argv[1]), pipeline.__file__
assert jaxtyping.__file__.startswith(sys.argv[1]), jaxtyping.__file__
"""
    done = subprocess.run(
        [sys.executable, "-c", code, str(project.controller)], cwd=project.folder, capture_output=True, text=True
    )
    assert done.returncode == 0, done.stderr


def test_the_project_names_no_file_outside(project: Project):
    for path in project.folder.rglob("*"):
        if path.suffix in (".wbt", ".proto"):
            assert "http" not in path.read_text()
            scene = from_text(path.read_text())
            assert all((path.parent / each).is_file() for each in scene.extern)
        if path.suffix == ".py":
            ast.parse(path.read_text())


def test_only_stated_timesteps_are_offered(robot: Robot):
    with pytest.raises(PipelineError, match=r"a basicTimeStep of 32 ms is not supported; choose 1 or 5 ms"):
        robot_world(robot, timestep_ms=32.0, friction=1.0)


@pytest.mark.parametrize(
    ("old", "new", "says"),
    [
        (
            "{name: back, seconds: 6,",
            "{name: back, seconds: 2,",
            r"'segments\[6\].seconds' is 2, allowed is 'measured_s' \(3\)",
        ),
        ("segments:  ", "segments: []  ", "'segments' is empty, allowed is one or more"),
        ("measured_s: 3.0 ", "measured_s: three ", "'measured_s' is 'three', expected float"),
    ],
)
def test_a_walk_whose_means_have_nothing_to_be_of_is_refused(old: str, new: str, says: str, root: Path, tmp_path: Path):
    text = (root / "data" / "webots.yaml").read_text()
    assert old in text
    text = text.replace(old, new)
    (tmp_path / "webots.yaml").write_text(text.partition("  - {")[0] if "[]" in new else text)
    with pytest.raises(SettingsError, match=says):
        read(tmp_path / "webots.yaml", WebotsSettings)


def test_a_policy_goes_and_comes_with_the_project(tmp_path: Path, root: Path, robot: Robot, short_walk: WebotsSettings):
    source, task = read_description(root / "robots" / "t1"), deployment_task(robot)
    envelope = TorqueEnvelope(limit=robot.torque_limit)
    home = write_project(tmp_path, source, task, envelope, still_policy(task), short_walk).controller
    assert (home / "policy.npz").is_file()
    write_project(tmp_path, source, task, envelope, None, short_walk)
    assert not (home / "policy.npz").exists()
