"""Logs of the virtual robot as motions: the pose is that of the simulation, the path that of the feet."""

import dataclasses
from pathlib import Path

import numpy as np
import pytest

from pipeline import rotation
from pipeline.deployment import PolicyController
from pipeline.errors import FileError
from pipeline.export.folder import read_export
from pipeline.hardware_logs import LogFacts, write_mcap
from pipeline.readers.read_motion import read_motion
from pipeline.readers.robot_log import root_poses
from pipeline.robot import Robot
from pipeline.validation.deployed import deployed
from pipeline.virtual_robot.trial import VirtualTrial, simulate
from tests.factories.robot_logs import robot_log

ROOT = Path(__file__).resolve().parents[2]
SECONDS = 6.0


def test_a_walk_is_the_one_that_was_simulated(tmp_path: Path, robot: Robot):
    trial = VirtualTrial(command=((0.5, 0.6, 0.0, 0.0),), seconds=SECONDS)
    folder = ROOT / "robots" / "t1"
    one = deployed(folder, read_export(folder / "policies" / "walk", robot).policy)
    controller = PolicyController(one.task, one.policy)
    rollout, log = simulate(robot, controller, trial, np.random.default_rng(1), LogFacts(robot="t1"))
    path = tmp_path / "walk.mcap"
    write_mcap(path, log)
    motion = read_motion(path, "logs/walk")
    clip = motion.clip
    assert (motion.format, clip.fps, clip.joint_names) == ("robot_log", 50.0, robot.joint_names)
    assert clip.duration_s == pytest.approx(SECONDS, abs=0.2)
    true = rollout.qpos[:, :3]
    length = np.linalg.norm((true[-1] - true[0])[:2])
    assert length > 2.0
    assert np.linalg.norm((clip.root_pos_w[-1] - clip.root_pos_w[0])[:2]) == pytest.approx(length, rel=0.05)
    assert np.median(clip.root_pos_w[:, 2]) == pytest.approx(np.median(true[:, 2]), abs=0.01)
    (note,) = [each for each in motion.notes if each.code == "robot_log"]
    assert "of a simulated robot" in note.text and note.effect == "noted"


def test_leg_odometry_of_a_crouch_sinks_and_turns_with_the_heading(robot: Robot):
    """Soles stay flat while hips, knees and ankles bend: the root sinks, and goes where the heading points."""
    bend = np.linspace(0.2, 0.8, 30)
    joints = np.tile(robot.default_joint_pos, (30, 1))
    for side in ("Left", "Right"):
        joints[:, robot.joint(f"{side}_Hip_Pitch")] = -bend
        joints[:, robot.joint(f"{side}_Knee_Pitch")] = 2.0 * bend
        joints[:, robot.joint(f"{side}_Ankle_Pitch")] = -bend
    root, _ = root_poses(robot, np.zeros((30, 3)), joints)
    assert (np.diff(root[:, 2]) < 0.0).all() and root[0, 2] - root[-1, 2] > 0.05
    np.testing.assert_allclose(root[:, 1], 0.0, atol=1e-9)
    turned, _ = root_poses(robot, np.tile([0.0, 0.0, 1.0], (30, 1)), joints)
    np.testing.assert_allclose(turned, rotation.rotate(rotation.about_z(1.0), root), atol=1e-12)


def test_a_log_that_lost_a_part_says_so(tmp_path: Path):
    whole = (ROOT / "data" / "hardware_logs" / "demo" / "held.mcap").read_bytes()
    damaged = bytearray(whole)
    damaged[len(whole) // 2] ^= 0x55
    path = tmp_path / "held.mcap"
    path.write_bytes(damaged)
    notes = {each.code: each.text for each in read_motion(path, "logs/held").notes}
    assert "lost: a chunk with a wrong checksum" in notes["log_note"]
    path.write_bytes(whole)
    assert "log_note" not in {each.code for each in read_motion(path, "logs/held").notes}


def test_a_damaged_log_is_refused_by_name(tmp_path: Path):
    path = tmp_path / "broken.mcap"
    path.write_bytes(b"\x89MCAP0\r\n nothing")
    with pytest.raises(FileError, match=r"broken\.mcap"):
        read_motion(path, "logs/broken")


def test_a_log_in_which_the_robot_lies_is_no_motion(tmp_path: Path, robot: Robot):
    log = robot_log(robot)
    assert log.fall_down is not None
    fallen = np.full(len(log.fall_down.time_ns), 2)
    lying = dataclasses.replace(log, fall_down=dataclasses.replace(log.fall_down, state=fallen))
    path = tmp_path / "lying.mcap"
    write_mcap(path, lying)
    with pytest.raises(FileError, match="never up"):
        read_motion(path, "logs/lying")
