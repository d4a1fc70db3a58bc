"""What training imports, and the bundle that it reads."""

from __future__ import annotations

import json
import subprocess
import sys

import numpy as np
import pytest

from pipeline.expert.training_bundle import TrackedClip, TrackerFiles, augmented_by, write_training_bundle
from pipeline.learning.training_error import TrainingError
from pipeline.training.bundle import read_bundle
from tests.factories.robot_clips import standing, wandering
from tests.factories.tracking_bundle import tracker_file
from tests.factories.training_bundle import small_bundle

STACK = {
    "jaxtyping",
    "mjlab",
    "mujoco",
    "mujoco_warp",
    "warp",
    "torch",
    "tensordict",
    "rsl_rl",
    "numpy",
    "scipy",
    "pandas",
    "pyarrow",
}
"""Packages of a GPU host."""


def test_training_imports_nothing_but_the_stack_of_a_gpu_host():
    """Top-level packages imported by the project modules that training loads, in a separate process."""
    code = """
import ast, json, pathlib, sys
import pipeline.training.chain, pipeline.tracking.run
ours = {name: module for name, module in sys.modules.items() if name.split(".")[0] in ("pipeline", "assets")}
named = {}
for name, module in ours.items():
    for node in ast.walk(ast.parse(pathlib.Path(module.__file__).read_text())):
        if isinstance(node, ast.Import):
            named.update({alias.name.split(".")[0]: name for alias in node.names})
        elif isinstance(node, ast.ImportFrom):
            named[node.module.split(".")[0]] = name
print(json.dumps({"named": named, "std": sorted(sys.stdlib_module_names)}))
"""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    found = json.loads(done.stdout.strip().splitlines()[-1])
    known = {*STACK, *found["std"], "pipeline"}
    assert {name: module for name, module in found["named"].items() if name not in known} == {}


def test_the_command_sets_thread_waiting_before_torch_loads():
    """torch's pool reads OMP_WAIT_POLICY when it loads, so `__main__` must not import torch before it sets it."""
    code = "import sys, pipeline.training.__main__; print('torch' in sys.modules)"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "False"


def test_a_bundle_says_how_its_variants_were_made():
    made = augmented_by(["original", "mirror", "mirror~x0.9", "x1.1", "trunk_lean-2", "step_width0.02"])
    assert made == ["mirror", "time-scale", "step width", "trunk lean"]
    assert augmented_by(["original"]) == []


def test_a_bundle_has_what_it_states_and_can_do_without_augmented_clips(tmp_path, root, robot):
    folder = small_bundle(tmp_path, root, robot)
    both, plain = read_bundle(folder), read_bundle(folder, use_augmented=False)
    assert len(both.expert.clip_weight) == 2
    assert len(plain.expert.clip_weight) == 1
    assert len(plain.expert.frames) == plain.expert.clip_start[-1] < len(both.expert.frames)
    assert np.all(plain.expert.command == 0.0)
    assert both.robot.policy_joints[:3] == ("Left_Shoulder_Pitch", "Right_Shoulder_Pitch", "Waist")
    robot_xml = folder / "robot.xml"
    robot_xml.write_text(robot_xml.read_text() + " ")
    with pytest.raises(TrainingError, match=r"robot\.xml: its digest differs from the one"):
        read_bundle(folder)
    robot_xml.unlink()
    with pytest.raises(TrainingError, match=r"robot\.xml: the file is missing"):
        read_bundle(folder)
    head = folder / "bundle.json"
    head.write_text(json.dumps({"schema": json.loads(head.read_text())["schema"]}))
    with pytest.raises(TrainingError, match=r"bundle\.json: has no digests of its files"):
        read_bundle(folder)


def moved(clip, speed: float):
    """A clip that goes forward at a speed [m/s]."""
    root = clip.root_pos_w.copy()
    root[:, 0] += speed * np.arange(len(root)) / clip.fps
    return type(clip)(**{**vars(clip), "root_pos_w": root})


@pytest.fixture
def tracked(tmp_path, root, robot):
    """A bundle whose tracker walks at 0.19 m/s where its clip walks at 0.40, and as fast as another clip."""
    folder = small_bundle(tmp_path, root, robot)
    still = standing(robot, seconds=3.0, name="test/slow")
    other = standing(robot, seconds=2.0, name="test/right")
    clips = [
        TrackedClip(reference=moved(still, 0.40), rollout=moved(still, 0.19)),
        TrackedClip(reference=moved(other, 0.60), rollout=moved(other, 0.58)),
    ]
    files = TrackerFiles(network=tracker_file(tmp_path / "tracker.npz", robot), clips=clips)
    write_training_bundle(folder, tmp_path / "database", tmp_path / "adapted" / "t1", files)
    return read_bundle(folder)


def test_labels_are_the_velocity_of_the_rollout_and_not_of_the_clip(tracked):
    references = tracked.teacher.references
    slow = references.command[: references.clip_start[1]]
    assert slow[:, 0] == pytest.approx(0.19, abs=1e-3)
    assert slow[:, 1:] == pytest.approx(0.0, abs=1e-6)
    assert references.speed.tolist() == [pytest.approx([0.40, 0.19], abs=1e-3), pytest.approx([0.60, 0.58], abs=1e-3)]


def test_clips_tracked_at_another_speed_are_excluded(tracked):
    references = tracked.teacher.references
    chosen = references.tracked_at_speed(0.1)
    assert chosen.names == ("test/right",)
    assert chosen.clip_start.tolist() == [0, 100]
    assert len(chosen.joint_pos) == len(chosen.command) == 100
    assert chosen.command[:, 0] == pytest.approx(0.58, abs=1e-3)
    assert references.tracked_at_speed(0.3).names == references.names
    with pytest.raises(TrainingError, match=r"differs from its clip by more than 0.01 m/s. Train a better tracker"):
        references.tracked_at_speed(0.01)


def test_a_tracker_of_another_robot_is_refused(tmp_path, root, robot):
    folder = small_bundle(tmp_path, root, robot)
    other = tracker_file(tmp_path / "tracker.npz", robot, joint_names=np.array(robot.joint_names[::-1]))
    clip = wandering(robot)
    files = TrackerFiles(network=other, clips=[TrackedClip(reference=clip, rollout=clip)])
    write_training_bundle(folder, tmp_path / "database", tmp_path / "adapted" / "t1", files)
    with pytest.raises(TrainingError, match=r"tracker.npz: the tracker of 't1' has other joints or links"):
        read_bundle(folder)
