"""A robot's log for display: pose, commands, failures to jump to, and the same command in simulation."""

import numpy as np
import pytest

from pipeline.cli.view_command import clips_to_view
from pipeline.errors import FileError
from pipeline.project import Project
from pipeline.readers import NOTHING_STATED
from pipeline.robot import Kinematics
from pipeline.viewing.log_view import log_playlist
from pipeline.viewing.viewer import Viewer


@pytest.fixture(scope="module")
def fall(root):
    playlist = log_playlist(root / "data/hardware_logs/demo/side_left_fall.mcap", Project(root))
    return playlist.load(playlist.names[0])


def test_the_failures_of_a_log_can_be_jumped_to(fall):
    falls = [label for label in fall.marks if "fall" in label]
    assert falls and fall.marks[falls[0]] == pytest.approx(3.5, abs=0.2)
    assert "fall left" in fall.text.replace("&#95;", "_")


def test_the_command_is_shown_as_it_plays(fall):
    assert fall.line_at(3.0).startswith("command 0.00 m/s, 0.40 m/s")
    assert fall.line_at(-1.0) == fall.line_at(0.0)


def test_the_pose_stands_on_the_ground_until_the_fall(fall, robot):
    clip = fall.robot_clip.cut(0, 100, "stands")
    poses = Kinematics(robot).forward(clip.root_pos_w, clip.root_quat_w, clip.joint_pos)
    corners = Kinematics(robot).site_pos_w(poses, [name for side in robot.sole_corners for name in side])
    np.testing.assert_allclose(corners[..., 2].min(axis=1), 0.0, atol=1e-9)
    assert fall.robot_clip.fps == pytest.approx(50.0)


def test_the_simulation_of_the_same_command_is_beside_the_log(root, tmp_path, robot):
    from pipeline.cli.main import main

    log = tmp_path / "walk.mcap"
    policy = root / "robots/t1/policies/walk/policy.npz"
    command = ["--policy", str(policy), "--command=0.5,0.4,0,0", "--seconds", "2", "--rate", "100"]
    assert main(["simulate-robot", str(log), *command]) == 0
    shown = clips_to_view(Project(root), str(log), robot, NOTHING_STATED).load("walk")
    assert [figure.name for figure in shown.figures()] == ["simulation", "t1"]
    assert shown.reference.duration_s == pytest.approx(2.0, abs=0.1)
    logged = shown.robot_clip.joint_pos[: shown.reference.frame_count]
    apart = np.abs(logged - shown.reference.joint_pos[: len(logged)])
    assert float(np.median(apart)) < 0.1, "the virtual robot is the simulated one with noise"


def test_a_file_that_is_no_log_is_refused(root, tmp_path):
    (tmp_path / "no.mcap").write_bytes(b"no log")
    with pytest.raises(FileError):
        log_playlist(tmp_path / "no.mcap", Project(root))


def test_the_viewer_jumps_to_a_mark_and_shows_the_command(fall):
    import socket

    from pipeline.viewing.playlist import Playlist

    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        port = probe.getsockname()[1]
    viewer = Viewer(Playlist(names=(fall.name,), load=lambda _: fall), port=port)
    try:
        label, time_s = next(iter(fall.marks.items()))
        viewer.marks.value = label
        viewer.step(0.0)
        assert viewer.playback.time_s == pytest.approx(time_s)
        viewer.step(0.05)
        assert time_s < viewer.playback.time_s < time_s + 0.1, "it plays on from there"
        assert "command" in viewer.line.content
    finally:
        viewer.stop()
