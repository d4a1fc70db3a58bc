"""An exported LeRobotDataset is opened by LeRobot's own loader: every frame, its task, statistics and batches."""

import json
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from pipeline.dataset_export import export_clips
from tests.factories.robot_clips import wandering

PACKAGES = Path(sys.prefix) / "lerobot"
SCRIPT = Path(__file__).with_name("open_lerobot.py")
SKILLS = ("walk", "run", "walk")


@pytest.fixture(scope="module")
def clips(robot):
    return [wandering(robot, seed=seed).cut(0, 40 + 5 * seed, f"clip {seed}") for seed in range(len(SKILLS))]


@pytest.fixture(scope="module")
def opened(robot, clips, tmp_path_factory):
    """What the loader finds, run in a process of its own and without a network."""
    if not (PACKAGES / ".installed").is_file():
        pytest.skip("needs LeRobot's loader beside the environment: make test installs it (tests/dataset_export)")
    folder = tmp_path_factory.mktemp("lerobot")
    named = [(clip, skill, f"{clip.name}.json") for clip, skill in zip(clips, SKILLS, strict=True)]
    assert export_clips("lerobot", named, robot, folder / "data set") == len(clips)
    environment = {**os.environ, "PYTHONPATH": str(PACKAGES), "HF_HUB_OFFLINE": "1", "HF_HOME": str(folder / "cache")}
    command = [sys.executable, "-W", "ignore", str(SCRIPT), str(folder / "data set")]
    done = subprocess.run(command, env=environment, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr[-3000:]
    return json.loads(done.stdout)


def test_the_loader_finds_rate_robot_tasks_and_episodes(opened):
    assert (opened["fps"], opened["robot"], opened["episodes"]) == (50, "t1", 3)
    assert sorted(opened["tasks"]) == ["run", "walk"]


def test_every_frame_is_the_clips_with_its_task_and_time(opened, clips):
    frames = iter(opened["frames"])
    for episode, (clip, skill) in enumerate(zip(clips, SKILLS, strict=True)):
        own = [next(frames) for _ in range(clip.frame_count)]
        assert {frame["task"] for frame in own} == {skill}
        assert {frame["episode_index"] for frame in own} == {episode}
        np.testing.assert_allclose([frame["timestamp"] for frame in own], np.arange(len(own)) / 50.0, atol=1e-5)
        for name, values in (
            ("observation.state", clip.joint_pos),
            ("observation.joint_vel", clip.joint_vel()),
            ("observation.root_pos_w", clip.root_pos_w),
            ("observation.root_quat_w", clip.root_quat_w),
        ):
            np.testing.assert_allclose([frame[name] for frame in own], values, atol=1e-4)
        np.testing.assert_allclose([frame["action"] for frame in own][:-1], clip.joint_pos[1:], atol=1e-6)
    assert next(frames, None) is None


def test_statistics_and_windows_over_time_are_those_of_the_clips(opened, clips):
    states = np.concatenate([clip.joint_pos for clip in clips])
    np.testing.assert_allclose(opened["mean"], states.mean(axis=0), atol=1e-6)
    windows = np.array(opened["windows"])
    np.testing.assert_allclose(windows[1], clips[0].joint_pos[0:3], atol=1e-6)
    np.testing.assert_allclose(windows[2], clips[0].joint_pos[1:4], atol=1e-6)
    assert opened["beyond the episode"] == [[True, False, False], [False] * 3, [False] * 3, [False, False, True]]


def test_one_episode_alone_is_loaded(opened, clips):
    first = clips[0].frame_count
    assert opened["second episode"] == list(range(first, first + clips[1].frame_count))
