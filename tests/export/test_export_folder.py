"""The exported folder: whole, marked as its licence allows, its golden vectors and its booster_deploy task true."""

import dataclasses
import itertools
import json

import numpy as np
import pytest

from pipeline.deployment import PolicyController, Reading, digest, load_policy, save_policy
from pipeline.deployment.task import PolicyJointsError
from pipeline.errors import FileError, SettingsError
from pipeline.expert.licence import LicenceClass
from pipeline.export import booster_deploy
from pipeline.export.__main__ import main
from pipeline.export.booster_deploy import write_task_folder
from pipeline.export.card import page, read_card
from pipeline.export.folder import Source, complete_export, export_policy, read_export, thinned
from pipeline.export.metadata import SHIPPABLE, ExportError, shipping, trained_task
from pipeline.export.parity import read_golden
from pipeline.robot.load import ROBOTS, robot_names
from pipeline.validation.cells import command_cells
from tests.factories.networks import network, network_file
from tests.factories.vendor_deploy import VendorPolicy, import_task, vendor_modules

RUN = {"name": "run7", "commit": "abc", "command": "python -m pipeline.training --seed 3", "preset": "paper", "seed": 3}
FREE = {"digest": "d" * 64, "licence": {"strictest": "attribution", "allowed_use": "Any use; name the sources."}}
CLOSED = {
    "digest": "e" * 64,
    "licence": {
        "strictest": "non-commercial",
        "allowed_use": "Research and other non-commercial use; name the sources.",
        "licences": {"CC0-1.0": "public-domain", "AMASS, academic use": "non-commercial"},
    },
}


def exported(folder, robot, data=FREE, shippable=True, compact=False):
    folder.mkdir(parents=True, exist_ok=True)
    source = Source(policy=network_file(folder / "trained.npz", robot), run=RUN, data=data)
    rng = np.random.default_rng(0)
    return export_policy(folder / "out", "walk", robot, source, rng, shippable=shippable, compact=compact)


@pytest.fixture(scope="module")
def export(tmp_path_factory, robot):
    folder = tmp_path_factory.mktemp("export")
    exported(folder, robot)
    return read_export(folder / "out", robot)


@pytest.mark.parametrize("name", robot_names())
def test_the_page_of_a_shipped_policy_shows_all_facts_of_its_card(name):
    folder = ROBOTS / name / "policies" / "walk"
    assert (folder / "CARD.md").read_text() == page(read_card(folder))


def test_an_export_reads_as_it_was_written(export, robot):
    assert export.card.digest == digest(export.policy)
    assert export.card.network["sizes"] == [720, 32, 16, 21]
    assert export.card.run == RUN
    assert export.card.shippable
    assert export.card.parity["onnx"] <= 1e-5
    assert set(export.card.files) >= {"policy.npz", "policy.onnx", "golden.npz", "booster_deploy/README.md"}
    text = (export.folder / "CARD.md").read_text()
    for said in ("run7", "abc", "python -m pipeline.training --seed 3", "attribution", "Any use"):
        assert said in text


def test_a_file_that_was_changed_is_named(tmp_path, robot):
    exported(tmp_path, robot)
    (tmp_path / "out" / "golden.npz").write_bytes(b"other")
    with pytest.raises(FileError, match=r"golden.npz: missing, or different from the digest in the card"):
        read_export(tmp_path / "out", robot)


def test_a_compact_export_is_completed_to_the_files_of_a_full_one(tmp_path, robot):
    full, compact = exported(tmp_path / "full", robot), exported(tmp_path / "compact", robot, compact=True)
    assert set(full.files) - set(compact.files) >= {"policy.onnx", "booster_deploy/tasks/booster_lab/models/policy.pt"}
    assert sorted(path.name for path in (tmp_path / "compact" / "out").iterdir()) == [
        "CARD.md",
        "card.json",
        "golden.npz",
        "policy.npz",
    ]
    assert read_export(tmp_path / "compact" / "out", robot).card == compact
    command = [str(tmp_path / "compact" / "out"), "--out", str(tmp_path / "completed")]
    assert main(command) == 0
    assert read_export(tmp_path / "completed", robot).card == full


def test_completing_drops_what_an_earlier_export_left(tmp_path, robot):
    exported(tmp_path, robot, compact=True)
    (tmp_path / "done").mkdir()
    (tmp_path / "done" / "curves.csv").write_text("iteration\n")
    card = complete_export(tmp_path / "out", tmp_path / "done", robot, np.random.default_rng(0))
    assert "curves.csv" not in card.files
    assert not (tmp_path / "done" / "curves.csv").exists()


@pytest.mark.parametrize(
    "name", ["booster_deploy/.git/HEAD", "booster_deploy/tasks/walk/walk.py", "config.json", "amp/curves.csv"]
)
def test_what_is_no_export_is_never_replaced(tmp_path, robot, name):
    """The vendor's program has the name of our task's folder, and a run our names of network and curves."""
    out = tmp_path / "out"
    (out / name).parent.mkdir(parents=True)
    for each in (out / name, out / "policy.npz"):
        each.write_text("of somebody")
    with pytest.raises(ExportError, match=rf"holds other files \({name}\) .* Name an empty folder"):
        exported(tmp_path, robot)
    assert (out / name).read_text() == (out / "policy.npz").read_text() == "of somebody"


def test_a_robot_without_a_vendor_task_is_refused_before_an_earlier_export_goes(tmp_path, robot, monkeypatch):
    card = exported(tmp_path, robot)
    monkeypatch.setattr(booster_deploy, "ROBOTS", tmp_path / "none")
    with pytest.raises(SettingsError, match="has no configuration"):
        exported(tmp_path, robot)
    assert read_export(tmp_path / "out", robot).card == card


def test_an_export_is_not_completed_in_place_nor_if_it_was_changed(tmp_path, robot, capsys):
    exported(tmp_path, robot, compact=True)
    assert main([str(tmp_path / "out"), "--out", str(tmp_path / "out")]) == 2
    assert "can't be completed in place" in capsys.readouterr().err
    (tmp_path / "out" / "policy.npz").write_bytes(b"other")
    with pytest.raises(FileError, match=r"policy.npz: missing, or different from the digest in the card"):
        complete_export(tmp_path / "out", tmp_path / "done", robot, np.random.default_rng(0))


def test_a_folder_without_a_card_is_no_export(tmp_path, robot):
    exported(tmp_path, robot)
    (tmp_path / "out" / "card.json").unlink()
    with pytest.raises(FileError, match=r"no exported policy here. Export one: python -m pipeline.export"):
        read_export(tmp_path / "out", robot)


def test_in_place_of_a_run_its_export_is_named(tmp_path, robot):
    exported(tmp_path, robot)
    (tmp_path / "run").mkdir()
    (tmp_path / "out").rename(tmp_path / "run" / "export")
    with pytest.raises(FileError, match=r"no exported policy here. Name .*/run/export\."):
        read_export(tmp_path / "run", robot)


@pytest.mark.parametrize("data", [CLOSED, {}, {"licence": {"strictest": "no-derivatives"}}])
def test_a_policy_of_closed_data_is_not_marked_shippable(tmp_path, robot, data):
    with pytest.raises(ExportError, match=r"policy 'walk' can't be marked shippable: the strictest licence"):
        exported(tmp_path, robot, data)
    assert not (tmp_path / "out").exists()


def test_it_can_be_exported_unmarked_and_says_why(tmp_path, robot):
    card = exported(tmp_path, robot, CLOSED, shippable=False)
    assert not card.shippable
    assert "AMASS, academic use" in card.why
    assert "CC0" not in card.why


def test_every_class_of_licence_is_decided():
    allowed = {kind for kind in LicenceClass if shipping({"licence": {"strictest": kind.label}})[0]}
    assert {kind.label for kind in allowed} == set(SHIPPABLE)
    assert allowed == {kind for kind in LicenceClass if kind < LicenceClass.NON_COMMERCIAL}


def test_a_policy_without_gains_is_refused(tmp_path, robot):
    save_policy(tmp_path / "bare.npz", dataclasses.replace(network(robot, np.random.default_rng(0)), gains=None))
    source = Source(policy=tmp_path / "bare.npz", run=RUN, data=FREE)
    with pytest.raises(ExportError, match=r"has no gains"):
        export_policy(tmp_path / "out", "bare", robot, source, np.random.default_rng(0), shippable=False)


def test_gains_in_another_joint_order_arrive_by_name(robot):
    policy = network(robot, np.random.default_rng(0))
    assert policy.gains is not None
    kp = np.arange(len(robot.joint_names), dtype=float)
    turned = dataclasses.replace(policy.gains, joint_names=tuple(reversed(robot.joint_names)), kp=kp[::-1])
    np.testing.assert_array_equal(trained_task(robot, dataclasses.replace(policy, gains=turned)).kp, kp)
    lacking = dataclasses.replace(policy.gains, joint_names=("Neck", *robot.joint_names[1:]))
    with pytest.raises(PolicyJointsError, match=f"lacks the joints {robot.joint_names[0]} and has Neck, which"):
        trained_task(robot, dataclasses.replace(policy, gains=lacking))


def test_golden_vectors_are_what_the_controller_does(export):
    golden = read_golden(export.folder / "golden.npz")
    assert len(golden.command) == 50
    controller = PolicyController(export.task, export.policy)
    for step in range(50):
        reading = Reading(
            gyro_b=golden.gyro_b[step],
            gravity_b=golden.gravity_b[step],
            joint_pos=golden.joint_pos[step],
            joint_vel=golden.joint_vel[step],
        )
        targets = controller.targets(reading, golden.command[step])
        np.testing.assert_array_equal(targets, golden.targets[step])
        np.testing.assert_array_equal(controller.observation, golden.observation[step])


def test_golden_readings_are_a_robots(export, robot):
    """Gravity is a unit vector that points down at first, positions start at the default pose, history fills."""
    golden = read_golden(export.folder / "golden.npz")
    np.testing.assert_allclose(np.linalg.norm(golden.gravity_b, axis=1), 1.0, atol=1e-9)
    np.testing.assert_array_equal(golden.gravity_b[0], [0.0, 0.0, -1.0])
    np.testing.assert_array_equal(golden.joint_pos[0], robot.default_joint_pos)
    assert np.abs(golden.joint_vel).max() > 0.1
    frames = golden.observation.reshape(50, 10, 72)
    np.testing.assert_array_equal(frames[0, :9], 0.0)
    np.testing.assert_array_equal(frames[30, 3], frames[27, 6])
    np.testing.assert_array_equal(frames[30, -1, 51:], golden.action[29])


def test_the_golden_gyroscope_is_the_rate_at_which_gravity_turns(export):
    """A vector that is fixed in the world turns in the body's frame by g x w; steps by the trapezoidal rule."""
    golden = read_golden(export.folder / "golden.npz")
    turning = np.cross(golden.gravity_b, golden.gyro_b)
    rate, expected = np.diff(golden.gravity_b, axis=0) / 0.02, 0.5 * (turning[1:] + turning[:-1])
    assert np.abs(expected).max() > 0.1
    assert np.linalg.norm(rate - expected) < 0.2 * np.linalg.norm(expected)


def test_the_task_of_booster_deploy_has_the_policys_numbers(export, robot):
    with vendor_modules(robot) as registered:
        import_task(export.folder / "booster_deploy" / "tasks" / "booster_lab")
    cfg = registered["booster_lab_walk"]
    assert cfg.policy_dt == 0.02
    assert cfg.robot.joint_stiffness == robot.kp.tolist()
    assert cfg.robot.joint_damping == robot.kd.tolist()
    assert cfg.robot.default_joint_pos == robot.default_joint_pos.tolist()
    assert cfg.robot.effort_limit == robot.torque_limit.tolist()
    assert cfg.policy.policy_joint_names == list(export.task.policy_joints)
    assert (cfg.policy.action_scale, cfg.policy.actor_obs_history_length) == (0.25, 10)
    assert 0.0 <= cfg.mujoco.init_pos[2] - robot.default_root_height < 0.01


def test_the_joystick_commands_nothing_beyond_what_is_validated(export, robot):
    """Forward, sideways and turning, in both directions; at least half of the speed that is validated."""
    with vendor_modules(robot) as registered:
        import_task(export.folder / "booster_deploy" / "tasks" / "booster_lab")
    sticks = registered["booster_lab_walk"].vel_command
    validated = np.max([cell.trials[0].command.last.goal for cell in command_cells((0,))], axis=0)
    for largest, most in zip((sticks.vx_max, sticks.vy_max, sticks.vyaw_max), validated, strict=True):
        assert 0.5 * most <= largest <= most


def test_the_vendors_inference_gives_the_golden_targets(export, robot):
    golden = read_golden(export.folder / "golden.npz")
    with vendor_modules(robot) as registered:
        import_task(export.folder / "booster_deploy" / "tasks" / "booster_lab")
    vendor = VendorPolicy(registered["booster_lab_walk"])
    for step in range(len(golden.command)):
        targets = vendor.targets(
            golden.gyro_b[step],
            golden.gravity_b[step],
            golden.command[step],
            golden.joint_pos[step],
            golden.joint_vel[step],
        )
        assert np.abs(targets - golden.targets[step]).max() < 1e-5


def test_a_robot_with_other_joints_stops_the_import(export, robot):
    renamed = dataclasses.replace(robot, joint_names=("Neck", *robot.joint_names[1:]))
    with (
        vendor_modules(renamed),
        pytest.raises(ValueError, match=r"joints of the policy are not those of T1_23DOF_CFG"),
    ):
        import_task(export.folder / "booster_deploy" / "tasks" / "booster_lab")


def test_a_robot_that_booster_deploy_lacks_is_refused(tmp_path, export):
    with pytest.raises(SettingsError, match=r"g1/deployment.yaml: booster_deploy has no configuration of 'g1'"):
        write_task_folder(tmp_path, dataclasses.replace(export.task, robot="g1"), export.policy, 0.7)


def test_long_curves_are_thinned_to_evenly_spaced_rows_and_the_last():
    rows = [f"{number},{number**2}\n" for number in range(1, 1002)]
    header, *kept = thinned("".join(["iteration,seconds\n", *rows])).splitlines(keepends=True)
    places = [rows.index(row) for row in kept]
    assert header == "iteration,seconds\n"
    assert 100 < len(kept) <= 200
    assert len({later - earlier for earlier, later in itertools.pairwise(places)}) == 1
    assert places[-1] == 1000
    short = "".join(["iteration,seconds\n", *rows[:200]])
    assert thinned(short) == short
    assert thinned("") == ""


def test_the_command_exports_a_run(tmp_path, robot, capsys):
    run, out = tmp_path / "run7", tmp_path / "out"
    run.mkdir()
    network_file(run / "policy.npz", robot)
    about = {"database_digest": "d1", "licence": FREE["licence"], "clips": 4, "seconds": 9.5}
    (run / "config.json").write_text(json.dumps({"preset": "paper", "seed": 3, "bundle": about}))
    stages = {"distillation": {"resumed_at": []}, "amp": {"resumed_at": [100, 200]}}
    (run / "done.json").write_text(json.dumps({"iterations": 300, "seconds": 1200.0, "stages": stages}))
    (run / "curves.csv").write_text("iteration\n1\n")
    command = [str(run), "--name", "walk", "--out", str(out), "--shippable", "--commit", "abc"]
    assert main(command) == 0
    card = read_card(out)
    assert (card.run["name"], card.run["iterations"], card.run["commit"]) == ("run7", 300, "abc")
    assert (card.data["digest"], card.data["clips"]) == ("d1", 4)
    assert "curves.csv" in card.files
    assert "| 300 iterations, 1200.0 s; continued: amp at 100, 200 |" in (out / "CARD.md").read_text()
    (run / "validation").mkdir()
    measured = {"policy": card.digest, "figures": {"required cells": 97.0}}
    (run / "validation" / "figures.json").write_text(json.dumps(measured))
    assert main(command) == 0 and read_card(out).figures == measured
    other = network_file(tmp_path / "other.npz", robot, seed=5)
    assert main([*command, "--policy", str(other)]) == 0
    assert read_card(out).figures == {}, "what was measured of another policy is not stated"
    assert main([*command, "--figures", str(tmp_path / "none.json")]) == 2
    assert "none.json: the file does not exist. Name a JSON file with figures." in capsys.readouterr().err
    closed = {**about, "licence": CLOSED["licence"]}
    (run / "config.json").write_text(json.dumps({"preset": "paper", "seed": 3, "bundle": closed}))
    assert main(command) == 2
    assert "can't be marked shippable" in capsys.readouterr().err
    (run / "config.json").write_text(json.dumps({"preset": "paper"}))
    assert main(command) == 2
    assert "names no database" in capsys.readouterr().err


def test_the_same_policy_is_exported_to_the_same_bytes(tmp_path, robot):
    cards = [exported(tmp_path / name, robot) for name in "ab"]
    assert cards[0] == cards[1]
    assert load_policy(tmp_path / "a" / "out" / "policy.npz").gains is not None
