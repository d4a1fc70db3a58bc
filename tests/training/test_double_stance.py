"""How long both feet are on the ground: in the clips, of simulated robots, and what is paid for it."""

from __future__ import annotations

import dataclasses
from types import SimpleNamespace
from typing import cast

import mujoco
import numpy as np
import pytest
import torch
from scipy.optimize import brentq

from pipeline.learning.training_error import TrainingError
from pipeline.training import reward_terms as terms
from pipeline.training.bundle import Bundle, read_bundle
from pipeline.training.double_stance import DoubleStance, feet_down
from pipeline.training.environment import AmpEnvironment
from pipeline.training.plain_walk import Walk, walked
from pipeline.training.presets import preset
from pipeline.training.readings import Readings
from pipeline.training.reward_table import table
from tests.factories.expert_frames import expert_of
from tests.factories.training_bundle import small_bundle

BOTH, LEFT, RIGHT = (True, True), (True, False), (False, True)
LEG = {"Hip_Pitch": -1.0, "Knee_Pitch": 2.0, "Ankle_Pitch": -1.0}
"""By how much the joints of a leg turn as it is drawn up with a level sole."""


@pytest.fixture(scope="module")
def bundle(tmp_path_factory, root, robot) -> Bundle:
    return read_bundle(small_bundle(tmp_path_factory.mktemp("double_stance"), root, robot))


class Poses:
    """Frames of the robot with its left leg drawn up and its left ankle turned, and how high its left sole is."""

    def __init__(self, bundle: Bundle):
        self.robot = bundle.robot
        self._model = mujoco.MjModel.from_xml_string(bundle.robot.mjcf)
        self._data = mujoco.MjData(self._model)

    def frame(self, drawn_rad: float, ankle_rad: float = 0.0) -> np.ndarray:
        joints = self.robot.default_joint_pos[self.robot.index(self.robot.controlled)].copy()
        for name, share in LEG.items():
            joints[self.robot.controlled.index(f"Left_{name}")] += share * drawn_rad
        joints[self.robot.controlled.index("Left_Ankle_Pitch")] += ankle_rad
        frame = np.zeros(37 + 2 * len(joints), dtype=np.float32)
        frame[2], frame[3], frame[7 : 7 + len(joints)] = self.robot.default_root_height, 1.0, joints
        return frame

    def heights_m(self, frame: np.ndarray) -> tuple[float, float]:
        """Of the left sole's middle, and of the lowest point of its foot's box."""
        model, data = self._model, self._data
        data.qpos[:7] = frame[:7]
        for at, name in enumerate(self.robot.controlled):
            data.qpos[model.joint(name).qposadr[0]] = frame[7 + at]
        mujoco.mj_forward(model, data)
        site = model.site(self.robot.feet[0])
        (box,) = (
            model.geom(name).id for name in self.robot.shapes["feet"] if model.geom(name).bodyid[0] == site.bodyid[0]
        )
        reach = np.abs(data.geom_xmat[box].reshape(3, 3)[2]) @ model.geom_size[box]
        return float(data.site_xpos[site.id, 2]), float(data.geom_xpos[box, 2] - reach)


def _clip(frames: list[np.ndarray], speed: float) -> tuple[np.ndarray, np.ndarray]:
    return np.array(frames), np.tile(np.array([speed, 0.0, 0.0], dtype=np.float32), (len(frames), 1))


def test_a_foot_that_is_drawn_up_is_off_the_ground_and_the_other_is_not(bundle: Bundle):
    poses = Poses(bundle)
    frames = [*[poses.frame(0.0)] * 60, *[poses.frame(0.3)] * 40]
    down = feet_down(expert_of(_clip(frames, 0.6)), bundle.robot)
    assert down[:60].all()
    assert not down[60:, 0].any() and down[60:, 1].all()


def test_a_foot_on_its_toes_or_heel_is_on_the_ground_however_high_its_middle_is(bundle: Bundle):
    poses = Poses(bundle)
    rest_m = poses.heights_m(poses.frame(0.0))[1]
    for ankle_rad in (0.35, -0.35):
        drawn = cast(float, brentq(lambda rad, a=ankle_rad: poses.heights_m(poses.frame(rad, a))[1] - rest_m, 0.0, 0.9))
        tilted = poses.frame(drawn, ankle_rad)
        assert poses.heights_m(tilted)[0] > poses.heights_m(poses.frame(0.0))[0] + 0.02
        assert feet_down(expert_of(_clip([poses.frame(0.0)] * 60 + [tilted] * 40, 0.6)), bundle.robot).all()


def test_a_foot_of_two_shapes_or_of_another_kind_is_named(bundle: Bundle):
    shapes = bundle.robot.shapes
    for feet in ([*shapes["feet"], shapes["feet"][0]], shapes["feet"][1:]):
        robot = dataclasses.replace(bundle.robot, shapes=shapes | {"feet": feet})
        with pytest.raises(TrainingError, match=r"the foot of .* is no box, or has [02] shapes"):
            feet_down(expert_of(_clip([Poses(bundle).frame(0.0)], 0.6)), robot)


def test_a_command_is_answered_by_the_share_of_the_nearest_clips(bundle: Bundle):
    poses = Poses(bundle)
    slow = _clip([*[poses.frame(0.0)] * 60, *[poses.frame(0.3)] * 40], 0.6)
    fast = _clip([*[poses.frame(0.0)] * 20, *[poses.frame(0.3)] * 80], 1.8)
    share = DoubleStance(expert_of(slow, fast), bundle.robot, "cpu")
    assert share(torch.tensor([[0.5, 0.1, 0.0], [2.0, 0.0, 0.0]])).tolist() == pytest.approx([0.6, 0.2])


def _doubles_of(touching: list[tuple[bool, bool]]) -> list[tuple[float, float]]:
    """The time of each step, and how long both feet were down in it [s]."""
    read, count = Readings.__new__(Readings), 1
    read._env, read._known = SimpleNamespace(step_dt=0.02), {}
    read._stance, read._stood = torch.zeros(count, 2), torch.ones(count, 2, dtype=torch.bool)
    read._landed, read._set_down = torch.zeros(count, 2, dtype=torch.bool), torch.full((count,), -1)
    read._since, read._step, read._both, read._double = (torch.zeros(count) for _ in range(4))
    found = []
    for feet in touching:
        read._advance_stances(torch.tensor([feet]), torch.tensor([True]))
        if read.step_s[0] > 0.0:
            found.append((round(float(read.step_s[0]), 3), round(float(read.double_s[0]), 3)))
        else:
            assert read.double_s[0] == 0.0
    return found


def test_of_a_step_the_time_on_both_feet_is_from_the_landing_to_the_lift():
    walk = [BOTH, *[RIGHT] * 10, *[BOTH] * 4, *[LEFT] * 10, *[BOTH] * 8, *[RIGHT] * 6, BOTH]
    assert _doubles_of(walk) == [(0.28, 0.08), (0.28, 0.16)]


def test_on_one_foot_throughout_there_is_none():
    assert _doubles_of([BOTH, *[RIGHT] * 10, *[LEFT] * 10, *[RIGHT] * 10, LEFT]) == [(0.2, 0.0), (0.2, 0.0)]


def test_what_share_of_the_clips_is_paid():
    step_s, share = torch.full((5,), 0.5), torch.full((5,), 0.5)
    double_s = torch.tensor([0.0, 0.075, 0.15, 0.3, 0.5])
    assert terms.double_stance(double_s, step_s, share).tolist() == pytest.approx([0.0, 0.5, 1.0, 1.0, 1.0])
    assert terms.double_stance(torch.zeros(2), torch.zeros(2), torch.zeros(2)).tolist() == [0.0, 0.0]


@pytest.mark.parametrize(("sigma2", "followed"), [(0.0, 1.0), (0.25, np.exp(-0.01 / 0.25))])
def test_what_a_long_step_is_paid_is_paid_by_its_share_on_both_feet(sigma2: float, followed: float):
    asked = {"long_step_share": 0.5, "long_step_full": 1.0, "long_step_sigma2": sigma2}
    options = preset("paper_flat").changed(double_stance=2.0, **asked)
    (row,) = (row for row in table(options) if row.name == "double_stance")
    command = torch.tensor([[1.0, 0.0, 0.0]] * 2 + [[0.0, 0.0, 0.0]] + [[1.0, 0.0, 0.0]] * 2)
    env = SimpleNamespace(
        command=command,
        step_dt=0.02,
        step_times=lambda command: torch.full((5,), 0.4),
        clip_double_stance=lambda command: torch.full((5,), 0.5),
        readings=SimpleNamespace(
            step_s=torch.tensor([0.4, 0.9, 0.4, 0.2, 0.3]),
            double_s=torch.tensor([0.06, 0.5, 0.06, 0.2, 0.3]),
            mean_velocity=command + torch.tensor([0.1, 0.0, 0.0]),
        ),
    )
    expected = np.array([0.4 * 0.5, 0.6, 0.0, 0.0, 0.3 * 0.5])
    assert row.weight * row.value(env) == pytest.approx(2.0 * expected / 0.02 * followed, rel=1e-5)


def test_in_training_it_is_told_where_steps_end(bundle: Bundle):
    env = AmpEnvironment(bundle, preset("long_steps").changed(double_stance=2.0), 6, "cpu", seed=1)
    env.reset()
    generator, seen = torch.Generator().manual_seed(1), 0
    for _ in range(60):
        with torch.no_grad():
            env.step(torch.randn(6, 21, generator=generator))
        read = env.readings
        assert (read.double_s <= read.step_s + 1e-6).all()
        seen += int((read.step_s > 0.0).sum())
    assert seen > 0
    assert AmpEnvironment(bundle, preset("long_steps"), 1, "cpu", seed=1).clip_double_stance is None


def test_a_sweep_tells_how_long_both_feet_touch(tmp_path, root, robot):
    folder = small_bundle(tmp_path, root, robot)
    path = root / "robots" / "t1" / "policies" / "walk" / "policy.npz"
    stands, walks = (walked(folder, path, "any", Walk(cell="", command=(vx, 0.0, 0.0))) for vx in (0.0, 1.0))
    assert stands["double_stance"] == 1.0
    assert 0.0 < walks["double_stance"] < 0.5
