"""The plant in DART: its model against MuJoCo's, its state, forces and pushes, and the published standing figures."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import mujoco
import numpy as np
import pytest

from pipeline import rotation
from pipeline.actuators.standing import read_standing_pose
from pipeline.dart.plant import DartPlant
from pipeline.robot import Kinematics, Robot, mujoco_model
from pipeline.simulation.mujoco_plant import added_moments, put_armature_on_links
from pipeline.simulation.plant import PlantState, standing_state
from pipeline.simulation.torque_envelope import PdControl, TorqueEnvelope


@pytest.fixture(scope="module")
def plant(robot: Robot) -> DartPlant:
    return DartPlant(robot)


def any_state(robot: Robot, seed: int, height: float = 3.0) -> PlantState:
    """A random state above the ground, within the joint limits."""
    rng = np.random.default_rng(seed)
    share = rng.uniform(0.2, 0.8, len(robot.joint_names))
    return PlantState(
        root_pos_w=np.array([*rng.uniform(-2.0, 2.0, 2), height]),
        root_quat_w=rotation.normalize(rng.normal(size=4)),
        root_lin_vel_w=rng.normal(size=3),
        root_ang_vel_b=rng.normal(size=3),
        joint_pos=robot.joint_lower + share * (robot.joint_upper - robot.joint_lower),
        joint_vel=rng.normal(size=len(robot.joint_names)),
    )


def bridge_data(robot: Robot, state: PlantState) -> tuple[mujoco.MjModel, mujoco.MjData]:
    """MuJoCo in that state, the armature on the links."""
    model = mujoco_model(robot)
    put_armature_on_links(model, robot)
    data = mujoco.MjData(model)
    data.qpos[:] = np.concatenate([state.root_pos_w, state.root_quat_w, state.joint_pos])
    data.qvel[:] = np.concatenate([state.root_lin_vel_w, state.root_ang_vel_b, state.joint_vel])
    mujoco.mj_forward(model, data)
    return model, data


def same_rotation(a: np.ndarray, b: np.ndarray) -> bool:
    return bool(rotation.angle_between(a, b) < 1e-9)


@pytest.mark.parametrize("seed", range(4))
def test_a_state_that_was_set_is_read_back(robot: Robot, plant: DartPlant, seed: int):
    state = any_state(robot, seed)
    plant.reset(state)
    read = plant.state()
    assert same_rotation(read.root_quat_w, state.root_quat_w)
    for name in ("root_pos_w", "root_lin_vel_w", "root_ang_vel_b", "joint_pos", "joint_vel"):
        np.testing.assert_allclose(getattr(read, name), getattr(state, name), atol=1e-12, err_msg=name)


@pytest.mark.parametrize("seed", range(3))
def test_one_step_in_the_air_is_that_of_the_bridge_in_mujoco(robot: Robot, seed: int):
    """Free flight with random torques and a force: no contact and no solver, the models alone are compared."""
    state = any_state(robot, seed)
    rng = np.random.default_rng(100 + seed)
    torque, force_w = rng.uniform(-5.0, 5.0, len(robot.joint_names)), rng.uniform(-50.0, 50.0, 3)
    dt = 1e-6
    plant = DartPlant(robot, timestep_s=dt)
    plant.reset(state)
    plant.step(torque, force_w)
    after = plant.state()
    model, data = bridge_data(robot, state)
    model.opt.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_CONTACT)
    data.qfrc_applied[6:], data.xfrc_applied[1, :3] = torque, force_w
    mujoco.mj_forward(model, data)
    np.testing.assert_allclose((after.joint_vel - state.joint_vel) / dt, data.qacc[6:], rtol=1e-3, atol=2e-2)
    np.testing.assert_allclose((after.root_lin_vel_w - state.root_lin_vel_w) / dt, data.qacc[:3], rtol=1e-3, atol=1e-2)


def test_links_carry_the_rotors_and_weigh_the_same(robot: Robot):
    model = mujoco_model(robot)
    before = model.body_mass.copy()
    own = {name: _inertia(model, name) for name in robot.link_names}
    put_armature_on_links(model, robot)
    np.testing.assert_array_equal(model.body_mass, before)
    assert not model.dof_armature.any()
    for name, moment in added_moments(robot).items():
        np.testing.assert_allclose(_inertia(model, name), own[name] + moment, atol=1e-12)
        assert np.trace(moment) == pytest.approx(robot.armature[_joint_of(robot, name)])


def test_the_armature_on_the_links_gives_the_joint_the_same_inertia(robot: Robot):
    """With all parents at rest: the diagonal of the mass matrix at a joint is the same as with an armature."""
    state = any_state(robot, 7)
    _, bridge = bridge_data(robot, state)
    model = mujoco_model(robot)
    data = mujoco.MjData(model)
    data.qpos[:] = bridge.qpos
    mujoco.mj_forward(model, data)
    theirs, ours = np.zeros((model.nv, model.nv)), np.zeros((model.nv, model.nv))
    mujoco.mj_fullM(model, data, theirs)
    mujoco.mj_fullM(model, bridge, ours)
    last = [robot.joint(name) for name in ("Left_Ankle_Roll", "Right_Elbow_Yaw", "Head_pitch")]
    for joint in last:
        assert ours[6 + joint, 6 + joint] == pytest.approx(theirs[6 + joint, 6 + joint], rel=1e-9)


def test_the_robot_stands_as_published(root: Path, robot: Robot, plant: DartPlant):
    """Prepare pose and gains, 10 s: height .6854 m, tilt .20 degree, the ground carries the weight of 311 N."""
    stood, wrench = _stand(root, robot, plant, seconds=10.0)
    assert stood.root_pos_w[2] == pytest.approx(0.6854, abs=5e-4)
    tilt = np.degrees(np.arccos(1.0 - 2.0 * (stood.root_quat_w[1] ** 2 + stood.root_quat_w[2] ** 2)))
    assert tilt == pytest.approx(0.20, abs=0.02)
    assert wrench[:, 2].sum() == pytest.approx(robot.total_mass * 9.81, rel=1e-3)
    left, right = wrench
    assert left[2] == pytest.approx(right[2], rel=0.01)


def test_the_robot_falls_without_its_armature(root: Path, robot: Robot):
    """An explicit controller needs the rotors' inertia: without it the stiff gains shake the robot down."""
    bare = dataclasses.replace(robot, armature=np.zeros_like(robot.armature))
    stood, _ = _stand(root, bare, DartPlant(bare), seconds=3.0)
    assert not stood.root_pos_w[2] > 0.6


def test_the_moment_of_a_foot_is_about_its_link(root: Path, robot: Robot, plant: DartPlant):
    """Standing still: force and moment of a foot put the centre of pressure inside the sole."""
    stood, wrench = _stand(root, robot, plant, seconds=3.0)
    poses = Kinematics(robot).forward(stood.root_pos_w[None], stood.root_quat_w[None], stood.joint_pos[None])
    for side, corners in enumerate(robot.sole_corners):
        origin = poses.pos_w[0, robot.tree.site_link[robot.site(robot.feet[side])]]
        pressure = origin[:2] + np.array([-wrench[side, 4], wrench[side, 3]]) / wrench[side, 2]
        sole = Kinematics(robot).site_pos_w(poses, corners)[0, :, :2]
        assert (sole.min(axis=0) < pressure).all() and (pressure < sole.max(axis=0)).all()


def test_a_push_moves_the_centre_of_mass_by_its_impulse(robot: Robot):
    plant = DartPlant(robot, timestep_s=0.001)
    start = PlantState(
        root_pos_w=np.array([0.0, 0.0, 3.0]),
        root_quat_w=rotation.IDENTITY.copy(),
        root_lin_vel_w=np.zeros(3),
        root_ang_vel_b=np.zeros(3),
        joint_pos=robot.default_joint_pos.copy(),
        joint_vel=np.zeros(len(robot.joint_names)),
    )
    plant.reset(start)
    for _ in range(100):
        plant.step(np.zeros(len(robot.joint_names)), np.array([30.0, -20.0, 0.0]))
    model, data = bridge_data(robot, plant.state())
    mujoco.mj_subtreeVel(model, data)
    momentum = robot.total_mass * data.subtree_linvel[1]
    np.testing.assert_allclose(momentum, [3.0, -2.0, -robot.total_mass * 9.81 * 0.1], atol=0.02)


def test_a_kick_changes_the_velocity_of_all_links_and_nothing_else(robot: Robot, plant: DartPlant):
    state = any_state(robot, 3)
    plant.reset(state)
    plant.kick(np.array([0.4, -0.3, 0.1]))
    after = plant.state()
    np.testing.assert_allclose(after.root_lin_vel_w - state.root_lin_vel_w, [0.4, -0.3, 0.1], atol=1e-12)
    np.testing.assert_allclose(after.root_ang_vel_b, state.root_ang_vel_b, atol=1e-12)
    np.testing.assert_allclose(after.joint_vel, state.joint_vel, atol=1e-12)


@pytest.mark.parametrize("friction", [0.3, 1.4])
def test_feet_that_slide_are_braked_by_the_friction_that_was_asked(robot: Robot, friction: float):
    """Dantzig's method takes the size of the friction pyramid from the normal forces without friction."""

    def braked(friction: float) -> np.ndarray:
        plant, torque = DartPlant(robot, timestep_s=0.001, friction=friction), np.zeros(len(robot.joint_names))
        plant.reset()
        for _ in range(20):
            plant.step(torque)
        plant.kick(np.array([3.0, 0.0, 0.0]))
        plant.step(torque)
        return plant.foot_wrench_w()[:, :3].sum(axis=0)

    smooth = braked(1e-9)
    assert smooth[2] > 0.4 * robot.total_mass * 9.81 and abs(smooth[0]) < 1e-3
    assert -braked(friction)[0] == pytest.approx(friction * smooth[2], rel=0.03)


def test_feet_do_not_bounce(robot: Robot):
    plant, start = DartPlant(robot, timestep_s=0.001), standing_state(robot)
    dropped = start.root_pos_w + np.array([0.0, 0.0, 0.02])
    plant.reset(dataclasses.replace(start, root_pos_w=dropped, root_lin_vel_w=np.array([0.0, 0.0, -1.5])))
    feet = [robot.tree.site_link[robot.site(name)] for name in robot.feet]
    height = []
    for _ in range(60):
        plant.step(np.zeros(len(robot.joint_names)))
        state = plant.state()
        poses = Kinematics(robot).forward(state.root_pos_w[None], state.root_quat_w[None], state.joint_pos[None])
        height.append(poses.pos_w[0, feet, 2])
    speed = np.diff(height, axis=0) / plant.timestep_s
    assert speed.min() < -1.4, "it falls on them"
    assert speed.max() < 0.05


@pytest.mark.parametrize("seed", range(6))
def test_links_that_touch_are_those_that_touch_in_mujoco(robot: Robot, seed: int):
    """Poses at the ends of the joints' ranges; pairs that overlap by less than a millimetre may be told either way."""
    drawn = any_state(robot, seed)
    ends = np.random.default_rng(seed).integers(0, 2, len(robot.joint_names)).astype(bool)
    joint_pos = np.where(ends, robot.joint_lower, robot.joint_upper)
    state = dataclasses.replace(drawn, joint_pos=joint_pos, joint_vel=np.zeros_like(joint_pos))
    plant = DartPlant(robot, timestep_s=1e-6)
    plant.reset(state)
    plant.step(np.zeros(len(robot.joint_names)))
    bodies = [plant._skeleton.getBodyNode(name) for name in robot.link_names]
    link_of = {
        body.getShapeNode(index).getName(): body.getName()
        for body in bodies
        for index in range(body.getNumShapeNodes())
    }
    result = plant._world.getLastCollisionResult()
    contacts = [result.getContact(index) for index in range(result.getNumContacts())]
    pairs = [(each.collisionObject1, each.collisionObject2) for each in contacts]
    found = {frozenset(link_of[one.getShapeFrame().getName()] for one in pair) for pair in pairs}
    model, data = bridge_data(robot, state)
    deep, touching = set(), set()
    for contact in data.contact:
        pair = frozenset(model.body(model.geom_bodyid[geom]).name for geom in contact.geom)
        touching.add(pair)
        if contact.dist < -0.001:
            deep.add(pair)
    assert deep <= found <= touching


def test_a_reset_gives_the_same_bits_again(robot: Robot):
    def walk(plant: DartPlant) -> np.ndarray:
        plant.reset()
        rng = np.random.default_rng(0)
        for _ in range(60):
            plant.step(rng.uniform(-2.0, 2.0, len(robot.joint_names)))
        state = plant.state()
        return np.concatenate([state.root_pos_w, state.root_quat_w, state.joint_pos, state.joint_vel])

    used = DartPlant(robot)
    first = walk(used)
    np.testing.assert_array_equal(walk(used), first)
    np.testing.assert_array_equal(walk(DartPlant(robot)), first)


def test_joints_stop_at_their_limits(robot: Robot):
    plant = DartPlant(robot, timestep_s=0.001)
    plant.reset(any_state(robot, 5, height=30.0))
    knee = robot.joint("Left_Knee_Pitch")
    torque = np.zeros(len(robot.joint_names))
    torque[knee] = -10.0
    for _ in range(600):
        plant.step(torque)
    assert plant.state().joint_pos[knee] == pytest.approx(robot.joint_lower[knee], abs=0.01)


def _stand(root: Path, robot: Robot, plant: DartPlant, seconds: float) -> tuple[PlantState, np.ndarray]:
    """Hold the manufacturer's standing pose; the last state and the forces on the feet."""
    pose = read_standing_pose(root / "robots" / "t1", robot)
    assert pose is not None
    poses = Kinematics(robot).forward(np.zeros((1, 3)), rotation.IDENTITY[None], pose.joint_pos[None])
    corners = [corner for foot in robot.sole_corners for corner in foot]
    height = -float(Kinematics(robot).site_pos_w(poses, corners)[..., 2].min())
    plant.reset(
        PlantState(
            root_pos_w=np.array([0.0, 0.0, height]),
            root_quat_w=rotation.IDENTITY.copy(),
            root_lin_vel_w=np.zeros(3),
            root_ang_vel_b=np.zeros(3),
            joint_pos=pose.joint_pos,
            joint_vel=np.zeros(len(robot.joint_names)),
        )
    )
    motors = PdControl(kp=pose.kp, kd=pose.kd, envelope=TorqueEnvelope(limit=robot.torque_limit))
    for _ in range(round(seconds / plant.timestep_s)):
        state = plant.state()
        if not state.root_pos_w[2] > 0.3:
            break
        plant.step(motors.torque(pose.joint_pos, state.joint_pos, state.joint_vel))
    return plant.state(), plant.foot_wrench_w()


def _inertia(model: mujoco.MjModel, name: str) -> np.ndarray:
    """Inertia of a body about its centre of mass in the axes of its link."""
    body = model.body(name)
    turn = rotation.to_matrix(np.array(body.iquat))
    return turn @ np.diag(body.inertia) @ turn.T


def _joint_of(robot: Robot, link: str) -> int:
    return int(robot.tree.joint[robot.link(link)])
