"""The plant against momentum on paper; the loop's timing, events, sensors and falls."""

import dataclasses
from pathlib import Path

import mujoco
import numpy as np
import pytest

from pipeline import rotation
from pipeline.deployment import DeploymentTask, PolicyController, deployment_task
from pipeline.errors import UnknownNameError
from pipeline.robot import Robot
from pipeline.simulation.mujoco_plant import Ball, MujocoOptions, MujocoPlant
from pipeline.simulation.plant import Kick, NoBallError, PlantState, Push, Throw
from pipeline.simulation.record import Rollout
from pipeline.simulation.run import RateError, fall_height, has_fallen, run
from pipeline.simulation.sensors import NoisySensors, PerfectSensors, SensorNoise
from pipeline.simulation.torque_envelope import PdControl, TorqueEnvelope
from tests.factories.policies import linear_policy, still_policy

STILL = np.zeros(3)


def _motors(robot: Robot) -> PdControl:
    return PdControl(kp=robot.kp, kd=robot.kd, envelope=TorqueEnvelope(limit=robot.torque_limit))


def _held(robot: Robot, seconds: float, plant: MujocoPlant | None = None, events=(), **others) -> Rollout:
    task = deployment_task(robot)
    controller = PolicyController(task, still_policy(task))
    plant = plant or MujocoPlant(robot)
    return run(robot, plant, controller, _motors(robot), lambda time_s: STILL, seconds, events, **others)


def _floating(robot: Robot) -> PlantState:
    """High above the ground, upside up."""
    state = MujocoPlant(robot).state()
    return dataclasses.replace(state, root_pos_w=np.array([0.0, 0.0, 20.0]))


def _momentum(plant: MujocoPlant) -> np.ndarray:
    mujoco.mj_forward(plant.model, plant.data)
    mujoco.mj_subtreeVel(plant.model, plant.data)
    return plant.data.subtree_linvel[1] * plant.model.body_subtreemass[1]


def test_a_push_in_free_fall_gives_its_impulse_and_gravity_its_own(robot: Robot):
    plant = MujocoPlant(robot)
    push = Push(start_s=0.04, duration_s=0.1, force_w=np.array([200.0, -100.0, 0.0]))
    _held(robot, 0.3, plant, (push,), start=_floating(robot))
    weight = robot.total_mass * 9.81
    np.testing.assert_allclose(_momentum(plant), [20.0, -10.0, -0.3 * weight], atol=0.02)


def test_two_pushes_at_once_add_up(robot: Robot):
    plant = MujocoPlant(robot)
    pushes = tuple(Push(start_s=0.0, duration_s=0.1, force_w=np.array([100.0, 0.0, 0.0])) for _ in range(2))
    _held(robot, 0.2, plant, pushes, start=_floating(robot))
    assert _momentum(plant)[0] == pytest.approx(20.0, abs=0.02)


def test_a_kick_moves_every_link_alike(robot: Robot):
    plant = MujocoPlant(robot)
    kick = Kick(start_s=0.02, delta_v_w=np.array([0.0, 1.5, 0.0]))
    _held(robot, 0.2, plant, (kick,), start=_floating(robot))
    assert _momentum(plant)[1] == pytest.approx(1.5 * robot.total_mass, rel=1e-3)


def test_what_the_ball_loses_the_robot_gets(robot: Robot):
    plant = MujocoPlant(robot, MujocoOptions(ball=Ball(mass=10.0, radius=0.12)))
    throw = Throw(start_s=0.1, direction_w=np.array([1.0, 0.0, 0.0]), speed=5.0, duration_s=1.0)
    _held(robot, 0.4, plant, (throw,), start=_floating(robot))
    gained = _momentum(plant)[0]
    assert gained > 20.0
    assert gained == pytest.approx(10.0 * (5.0 - plant.data.qvel[-6]), abs=0.1)


def test_the_ball_is_taken_away_and_touches_nothing_before(robot: Robot):
    with_ball = MujocoPlant(robot, MujocoOptions(ball=Ball(mass=10.0, radius=0.12)))
    throw = Throw(start_s=0.4, direction_w=np.array([0.0, 1.0, 0.0]), speed=3.0, duration_s=0.1)
    hit = _held(robot, 0.6, with_ball, (throw,))
    plain = _held(robot, 0.6)
    # another solver size, other last digits
    np.testing.assert_allclose(hit.qpos[:200], plain.qpos[:200], atol=1e-6)
    np.testing.assert_array_equal(with_ball.data.qvel[-6:-3], 0.0)


@pytest.mark.parametrize("stop", [True, False])
def test_a_simulation_that_diverges_has_fallen_and_does_not_stand_up_again(
    robot: Robot, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, stop: bool
):
    """MuJoCo would put the robot back into its default pose, in which nothing it is then asked makes it fall."""
    monkeypatch.chdir(tmp_path)  # MuJoCo writes its warnings to the working directory
    task = deployment_task(robot)
    bias = np.full(len(task.policy_joints), np.nan)
    policy = linear_policy(np.zeros((len(bias), task.observation_size)), bias)
    plant, controller = MujocoPlant(robot), PolicyController(task, policy)
    found = run(robot, plant, controller, _motors(robot), lambda time_s: STILL, 0.5, stop_on_fall=stop)
    assert found.fell_s == pytest.approx(0.02)
    assert len(found.command) == 1


def test_a_ball_is_only_thrown_where_there_is_one(robot: Robot):
    throw = Throw(start_s=0.0, direction_w=np.array([1.0, 0.0, 0.0]), speed=1.0, duration_s=0.1)
    with pytest.raises(NoBallError, match="MujocoPlant has no ball"):
        _held(robot, 0.1, MujocoPlant(robot), (throw,))


def test_standing_the_ground_carries_the_weight_under_both_feet(robot: Robot):
    stood = _held(robot, 0.6, wrench_every=5)
    assert stood.fell_s is None
    vertical = stood.foot_wrench_w[100:, :, 2]
    # the centre of mass moves down by little: what the ground gives is the weight
    sinking = (stood.qvel[-1, 2] - stood.qvel[100, 2]) / (0.002 * 200) * robot.total_mass
    assert vertical.sum(axis=1).mean() == pytest.approx(robot.total_mass * 9.81 + sinking, rel=0.02)
    np.testing.assert_allclose(vertical[:, 0].mean(), vertical[:, 1].mean(), rtol=0.02)
    assert stood.contacts()[100:].all()


def test_a_plant_used_before_gives_the_same_bits(robot: Robot):
    plant = MujocoPlant(robot)
    push = Push(start_s=0.1, duration_s=0.1, force_w=np.array([0.0, 300.0, 0.0]))
    first = _held(robot, 0.4, plant, (push,))
    again = _held(robot, 0.4, plant, (push,))
    fresh = _held(robot, 0.4, MujocoPlant(robot), (push,))
    for other in (again, fresh):
        np.testing.assert_array_equal(first.qpos, other.qpos)
        np.testing.assert_array_equal(first.foot_wrench_w, other.foot_wrench_w)


def test_the_record_has_the_state_that_each_torque_acts_at(robot: Robot):
    stood = _held(robot, 0.2)
    motors = _motors(robot)
    for step in (0, 7, 55):
        expected = motors.torque(stood.target[step // 10], stood.qpos[step, 7:], stood.qvel[step, 6:])
        np.testing.assert_array_equal(stood.torque[step], expected)
    assert stood.control_steps == 10
    assert len(stood.command) == len(stood.target) == 10
    assert stood.qacc is not None
    # Euler with no joint damping: the next velocity is this one plus acceleration times the step
    np.testing.assert_allclose(stood.qvel[1:, 6:], (stood.qvel + 0.002 * stood.qacc)[:-1, 6:], atol=1e-9)


def test_a_delay_shifts_targets_by_its_timesteps(robot: Robot):
    task = deployment_task(robot)
    policy = linear_policy(np.zeros((21, 720)), np.full(21, 0.2))
    motors = _motors(robot)
    late = run(
        robot,
        MujocoPlant(robot),
        PolicyController(task, policy),
        motors,
        lambda time_s: STILL,
        0.1,
        delay_s=0.014,
    )
    for step, target in ((6, task.default_joint_pos), (7, late.target[0])):
        expected = motors.torque(target, late.qpos[step, 7:], late.qvel[step, 6:])
        np.testing.assert_array_equal(late.torque[step], expected)


class _Told:
    """A controller that remembers what it was told."""

    def __init__(self, task: DeploymentTask):
        self.task, self.told = task, []

    def reset(self) -> None:
        self.told = []

    def targets(self, reading, command) -> np.ndarray:
        self.told.append((reading, command))
        return self.task.default_joint_pos.copy()


def test_the_controller_is_told_gyro_and_gravity_in_the_robots_frame(robot: Robot):
    quat = rotation.multiply(rotation.about_z(2.0), rotation.from_rotvec(np.array([0.0, 0.3, 0.0])))
    start = dataclasses.replace(
        _floating(robot), root_quat_w=quat, root_ang_vel_b=np.array([0.1, 0.2, 0.3]), joint_vel=np.arange(23.0) / 100.0
    )
    told = _Told(deployment_task(robot))
    run(robot, MujocoPlant(robot), told, _motors(robot), lambda time_s: np.array([time_s, 0.0, 0.0]), 0.06, start=start)
    reading, _ = told.told[0]
    np.testing.assert_allclose(reading.gyro_b, [0.1, 0.2, 0.3])
    np.testing.assert_allclose(reading.gravity_b, [np.sin(0.3), 0.0, -np.cos(0.3)], atol=1e-12)
    np.testing.assert_allclose(reading.joint_pos, robot.default_joint_pos)
    np.testing.assert_allclose(reading.joint_vel, np.arange(23.0) / 100.0)
    np.testing.assert_allclose([command[0] for _, command in told.told], [0.0, 0.02, 0.04])


def test_noise_stays_in_its_width_and_comes_from_its_generator(robot: Robot):
    state = MujocoPlant(robot).state()
    noise = SensorNoise(gyro=0.1, gravity=0.02, joint_pos=0.01, joint_vel=0.5)
    true = PerfectSensors().read(state)
    one, same = (NoisySensors(noise, np.random.default_rng(4)).read(state) for _ in range(2))
    for name, width in vars(noise).items():
        field = {"gyro": "gyro_b", "gravity": "gravity_b"}.get(name, name)
        away = np.abs(getattr(one, field) - getattr(true, field))
        assert 0.0 < away.max() <= width
        np.testing.assert_array_equal(getattr(one, field), getattr(same, field))


def test_a_fall_is_a_low_or_a_tilted_trunk_over_its_ground(robot: Robot):
    upright = MujocoPlant(robot).state()

    def fallen(height: float, tilt_deg: float, ground: float = 0.0) -> bool:
        quat = rotation.from_rotvec(np.array([np.radians(tilt_deg), 0.0, 0.0]))
        state = dataclasses.replace(upright, root_pos_w=np.array([1.0, 2.0, height]), root_quat_w=quat)
        return has_fallen(state, fall_height(robot), lambda x, y: ground)

    assert not fallen(0.46, 0.0)
    assert fallen(0.44, 0.0)
    assert not fallen(0.7, 59.0)
    assert fallen(0.7, 61.0)
    assert fallen(0.7, 0.0, ground=0.3)
    assert not fallen(0.4, 0.0, ground=-0.3)


def test_a_fallen_robot_ends_the_run_where_asked(robot: Robot):
    push = Push(start_s=0.1, duration_s=0.1, force_w=np.array([900.0, 0.0, 0.0]))
    whole = _held(robot, 1.6, events=(push,))
    cut = _held(robot, 1.6, events=(push,), stop_on_fall=True)
    assert whole.fell_s is not None
    assert cut.fell_s == whole.fell_s
    assert len(whole.qpos) == 800
    assert len(cut.qpos) == round(whole.fell_s / 0.002)
    np.testing.assert_array_equal(cut.qpos, whole.qpos[: len(cut.qpos)])


def test_options_reach_the_model(robot: Robot):
    armature = np.linspace(0.01, 0.1, 23)
    options = MujocoOptions(timestep_s=0.004, friction=0.3, armature=armature, root_mass_factor=1.2)
    model = MujocoPlant(robot, options).model
    nominal = MujocoPlant(robot).model
    assert model.opt.timestep == 0.004
    np.testing.assert_array_equal(model.dof_armature[6:], armature)
    np.testing.assert_array_equal(model.geom_friction[:, 0], 0.3)
    assert model.body_mass[1] == pytest.approx(1.2 * nominal.body_mass[1])
    assert model.body_subtreemass[1] == pytest.approx(robot.total_mass + 0.2 * nominal.body_mass[1])
    with pytest.raises(UnknownNameError, match="unknown integrator 'leapfrog'"):
        MujocoPlant(robot, MujocoOptions(integrator="leapfrog"))


def test_a_timestep_that_does_not_fit_is_refused(robot: Robot):
    with pytest.raises(RateError, match=r"0\.003 s does not divide"):
        _held(robot, 0.1, MujocoPlant(robot, MujocoOptions(timestep_s=0.003)))
