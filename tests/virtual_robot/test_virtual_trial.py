"""A virtual robot that differs from its model in what was asked, and in nothing else."""

import json

import numpy as np
import pytest

from pipeline.cli.main import main
from pipeline.errors import UnknownNameError
from pipeline.hardware_logs import LogFacts
from pipeline.virtual_robot.deviations import Deviations, envelope_of, motor_envelope
from pipeline.virtual_robot.scripted import SWAY, TOPPLE_LEFT, Hold, ScriptedController
from pipeline.virtual_robot.trial import VirtualTrial, command_of, simulate
from tests.factories.log_trials import ROOT, scripted_log, trials_in


def _simulated(robot, trial):
    from pipeline.actuators.standing import read_standing_pose
    from pipeline.deployment import deployment_task

    pose = read_standing_pose(ROOT / "robots/t1", robot)
    task = deployment_task(robot, kp=pose.kp, kd=pose.kd, default_joint_pos=pose.joint_pos)
    facts = LogFacts(robot=robot.name, policy_digest=SWAY.digest)
    return simulate(robot, ScriptedController(task, SWAY), trial, np.random.default_rng(0), facts)


def test_a_weak_motor_gives_its_share_and_the_others_all(robot):
    nominal = motor_envelope(robot)
    weak = envelope_of(robot, Deviations(torque_scale={"Left_Knee_Pitch": 0.5}), nominal)
    expected = np.array(robot.torque_limit)
    expected[robot.joint("Left_Knee_Pitch")] *= 0.5
    assert weak.limit == pytest.approx(expected)
    with pytest.raises(UnknownNameError, match="unknown joint 'Left_Knee'"):
        envelope_of(robot, Deviations(torque_scale={"Left_Knee": 0.5}), nominal)


def test_a_command_is_slewed_from_standing_and_between_waypoints():
    command = command_of(((1.0, 0.5, 0.0, 0.0), (3.0, 0.0, 0.0, -1.0)))
    assert command(0.9) == pytest.approx([0.0, 0.0, 0.0])
    assert command(1.24) == pytest.approx([0.25, 0.0, 0.0], abs=0.03)
    assert command(2.5) == pytest.approx([0.5, 0.0, 0.0])
    assert command(10.0) == pytest.approx([0.0, 0.0, -1.0])


def test_a_hand_takes_the_weight_off_the_feet_and_gives_it_back(robot):
    hold = Hold(start_s=1.0, stop_s=2.5)
    rollout, _log = _simulated(robot, VirtualTrial(command=((0.5, 0.0, 0.0, 0.0),), seconds=4.0, hold=hold))
    weight = robot.total_mass * 9.81
    borne = rollout.foot_wrench_w[:, :, 2].sum(axis=1) / weight
    at = {time_s: float(np.mean(borne[round(time_s / 0.002) :][:100])) for time_s in (0.6, 2.0, 3.6)}
    assert at[0.6] == pytest.approx(1.0, abs=0.1) and at[2.0] < 0.05 and at[3.6] > 0.9
    assert not rollout.fell


def test_a_stop_damps_the_joints_and_the_log_says_so(robot):
    rollout, log = _simulated(robot, VirtualTrial(command=((0.5, 0.0, 0.0, 0.0),), seconds=3.0, stop_s=1.5))
    sent = log.joint_ctrl
    assert sent is not None
    seconds = (sent.time_ns - sent.time_ns[0]) * 1e-9
    assert (sent.kp[seconds >= 1.5] == 0.0).all() and (sent.kp[seconds < 1.4].max(axis=1) > 0.0).all()
    assert [event.kind for event in log.facts.events] == ["stop"]
    late = rollout.torque[-200:]
    assert late == pytest.approx(-_kd(robot) * rollout.qvel[-200:, 6:], abs=1e-6)


def _kd(robot):
    from pipeline.actuators.standing import read_standing_pose

    return read_standing_pose(ROOT / "robots/t1", robot).kd


def test_the_log_says_that_it_is_simulated_and_what_differed(robot):
    differs = Deviations(friction=0.3, delay_s=0.02, torque_scale={"Left_Knee_Pitch": 0.6})
    trial = VirtualTrial(command=((0.5, 0.0, 0.0, 0.0),), seconds=0.4, deviations=differs)
    facts = scripted_log(robot, SWAY, trial).facts
    assert facts.simulated
    assert (
        facts.notes["differs from the model"] == "Left_Knee_Pitch gives 60 % of its torque; friction 0.3; delay 20 ms"
    )
    assert (
        scripted_log(robot, SWAY, VirtualTrial(command=((0.5, 0.0, 0.0, 0.0),), seconds=0.4)).facts.notes[
            "differs from the model"
        ]
        == "no"
    )


def test_scripts_tell_themselves_apart():
    assert SWAY.digest != TOPPLE_LEFT.digest and len(SWAY.digest) == 64


def test_the_command_writes_the_same_log_twice_and_a_wrong_joint_is_named(tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(ROOT)
    for name in ("one.mcap", "two.mcap"):
        made = main(["simulate-robot", str(tmp_path / name), "--script", "sway", "--seconds", "1", "--rate", "100"])
        assert made == 0
    assert (tmp_path / "one.mcap").read_bytes() == (tmp_path / "two.mcap").read_bytes()
    assert "1 s of a simulated t1" in capsys.readouterr().out
    wrong = ["simulate-robot", str(tmp_path / "x.mcap"), "--script", "sway", "--weaker", "Knee=0.5", "--seconds", "1"]
    assert main(wrong) == 1
    assert "unknown joint 'Knee'" in capsys.readouterr().err
    assert not (tmp_path / "x.mcap").exists()
    assert main(["simulate-robot", str(tmp_path / "x.mcap"), "--weaker", "Left_Knee_Pitch"]) == 2


def test_a_policy_of_another_robot_is_named_with_its_file(tmp_path, capsys):
    policy = ROOT / "robots/t1/policies/walk/policy.npz"
    assert main(["simulate-robot", str(tmp_path / "x.mcap"), "--robot", "k1", "--policy", str(policy)]) == 1
    said = capsys.readouterr().err
    assert f"{policy}: the policy does not fit robot 'k1': it lacks the joints ALeft_Shoulder_Pitch, " in said
    assert said.endswith(", Waist, which the robot does not have. Name the policy's robot with --robot.\n")
    assert not (tmp_path / "x.mcap").exists()


def test_a_tracker_is_refused_as_no_walking_policy(tmp_path, capsys):
    tracker = ROOT / "robots/t1/policies/tracker/tracker.npz"
    assert main(["simulate-robot", str(tmp_path / "x.mcap"), "--policy", str(tracker)]) == 1
    said = capsys.readouterr().err
    assert f"{tracker}: it does not fit the robot: " in said and "Name a walking policy" in said


def test_the_folder_of_an_exported_policy_is_its_policy(tmp_path):
    made = []
    for name in ("walk", "walk/policy.npz"):
        path = tmp_path / f"{len(made)}.mcap"
        words = ["--policy", str(ROOT / "robots/t1/policies" / name), "--seconds", "0.2"]
        assert main(["simulate-robot", str(path), *words]) == 0
        made.append(path.read_bytes())
    assert made[0] == made[1]


@pytest.mark.parametrize("event", ["--push=2,20,0", "--hold=3,4", "--stop=2", "--motors-off=5,end"])
def test_an_event_after_the_logs_end_is_refused(tmp_path, capsys, event):
    assert main(["simulate-robot", str(tmp_path / "x.mcap"), "--seconds", "2", event]) == 1
    assert "the log ends at 2 s; increase --seconds." in capsys.readouterr().err


def test_a_script_and_a_policy_exclude_each_other(tmp_path, capsys):
    words = ["--script", "sway", "--policy", str(ROOT / "robots/t1/policies/walk")]
    assert main(["simulate-robot", str(tmp_path / "x.mcap"), *words]) == 1
    assert "--script and --policy exclude each other" in capsys.readouterr().err


def test_the_shipped_logs_are_what_their_commands_make(robot, tmp_path, monkeypatch):
    monkeypatch.chdir(ROOT)
    shipped = ROOT / "data/hardware_logs/demo"
    stated = json.loads((shipped / "made_by.json").read_text())
    assert {path.name for path in shipped.glob("*.mcap")} == set(stated)
    for name, arguments in stated.items():
        assert main(["simulate-robot", str(tmp_path / name), *arguments]) == 0
        made, there = (trials_in(folder / name, robot)[0] for folder in (tmp_path, shipped))
        assert there.simulated and made.policy_digest == there.policy_digest
        assert made.command == pytest.approx(there.command, nan_ok=True)
        early = made.time_s < 3.0
        assert made.joint_pos[early] == pytest.approx(there.joint_pos[early], abs=0.02, nan_ok=True)
        assert (made.fall_state == there.fall_state).mean() > 0.97
