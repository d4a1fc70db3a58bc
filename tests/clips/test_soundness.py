"""Frames that are what frames must be, and each fault of those that are not."""

import dataclasses

import pytest

from pipeline.clips.codec import faults_of
from tests.factories.clips import human_clip, robot_clip


@pytest.mark.parametrize("clip", [human_clip(), robot_clip()])
def test_a_sound_clip_has_no_faults(clip):
    assert faults_of(clip) == []


def test_each_fault_names_its_first_frame():
    clip = robot_clip()
    clip.joint_pos[3, 1] = float("nan")
    clip.root_quat_w[2] *= 1.01
    assert faults_of(clip) == ["frame 3: joint_pos is not finite", "frame 2: a quaternion's length is off by 1.0e-02"]


def test_missing_labels_and_single_frames_are_faults():
    assert faults_of(dataclasses.replace(human_clip(), contacts=None)) == ["contacts are not labelled"]
    for clip in (human_clip(frames=0), robot_clip(frames=0)):
        assert faults_of(clip) == [f"0 frames at {clip.fps} frames/s are no motion"]
    assert faults_of(human_clip(frames=1)) == ["1 frames at 60.0 frames/s are no motion"]
