"""Runs side by side on the CPU: trained, swept, chosen, packed, taken up again; and the walk that they are swept by."""

from __future__ import annotations

import dataclasses
import json
import zipfile
from concurrent.futures import Future
from pathlib import Path

import numpy as np
import pytest

from pipeline.deployment import load_policy
from pipeline.training import arm_pack
from pipeline.training.arm_sweeps import Candidate, _figures, best, candidates
from pipeline.training.arms import Arm, ArmProcess, ArmsRequest, write_json
from pipeline.training.checkpoint_sweep import (
    COMMANDS,
    cells_of,
    choosing_walks,
    measuring_walks,
    name_of,
    score,
)
from pipeline.training.plain_walk import Walk, walked
from pipeline.training.train_arms import main, status_text
from pipeline.validation.cells import command_cells
from pipeline.validation.checkpoint_choice import swept
from pipeline.validation.deployed import deployed
from pipeline.validation.measure import Measured, measure
from pipeline.validation.push_cells import push_cell
from tests.factories.training_bundle import small_bundle

SMALL = ["expert_windows=200", "replay_windows=200", "discriminator_batch=32", "discriminator_steps=1", "steps=4"]
SHIPPED = Path("robots/t1/policies/walk/policy.npz")


@pytest.fixture(scope="module")
def bundle_folder(tmp_path_factory, root, robot):
    return small_bundle(tmp_path_factory.mktemp("arms"), root, robot)


def request_of(tmp_path, *arms: Arm) -> ArmsRequest:
    return ArmsRequest(
        bundle=tmp_path,
        out=tmp_path,
        preset="gated_style",
        arms=arms or (Arm(name="a", seed=1),),
        device="cpu",
        gpus=0,
        num_envs=8,
        iterations=2,
        minutes=None,
    )


def test_all_arms_go_on_from_a_policy_that_is_given(tmp_path):
    request = request_of(tmp_path, Arm(name="a", seed=1), Arm(name="b", seed=2))
    assert all("--start-from" not in request.command(arm) for arm in request.arms)
    request = dataclasses.replace(request, start_from=tmp_path / "policy.npz")
    for arm in request.arms:
        command = request.command(arm)
        assert command[command.index("--start-from") + 1] == str(tmp_path / "policy.npz")


def test_two_arms_are_trained_swept_chosen_packed_and_left_alone_when_done(bundle_folder, tmp_path, capsys):
    given = ["run", "--bundle", str(bundle_folder), "--out", str(tmp_path / "out"), "--pack", str(tmp_path / "pack")]
    given += ["--device", "cpu", "--num-envs", "8", "--iterations", "2", "--workers", "1", "--sweep", "brief"]
    given += ["--seeds", "1", "--arm", "plain", "2", "style=0", *(text for each in SMALL for text in ("--set", each))]
    assert main(given) == 0
    packed = {path.name: path.stat().st_size for path in (tmp_path / "pack").iterdir()}
    assert set(packed) == {"choice.json", "arms.zip", "seed1.pt", "plain.pt"}
    assert max(packed.values()) <= arm_pack.LARGEST
    choice = json.loads((tmp_path / "pack" / "choice.json").read_text())
    assert choice["left_out"] == []
    assert {name: told["state"] for name, told in choice["arms"].items()} == {"seed1": "trained", "plain": "trained"}
    assert all(told["final"] and told["chosen"] == "000002" for told in choice["arms"].values())
    with zipfile.ZipFile(tmp_path / "pack" / "arms.zip") as archive:
        names = set(archive.namelist())
        archive.extract("plain/policies/000002.npz", tmp_path)
    assert {f"seed1/{name}" for name in ("curves.csv", "config.json", "done.json", "policies/000002.npz")} <= names
    assert load_policy(tmp_path / "plain" / "policies" / "000002.npz").gains is not None
    assert json.loads((tmp_path / "out" / "plain" / "config.json").read_text())["options"]["style"] == 0.0
    before = {path: path.stat().st_mtime_ns for path in (tmp_path / "out").rglob("*.pt")}
    assert main(given) == 0
    assert {path: path.stat().st_mtime_ns for path in (tmp_path / "out").rglob("*.pt")} == before
    assert main(["wait", "--out", str(tmp_path / "out"), "--seconds", "1"]) == 0
    assert "measured 000002 of 1: falls" in capsys.readouterr().out


def test_arms_are_refused_without_names_of_their_own_and_in_another_runs_folder(bundle_folder, tmp_path, capsys):
    start = ["run", "--bundle", str(bundle_folder), "--out", str(tmp_path), "--device", "cpu"]
    assert main(start) == 2
    assert main([*start, "--seeds", "1", "1"]) == 2
    assert main([*start, "--seeds", "1", "--set", "stile=1"]) == 2
    assert main([*start, "--arm", "a"]) == 2
    write_json(tmp_path / "seed1" / "command.json", ["-m", "another"])
    assert main([*start, "--seeds", "1"]) == 2
    errors = capsys.readouterr().err
    for text in ("each needs a name", "unknown option 'stile'", "must be NAME SEED", "is another run's folder"):
        assert text in errors
    assert main(["status", "--out", str(tmp_path / "nothing")]) == 2


def test_gpus_are_given_in_turn_and_a_run_that_breaks_off_is_started_three_times(tmp_path, monkeypatch):
    arms = tuple(Arm(name=name, seed=1) for name in "abc")
    request = request_of(tmp_path, *arms)
    two = ArmsRequest(**{**vars(request), "gpus": 2, "device": "cuda"})
    given = [
        ArmProcess(request=two, arm=arm, number=at)._environment()["CUDA_VISIBLE_DEVICES"]
        for at, arm in enumerate(arms)
    ]
    assert given == ["0", "1", "0"]
    monkeypatch.setattr(ArmsRequest, "command", lambda self, arm: ["-c", "raise SystemExit('broken')"])
    process = ArmProcess(request=request, arm=arms[0], number=0)
    for _ in range(3):
        process.keep_going()
        assert process.process is not None
        process.process.wait()
    process.keep_going()
    assert process.failed
    assert process.last_line() == "broken"


def test_a_run_that_another_process_trains_is_not_started_again(tmp_path, monkeypatch):
    monkeypatch.setattr(ArmsRequest, "command", lambda self, arm: ["-c", "import time; time.sleep(60)"])
    first, second = (ArmProcess(request=request_of(tmp_path), arm=Arm(name="a", seed=1), number=0) for _ in range(2))
    first.keep_going()
    second.keep_going()
    assert second.running()
    assert second.process is None
    first.stop()
    assert not second.running()


def test_candidates_are_late_checkpoints_and_at_the_end_means_of_the_last(tmp_path):
    states = [tmp_path / f"model_{number:06d}.pt" for number in (100, 200, 300, 350)]
    assert [each.name for each in candidates(tmp_path, states, 200, done=False)] == ["000200", "000300", "000350"]
    ended = [each.name for each in candidates(tmp_path, states, 200, done=True)]
    assert ended[3:] == ["mean-000300-000350", "mean-000200-000300-000350"]
    assert [each.name for each in candidates(tmp_path, states, 900, done=True)] == ["000350"]
    found = candidates(tmp_path, states, 200, done=False)
    assert best(found, "chosen_by") is None
    for each, value in zip(found, (3.0, 1.0, 1.0), strict=True):
        write_json(each.sweep("chosen_by"), {"score": value})
    assert best(found, "chosen_by") == Candidate(folder=tmp_path, checkpoints=(states[3],))


def test_what_does_not_fit_is_left_out_and_said(tmp_path, monkeypatch):
    processes = []
    for name in ("a", "b"):
        folder = tmp_path / name / "checkpoints"
        folder.mkdir(parents=True)
        (folder / "model_000100.pt").write_bytes(b"0" * 100)
        processes.append(ArmProcess(request=request_of(tmp_path), arm=Arm(name=name, seed=1), number=0))
    monkeypatch.setattr(arm_pack, "FILES", 3)
    left = arm_pack.pack(tmp_path / "pack", processes, {"arms": {}})
    assert left == ["model_000100.pt of b (100 bytes)"]
    assert sorted(path.name for path in (tmp_path / "pack").iterdir()) == ["a.pt", "arms.zip", "choice.json"]


def test_the_sweep_has_the_cells_of_validation_and_the_measuring_other_trials():
    cells = {walk.cell for walk in choosing_walks()}
    assert {name_of(command) for command in COMMANDS} <= cells
    assert len(COMMANDS) == 16
    assert not set(choosing_walks()) & set(measuring_walks())


def test_the_score_is_the_one_of_validation():
    rows = []
    for cell in command_cells((1, 2)):
        wanted = np.array(cell.trials[0].command.wanted[-1].goal)
        numbers = dict(zip(("forward", "lateral", "yaw_rate"), (wanted + 0.1).tolist(), strict=True))
        rows.append(
            Measured(
                cell=cell, trials=({"fell": 0.0, **numbers}, {"fell": 1.0 if wanted[0] == 2.0 else 0.0, **numbers})
            )
        )
    expected = swept(0, rows)
    found = {}
    for row in rows:
        goal = row.cell.trials[0].command.wanted[-1].goal
        figures = [dict(each) if not each["fell"] else {"fell": 1.0} for each in row.trials]
        found |= cells_of([Walk(cell=name_of(goal), command=goal)] * 2, figures)
    ours = score(found)
    assert (ours["falls"], ours["survival"]) == (expected.falls, 0.0)
    fallen_counts_whole = (1.0 * 2.0 - 1.0 * 0.1) / 2.0 / 16.0
    assert ours["command_error"] == pytest.approx(expected.command_error + fallen_counts_whole, abs=1e-6)


@pytest.mark.parametrize("command", [(0.6, 0.0, 0.0), (0.0, 0.0, 1.0)])
def test_a_walk_gives_the_figures_of_the_validations_own(bundle_folder, root, command):
    """Two programs, one robot: written apart, they agree to a few per cent."""
    one = deployed(bundle_folder.parent / "robot", load_policy(root / SHIPPED))
    (cell,) = (each for each in command_cells((0,)) if each.trials[0].command.wanted[-1].goal == command)
    (expected,) = measure(one, [cell])[0].trials
    found = walked(bundle_folder, root / SHIPPED, "", Walk(cell="", command=command))
    for name in ("forward", "yaw_rate"):
        assert found[name] == pytest.approx(expected[name], abs=0.05)
    assert found["power"] == pytest.approx(expected["power"], rel=0.1)
    assert found["saturation"] == pytest.approx(expected["saturation"], abs=1.0)


@pytest.mark.parametrize(("impulse", "falls"), [(50.0, False), (70.0, True)])
def test_a_push_that_validation_says_it_falls_by_fells_it_here(bundle_folder, root, robot, impulse, falls):
    """Straight back, to both sides of the 60 to 65 N s that it bears at most: there a digit decides."""
    cell = push_cell(robot, "force", "standing", impulse)
    straight_back = dataclasses.replace(cell, trials=cell.trials[4:5])
    one = deployed(bundle_folder.parent / "robot", load_policy(root / SHIPPED))
    assert measure(one, [straight_back])[0].fallen == ((0,) if falls else ())
    walk = Walk(cell="", command=(0.0, 0.0, 0.0), seconds=7.0, push=(-impulse, 0.0, 4.0))
    found = walked(bundle_folder, root / SHIPPED, "", walk)
    assert found["fell"] == float(falls)
    assert not falls or 4.0 < found["fell_s"] < 7.0


def test_the_status_is_what_was_told_last(tmp_path):
    (tmp_path / "log.txt").write_text("starting\n")
    assert status_text(tmp_path) == "starting"
    (tmp_path / "status.txt").write_text("12 s\n")
    assert status_text(tmp_path) == "12 s"


def test_a_walk_that_breaks_off_or_is_no_number_counts_as_a_fall(bundle_folder, root, tmp_path, capsys):
    broken: Future = Future()
    broken.set_exception(MemoryError("no room"))
    assert _figures(broken) == {"fell": 1.0}
    assert "a walk broke off: no room" in capsys.readouterr().out
    with np.load(root / SHIPPED) as arrays:
        np.savez(tmp_path / "nan.npz", **{**arrays, "L3_b": np.full_like(arrays["L3_b"], np.nan)})
    found = walked(bundle_folder, tmp_path / "nan.npz", "nan", Walk(cell="", command=(0.0, 0.0, 0.0), seconds=1.0))
    assert found["fell"] == 1.0
