"""What `booster-lab view` finds by name: clips of the store and of the database."""

import dataclasses
import json

import numpy as np
import pytest

from pipeline.batch import Entry, Judged, Manifest
from pipeline.cli.view_command import clips_to_view
from pipeline.errors import FileError, PipelineError
from pipeline.expert.write import ExpertEntry, encode_clip
from pipeline.project import Project
from pipeline.readers import NOTHING_STATED
from tests.factories.figures import gliding_human, standing_robot


@pytest.fixture
def project(tmp_path, robot):
    """A store with a recording, its window, the window retargeted, and a mirrored variant at half again the speed."""
    project = Project(tmp_path)
    human, machine = gliding_human(frame_count=61), standing_robot(robot)
    variant = "made/glide@10-39~mirror~x1.5"
    window = {"skill": "walk", "start_frame": 10, "stop_frame": 40}
    _save(project, "motion_catalog", {"made/glide": (human, {})})
    _save(project, "selected_motions", {"made/glide@10-39": (human, window)})
    _save(project, "retargeted_motions", {"made/glide@10-39": (machine, window)})
    _save(project, "augmented_motions", {"made/glide@10-39": (machine, window), variant: (machine, window)})
    reason = {"code": "torque", "text": "the knee needs 61 N m, 40 are allowed", "effect": "rejected"}
    judged = Judged(clip=variant, pieces=(), reasons=(reason,), numbers={})
    project.store.save("feasible_motions", Manifest(stage="feasible_motions", entries=(), judged=(judged,)))
    return project


def _save(project, asset, clips):
    entries = tuple(
        Entry(clip=name, blob=project.store.put_clip(dataclasses.replace(clip, name=name)), numbers=numbers)
        for name, (clip, numbers) in clips.items()
    )
    project.store.save(asset, Manifest(stage=asset, entries=entries, judged=()))


@pytest.mark.parametrize("asset", ["motion_variants", "reference_motions"])
def test_variants_and_references_are_found_and_shown_as_the_last_asset_has_them(project, robot, asset):
    machine = standing_robot(robot)
    moved = dataclasses.replace(machine, root_pos_w=machine.root_pos_w + np.array([1.0, 0.0, 0.0]))
    _save(project, asset, {"made/glide@10-39": (moved, {}), "made/glide@10-39~x0.9": (moved, {})})
    (project.store.manifest_path("augmented_motions")).unlink()
    found = clips_to_view(project, "made/glide@10-39~x0.9", robot, NOTHING_STATED)
    assert found.names == ("made/glide@10-39~x0.9",)
    shown = clips_to_view(project, "made/glide@10-39", robot, NOTHING_STATED).load("made/glide@10-39")
    assert shown.robot_clip is not None
    assert np.array_equal(shown.robot_clip.root_pos_w, moved.root_pos_w)


@pytest.mark.parametrize("text", ["made/glide", "made/glide@", "made"])
def test_a_recording_is_shown_as_the_robot_clips_made_from_it_and_the_rest_beside_them(project, robot, text):
    found = clips_to_view(project, text, robot, NOTHING_STATED)
    assert found.names == ("made/glide@10-39",)
    assert found.beside == ("made/glide", "made/glide@10-39~mirror~x1.5")


def test_a_recording_without_a_robot_clip_is_shown_as_the_human_alone(project, robot):
    (project.store.manifest_path("retargeted_motions")).unlink()
    (project.store.manifest_path("augmented_motions")).unlink()
    found = clips_to_view(project, "made/glide", robot, NOTHING_STATED)
    assert found.names == ("made/glide", "made/glide@10-39")
    assert found.load("made/glide").robot_clip is None


def test_a_window_shows_its_frames_of_the_human_beside_the_robot(project, robot):
    shown = clips_to_view(project, "made/glide@10-39", robot, NOTHING_STATED).load("made/glide@10-39")
    assert shown.human is not None and shown.robot_clip is not None
    assert shown.human.frame_count == 30
    assert np.array_equal(shown.human.body_pos_w, gliding_human(frame_count=61).body_pos_w[10:40])
    assert "| skill | walk |" in shown.text


def test_a_variant_shows_the_human_in_the_same_mirror_and_speed_and_why_it_was_rejected(project, robot):
    name = "made/glide@10-39~mirror~x1.5"
    shown = clips_to_view(project, name, robot, NOTHING_STATED).load(name)
    assert shown.human is not None
    assert shown.human.fps == pytest.approx(45.0)
    original = gliding_human(frame_count=61).body_pos_w[10:40]
    assert np.allclose(shown.human.pos("left_wrist"), original[:, -1] * [1, -1, 1])
    assert "rejected: the knee needs 61 N m" in shown.text


def test_a_rollout_is_shown_beside_the_frames_of_the_reference_that_it_tracked(project, robot):
    reference = standing_robot(robot)
    moving = reference.root_pos_w + np.arange(reference.frame_count)[:, None] * [0.01, 0.0, 0.0]
    reference = dataclasses.replace(reference, root_pos_w=moving)
    rollout = reference.cut(3, 13, "rollout")
    _save(project, "reference_motions", {"made/glide@10-39": (reference, {})})
    place = {"reference": "made/glide@10-39", "reference_frame": 3}
    _save(project, "augmented_motions", {"made/glide@10-39~rollout+0": (rollout, place)})
    clips = clips_to_view(project, "made/glide@10-39~rollout+0", robot, NOTHING_STATED)
    shown = clips.load("made/glide@10-39~rollout+0")
    np.testing.assert_allclose(shown.reference.root_pos_w, reference.root_pos_w[3:13])
    assert [figure.name for figure in shown.figures()] == ["human", "reference", "t1"]
    assert clips_to_view(project, "made/glide@10-39", robot, NOTHING_STATED).load("made/glide@10-39").reference is None


def test_a_name_that_is_not_there_tells_what_comes_near(project, robot):
    with pytest.raises(PipelineError, match="neither a file nor a clip of the store; similar names: made/glide"):
        clips_to_view(project, "made/glyde", robot, NOTHING_STATED)


def test_an_empty_store_tells_the_command_that_fills_it(tmp_path, robot):
    with pytest.raises(PipelineError, match="dagster asset materialize --select expert_db"):
        clips_to_view(Project(tmp_path), "made/glide", robot, NOTHING_STATED)


def test_a_clip_of_the_database_is_shown_as_it_was_written(project, robot, tmp_path):
    clip = standing_robot(robot)
    path = tmp_path / "clip.json"
    path.write_bytes(encode_clip(ExpertEntry(clip=clip, weight=1.5, skill="walk", licence="CC0-1.0"), robot))
    found = clips_to_view(project, str(path), robot, NOTHING_STATED)
    shown = found.load(found.names[0])
    assert shown.human is None and shown.robot_clip is not None
    assert shown.robot_clip.name == clip.name and shown.robot_clip.fps == pytest.approx(50.0)
    controlled = robot.controlled_index
    assert np.abs(shown.robot_clip.joint_pos[:, controlled] - clip.joint_pos[:, controlled]).max() < 1e-6
    assert np.abs(shown.robot_clip.root_pos_w - clip.root_pos_w).max() < 1e-6
    head = [index for index in range(len(robot.joint_names)) if index not in controlled]
    assert np.array_equal(shown.robot_clip.joint_pos[0, head], robot.default_joint_pos[head])
    assert "walk" in shown.text and "1.5" in shown.text


@pytest.mark.parametrize(("frame", "shown"), [(3, True), (10_000, False)])
def test_a_rollout_of_the_database_is_shown_beside_its_reference(project, robot, tmp_path, frame, shown):
    """A store that was made again since may have another, shorter reference of that name."""
    reference = standing_robot(robot)
    moving = reference.root_pos_w + np.arange(reference.frame_count)[:, None] * [0.01, 0.0, 0.0]
    reference = dataclasses.replace(reference, root_pos_w=moving)
    rollout = reference.cut(3, 13, "made/glide@10-39~rollout")
    _save(project, "reference_motions", {"made/glide@10-39": (reference, {})})
    place = {"reference": "made/glide@10-39", "reference_frame": frame}
    _save(project, "feasible_motions", {rollout.name: (rollout, place)})
    path = tmp_path / "clip.json"
    path.write_bytes(encode_clip(ExpertEntry(clip=rollout, weight=1.0, skill="walk", licence="CC0-1.0"), robot))
    beside = clips_to_view(project, str(path), robot, NOTHING_STATED).load(rollout.name).reference
    assert (beside is not None) == shown
    if beside is not None:
        np.testing.assert_allclose(beside.root_pos_w, reference.root_pos_w[3:13])


def test_a_clip_for_another_robot_is_refused(project, robot, tmp_path):
    data = encode_clip(ExpertEntry(clip=standing_robot(robot), weight=1.0, skill="walk", licence="CC0-1.0"), robot)
    content = json.loads(data)
    content["Robot"] = "k1"
    path = tmp_path / "clip.json"
    path.write_text(json.dumps(content))
    with pytest.raises(FileError, match=r"it is for the robot 'k1', not for 't1'\. Add --robot k1"):
        clips_to_view(project, str(path), robot, NOTHING_STATED)
