"""Episodes that track a clip: nearness in closed form, the clip's time, who strays, and how a policy is led."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest
import torch

from pipeline.training.bundle import ExpertFrames, read_bundle
from pipeline.training.environment import AmpEnvironment
from pipeline.training.motion_features import up_b
from pipeline.training.observations import critic_frame
from pipeline.training.options import Options
from pipeline.training.presets import preset
from pipeline.training.ramps import Ramps
from pipeline.training.tracked_clip import AGAIN, EACH, END_STRAY, TrackedClip, each_near, nearness
from tests.factories.training_bundle import small_bundle

JOINTS = 21
PERIOD = 60
UP = torch.tensor([[0.0, 0.0, 1.0]])
HEIGHT = torch.tensor([0.6])
BOUND_M = END_STRAY[0] + 1.5 * END_STRAY[1]
"""At the clips' speed here."""


@pytest.fixture(autouse=True)
def drawn_alike() -> None:
    """What a test draws does not depend on which were before it."""
    torch.manual_seed(4)


@pytest.fixture(scope="module")
def expert() -> ExpertFrames:
    """Two clips of 120 frames whose joints and ends go round in 60 frames, upright .6 m up."""
    angle = 2.0 * np.pi * np.arange(240) / PERIOD
    frames = np.zeros((240, 37 + 2 * JOINTS), dtype=np.float32)
    frames[:, 2], frames[:, 3] = 0.6, 1.0
    frames[:, 7 : 7 + JOINTS] = 0.4 * np.sin(angle[:, None] + np.arange(JOINTS))
    frames[:, 7 + JOINTS : 19 + JOINTS] = 0.1 * np.cos(angle[:, None] + np.arange(12))
    return ExpertFrames(
        frames=frames,
        command=np.full((240, 3), [0.9, 1.2, 1.0], dtype=np.float32),
        clip_start=np.array([0, 120, 240]),
        clip_weight=np.ones(2),
    )


def tracked(expert: ExpertFrames, begin: int, **asked: Any) -> TrackedClip:
    """One robot that begins at a frame and tracks its clip."""
    env = SimpleNamespace(
        context=SimpleNamespace(bundle=SimpleNamespace(expert=expert), options=Options(**asked)),
        device="cpu",
        num_envs=1,
    )
    clip, yes = TrackedClip(cast(Any, env)), torch.tensor([True])
    clip.begin(yes, torch.tensor([begin]), yes)
    return clip


def state(expert: ExpertFrames, at: float) -> tuple[torch.Tensor, torch.Tensor]:
    """Joints and ends at a time between the frames, of one robot."""
    low = int(at)
    frame = expert.frames[low] + (at - low) * (expert.frames[low + 1] - expert.frames[low])
    values = torch.from_numpy(frame)[None]
    return values[:, 7 : 7 + JOINTS], values[:, 7 + JOINTS : 19 + JOINTS]


def gone(expert: ExpertFrames, rate: float, count: int, begin: int = 10) -> list[float]:
    """How near a robot is found that goes through the clip at a rate."""
    clip, found = tracked(expert, begin), []
    for step in range(1, count + 1):
        clip._go_on(*state(expert, begin + rate * step), HEIGHT, UP)
        found.append(float(clip.near[0]))
    return found


def test_nearness_halves_at_its_widths():
    away = torch.zeros(4, JOINTS), torch.zeros(4, 12)
    away[0][1, 2], away[1][2, 5] = 0.5**0.5, 0.05**0.5
    assert nearness(*away).tolist() == pytest.approx([1.0, 0.5, 0.5, 1.0])
    up = torch.zeros(4, 3)
    up[3, 0] = 0.02**0.5
    assert nearness(*away, up).tolist() == pytest.approx([1.0, 0.5, 0.5, 0.5])


def test_each_joint_is_near_by_itself():
    away = torch.zeros(4, JOINTS)
    away[1, 3], away[2, 3], away[3, 3:5] = EACH[0], EACH[1], 1e6
    narrow, wide = 1.0 / (1.0 + (EACH[1] / EACH[0]) ** 2), 1.0 / (1.0 + (EACH[0] / EACH[1]) ** 2)
    lost = [0.0, 1.0 - 0.5 * (0.5 + wide), 1.0 - 0.5 * (narrow + 0.5), 2.0]
    assert each_near(away).tolist() == pytest.approx([1.0 - part / JOINTS for part in lost])


def test_a_joint_that_is_far_off_hides_no_other():
    """Turned forearms .6 rad from the clip's took four fifths of what a bent knee was paid in one bell."""
    gained = {}
    for forearm in (0.0, 0.6):
        straight, bent = torch.zeros(1, JOINTS), torch.zeros(1, JOINTS)
        straight[0, [3, 7]], straight[0, 13], bent[0, [3, 7]] = forearm, 0.25, forearm
        ends = torch.zeros(1, 12)
        gained[forearm] = [
            float((worth(bent) - worth(straight))[0])
            for worth in (each_near, lambda away, ends=ends: nearness(away, ends))
        ]
    assert gained[0.6][0] == pytest.approx(gained[0.0][0])
    assert gained[0.6][1] < 0.2 * gained[0.0][1]


@pytest.mark.parametrize(("trunk", "near"), [(False, 1.0), (True, 0.5)])
def test_how_the_trunk_leans_counts_where_asked(expert: ExpertFrames, trunk: bool, near: float):
    clip, angle = tracked(expert, 10, tracked_trunk=trunk), 2.0 * np.arcsin(0.5 * 0.02**0.5)
    leant = torch.tensor([[-np.sin(angle), 0.0, np.cos(angle)]], dtype=torch.float32)
    clip._go_on(*state(expert, 11), HEIGHT, leant)
    assert float(clip.near[0]) == pytest.approx(near, abs=1e-5)
    assert not clip.strayed[0]


def mean_pose_paid(expert: ExpertFrames, size: float, by_clip: bool) -> float:
    """What is paid to who keeps to the mean pose of a clip that moves `size` times as far as the one before it, on
    average over a period."""
    frames = expert.frames.copy()
    frames[120:, 7 : 19 + JOINTS] *= size
    clip = tracked(dataclasses.replace(expert, frames=frames), 130, tracked_by_clip=by_clip)
    mean, near = torch.from_numpy(frames[120:].mean(axis=0))[None], []
    for _ in range(PERIOD):
        clip._go_on(mean[:, 7 : 7 + JOINTS], mean[:, 7 + JOINTS : 19 + JOINTS], HEIGHT, UP)
        near.append(float(clip.near[0]))
    return float(np.mean(near))


@pytest.mark.parametrize("size", [0.2, 0.35])
def test_who_keeps_to_the_mean_pose_is_paid_a_third_however_little_the_clip_moves(expert: ExpertFrames, size: float):
    assert 0.3 < mean_pose_paid(expert, size, by_clip=True) < 0.4
    assert mean_pose_paid(expert, size, by_clip=False) > 0.5


def test_clips_that_move_far_or_hardly_at_all_are_not_measured_by_that(expert: ExpertFrames):
    assert mean_pose_paid(expert, 1.0, by_clip=True) == pytest.approx(mean_pose_paid(expert, 1.0, by_clip=False))
    assert mean_pose_paid(expert, 0.02, by_clip=True) > 0.9


def test_the_trunk_is_held_against_the_frame_that_is_nearest(expert: ExpertFrames):
    frames = expert.frames.copy()
    half = 0.25 * np.sin(2.0 * np.pi * np.arange(240) / PERIOD)
    frames[:, 3], frames[:, 5] = np.cos(half), np.sin(half)
    leaning = dataclasses.replace(expert, frames=frames)
    clip, ups = tracked(leaning, 120, tracked_trunk=True), up_b(torch.from_numpy(frames[:, 3:7]))
    for step in range(1, AGAIN + 1):
        at = 120 + step + (step == AGAIN)  # a frame ahead as the nearest is looked for
        clip._go_on(*state(leaning, at), HEIGHT, ups[at : at + 1])
    assert float(clip.near[0]) == pytest.approx(1.0, abs=1e-4)


def test_who_does_what_the_clip_does_is_near_it(expert):
    assert gone(expert, 1.0, 80) == pytest.approx([1.0] * 80)


@pytest.mark.parametrize("rate", [0.8, 1.2])
def test_a_gait_of_nearly_the_clips_rate_stays_with_it(expert, rate):
    assert min(gone(expert, rate, 80)) > 0.85


def test_who_stands_still_is_left_behind(expert):
    assert gone(expert, 0.0, PERIOD // 2)[-1] < 0.2


def test_it_is_over_with_the_clip(expert):
    clip, ends = tracked(expert, 100), []
    for step in range(1, 22):
        clip._go_on(*state(expert, 100.0 + min(step, 19)), HEIGHT, UP)
        ends.append(bool(clip.over[0]))
    assert ends.index(True) == 18, "frame 119 is the clip's last"
    assert clip._at[0] == 119, "the next clip is another one"


@pytest.mark.parametrize(
    ("end_m", "height_m", "tilt", "strays"),
    [
        (0.0, 0.0, 0.0, False),
        (0.9 * BOUND_M, 0.1, 0.4, False),
        (1.1 * BOUND_M, 0.0, 0.0, True),
        (0.0, 0.13, 0.0, True),
        (0.0, 0.0, 0.6, True),
    ],
)
def test_who_is_too_far_from_it_strays(expert, end_m, height_m, tilt, strays):
    clip = tracked(expert, 10)
    joints, ends = state(expert, 11.0)
    ends = ends.clone()
    ends[0, 4] += end_m
    up = torch.nn.functional.normalize(torch.tensor([[tilt, 0.0, 1.0]]))
    clip._go_on(joints, ends, HEIGHT + height_m, up)
    assert bool(clip.strayed[0]) == strays
    clip.tracks[:] = False
    clip._go_on(joints, ends, HEIGHT + height_m, up)
    assert not clip.strayed[0], "who tracks none strays from none"


OPTIONS = {
    "track_joints": 20.0,
    "tracked": 1.0,
    "tracked_end": 0.2,
    "assist": 1.0,
    "reference_share": 0.5,
    "reference_command_share": 0.0,
}
CALM = {"push_impulse": (0.0, 0.0), "noise": (0.0, 0.0, 0.0, 0.0), "stall": False}


@pytest.fixture(scope="module")
def env(tmp_path_factory, root, robot) -> Iterator[AmpEnvironment]:
    bundle = read_bundle(small_bundle(tmp_path_factory.mktemp("tracked"), root, robot))
    yield AmpEnvironment(bundle, preset("long_steps").changed(**OPTIONS, **CALM), 24, "cpu", seed=1)


def targets(env: AmpEnvironment) -> torch.Tensor:
    """Actions whose joint targets are those of the clips at this moment."""
    clip, robot = env.tracked_clip, env.context.bundle.robot
    assert clip is not None
    offset = (clip._joints[clip._at] - env.default_joint_pos[env.controlled_index]) / 0.25
    return offset[:, [robot.controlled.index(name) for name in robot.policy_joints]]


def test_a_clip_played_open_loop_is_tracked_and_one_that_is_not_is_strayed_from(env):
    clip = env.tracked_clip
    assert clip is not None
    strays = {}
    for played in (True, False):
        env.reset()
        assert clip.tracks.all()
        strayed = {stands: torch.zeros(env.num_envs, dtype=torch.bool) for stands in (True, False)}
        for step in range(25):
            frames = clip._at.clone()
            stands = frames < int(env.context.bundle.expert.clip_start[1])
            assert 3 <= stands.sum() < env.num_envs
            env.step(targets(env) if played else torch.full((env.num_envs, JOINTS), 4.0))
            going = ~env.reset_buf & clip.tracks
            assert torch.equal(env.command[going], clip.command[going]), "the clip's command is told"
            if step < AGAIN - 1:
                assert (clip._at[going] == frames[going] + 1).all()
            told = env.termination_manager.get_term("strayed")
            strayed[True] |= told & stands
            strayed[False] |= told & ~stands
        strays[played] = strayed
    assert not strays[True][True].any(), "the other clip moves at random, which no robot can"
    assert (strays[False][True] | strays[False][False]).all()


def test_the_critic_is_told_of_the_clip_and_the_reward_pays_nearness(env):
    env.reset()
    clip = env.tracked_clip
    assert clip is not None
    env.step(targets(env))
    env.readings.fresh()
    assert critic_frame(env).shape == (env.num_envs, 79)
    assert torch.equal(critic_frame(env)[:, 77:], clip.seen())
    task = env.reward_manager.get_term_cfg("task").func
    at = [row.name for row in task.rows].index("track_clip")
    going = ~env.reset_buf
    assert (clip.near[going] > 0.7).float().mean() > 0.8
    paid = task.weights(env)[at] * clip.near
    assert task.paid[going, at].tolist() == pytest.approx(paid[going].tolist(), rel=1e-5)
    at = [row.name for row in task.rows].index("track_joints")
    assert (clip.each_near[going] > 0.7).float().mean() > 0.8
    paid = 20.0 * clip.each_near
    assert task.paid[going, at].tolist() == pytest.approx(paid[going].tolist(), rel=1e-5)


def test_an_episode_ends_in_time_with_its_clip(env):
    env.reset()
    clip = env.tracked_clip
    assert clip is not None
    ends = torch.arange(env.num_envs) < 5
    clip._at[ends] = clip._last[clip._at[ends]] - 1
    clip._at[~ends] = torch.minimum(clip._at[~ends], clip._last[clip._at[~ends]] - 10)
    before = clip._at.clone()
    *_, terminated, timed_out, _ = env.step(targets(env))
    assert torch.equal(timed_out, ends & ~terminated)
    assert timed_out.sum() > 2
    assert (clip._at[ends] != before[ends] + 1).any(), "another one has begun"


def test_who_tracks_keeps_the_clips_command_and_nobody_tracks_where_it_is_off(env):
    env.reset()
    clip = env.tracked_clip
    assert clip is not None
    env.velocity_command.time_left[:] = 0.01
    env.step(targets(env))
    going = ~env.reset_buf
    assert (env.velocity_command.age[going] > 1.0).all(), "no command is drawn meanwhile"
    off = Options(tracked=0.0, tracked_end=0.5)
    ramps = Ramps(off, "cpu")
    ramps.at(1e9)
    assert ramps.tracked == 0.0


def test_fewer_episodes_track_as_the_ramp_sinks(env):
    first, last = env.context.options.tracked_iterations
    clip, found = env.tracked_clip, []
    assert clip is not None
    for env.schedule in (0.0, (first + last) / 2.0, float(last)):
        env.ramps.at(env.schedule)
        told = []
        for _ in range(8):
            env.reset()
            told.append(clip.tracks.float().mean())
        found.append(float(torch.stack(told).mean()))
    env.schedule = None
    env.go_on()  # else the next test's episodes begin as they do at the end of the ramp
    assert found[0] == 1.0
    assert 0.45 < found[1] < 0.75
    assert 0.1 < found[2] < 0.3
