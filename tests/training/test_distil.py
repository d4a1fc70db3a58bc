"""One network taught by several policies, on the CPU: what it learns, its files, and going on."""

from __future__ import annotations

import csv
import hashlib
import json

import numpy as np
import pytest
import torch

from pipeline.learning.checkpoint import load_checkpoint
from pipeline.training import distil
from pipeline.training.bundle import read_bundle
from pipeline.training.command import main as train
from pipeline.training.distil_request import BATCH, DistilRequest
from pipeline.training.distilled_run import LAST_RATE, STEPS, DistilledRun
from pipeline.training.export_policy import main as export
from pipeline.training.given_network import network_of
from pipeline.training.mirror import Mirror
from pipeline.training.observations import newest_command
from pipeline.training.option_texts import changed_by_texts
from pipeline.training.presets import preset
from pipeline.training.roles import ROLES
from tests.factories.distil_folder import APART, ENVS, HALF_STAND, asked, distil_folder

ITERATIONS = 12
RATE = 1e-3
"""What `--rate` is where it is not said."""
SMALL = ["expert_windows=200", "replay_windows=200", "discriminator_batch=32", "discriminator_steps=2", "steps=4"]


@pytest.fixture(scope="module")
def folder(tmp_path_factory, root, robot):
    return distil_folder(tmp_path_factory.mktemp("distil"), root, robot)


def request(folder, out, **more) -> DistilRequest:
    """Of 200 robots that are taught by the shipped policy alone, but for what `more` says."""
    plain = {
        "out": out,
        "preset": "refined_steps",
        "options": preset("refined_steps"),
        "teachers": {"other": folder / "walks.npz"},
        "start_from": None,
        "num_envs": 200,
        "device": "cpu",
        "seed": 1,
        "iterations": 1,
        "minutes": None,
        "resume": False,
        "memory": BATCH,
        "passes": 1.0,
    }
    return DistilRequest(**plain | more)


def read_json(path):
    return json.loads(path.read_text())


def digest(path) -> str:
    return hashlib.sha256(path.read_bytes()).hexdigest()


@pytest.fixture(scope="module")
def taught(folder):
    out = folder / "taught"
    assert distil.main(asked(folder, out, "--iterations", str(ITERATIONS))) == 0
    return out


def test_the_loss_of_who_stands_falls(taught):
    """The network begins as `other` is, so that it is off by APART where robots stand, and by nothing elsewhere."""
    rows = list(csv.DictReader((taught / "curves.csv").read_text().splitlines()))
    assert [int(row["iteration"]) for row in rows] == list(range(1, ITERATIONS + 1))
    loss = {name: [float(row[name]) for row in rows] for name in ("loss", *(f"loss_{role}" for role in ROLES))}
    assert loss["loss_standing"][0] == pytest.approx(APART**2, rel=1e-3)
    assert loss["loss_other"][0] == pytest.approx(0.0, abs=1e-6)
    assert np.isnan([loss["loss_ahead"][0], loss["loss_pushed"][0]]).all()
    assert np.mean(loss["loss_standing"][-3:]) < 0.3 * loss["loss_standing"][0]
    assert np.mean(loss["loss"][-3:]) < 0.5 * loss["loss"][0]
    rates = [float(row["learning_rate"]) for row in rows]
    assert rates[0] == pytest.approx(RATE)
    assert rates == sorted(rates, reverse=True) and LAST_RATE * RATE < rates[-1] < 0.1 * RATE


def test_one_network_does_by_the_command_what_two_teachers_do(folder, tmp_path):
    """Of the states of one walk it learns both: in the middle between the two it would be off by a quarter of APART**2
    in each role."""
    asked_for = request(
        folder,
        tmp_path,
        options=changed_by_texts(preset("refined_steps"), dict(text.split("=") for text in HALF_STAND)),
        teachers={"other": folder / "walks.npz", "standing": folder / "stands.npz"},
        num_envs=ENVS,
        passes=40 * BATCH / (STEPS * ENVS),
    )
    run = DistilledRun(read_bundle(folder / "bundle"), asked_for)
    run._walk(led=1.0)
    assert run.memory.filled == STEPS * ENVS
    run._learn()
    seen, told = run.memory.drawn(2000)
    with torch.no_grad():
        off = torch.square(run._answer(seen) - told).mean(dim=1)
    stands = (newest_command(seen) == 0.0).all(dim=1)
    assert 0.05 < stands.float().mean() < 0.95
    for member in (stands, ~stands):
        assert off[member].mean() < 0.1 * APART**2


def test_half_of_the_states_of_a_role_are_learned_as_their_mirror_images(folder, tmp_path):
    """Those of other roles are not; a state and what is told of it are turned together."""
    bundle = read_bundle(folder / "bundle")
    run = DistilledRun(bundle, request(folder, tmp_path, mirror_roles=("ahead", "run")))
    mirror = Mirror(bundle.robot, "cpu")
    told = torch.randn(200, 21)
    role = torch.arange(200) % len(ROLES)
    seen, learned = run._as_learned(role, told)
    same = (seen == run._seen).all(dim=1) & (learned == told).all(dim=1)
    turned = (seen == mirror.seen(run._seen)).all(dim=1) & (learned == mirror.actions(told)).all(dim=1)
    taken = (role == ROLES.index("ahead")) | (role == ROLES.index("run"))
    assert (same ^ turned).all() and same[~taken].all()
    assert 0.25 < turned[taken].float().mean() < 0.75


def test_what_is_learned_is_what_is_put_into_the_memory(folder, tmp_path, monkeypatch):
    run = DistilledRun(read_bundle(folder / "bundle"), request(folder, tmp_path))
    monkeypatch.setattr(run, "_as_learned", lambda role, told: (run._seen + 1.0, torch.full_like(told, 7.0)))
    run._walk(led=0.0)
    assert (run.memory.drawn(500)[1] == 7.0).all()


def test_a_run_goes_on_that_was_begun_before_there_was_an_option(folder, tmp_path):
    assert distil.main(asked(folder, tmp_path, "--iterations", "1")) == 0
    config = read_json(tmp_path / "config.json")
    for name in ("beyond", "mirror_roles"):
        del config[name]
    (tmp_path / "config.json").write_text(json.dumps(config))
    assert distil.main(asked(folder, tmp_path, "--iterations", "2", "--resume")) == 0


def test_a_run_leaves_the_files_of_training(folder, taught):
    found = sorted(path.relative_to(taught).as_posix() for path in taught.rglob("*") if path.is_file())
    newest = f"checkpoints/model_{ITERATIONS:06d}.pt"
    assert found == [newest, "config.json", "curves.csv", "done.json", "policy.npz"]
    done, config = read_json(taught / "done.json"), read_json(taught / "config.json")
    assert (done["reason"], done["iterations"], done["steps"]) == ("iterations", ITERATIONS, ITERATIONS * STEPS * ENVS)
    walks, stands = digest(folder / "walks.npz"), digest(folder / "stands.npz")
    assert config["teachers"] == {"other": walks, "standing": stands}
    assert config["start_from"] == walks
    assert config["options"]["standing_share"] == 0.5
    assert (config["preset"], config["memory"], config["passes"]) == ("refined_steps", BATCH, 60.0)
    assert load_checkpoint(taught / newest, "cpu")["environment_steps"] == ITERATIONS * STEPS


def test_its_checkpoint_is_exported_as_its_policy_is(folder, taught, tmp_path):
    path = taught / "checkpoints" / f"model_{ITERATIONS:06d}.pt"
    bundle = str(folder / "bundle")
    assert export(["--checkpoint", str(path), "--bundle", bundle, "--out", str(tmp_path / "policy.npz")]) == 0
    assert (tmp_path / "policy.npz").read_bytes() == (taught / "policy.npz").read_bytes()


def test_training_goes_on_from_its_policy(folder, taught, tmp_path):
    """The critic learns alone at first, so that after two iterations the network is still the given one, and so are the
    units in which it is told what it sees."""
    policy = taught / "policy.npz"
    given = network_of(policy, read_bundle(folder / "bundle").robot)
    begun = network_of(folder / "walks.npz", read_bundle(folder / "bundle").robot)
    np.testing.assert_array_equal(given["mean"], begun["mean"])
    assert np.abs(given["L0_w"] - begun["L0_w"]).max() > 1e-3
    sets = [f"--set={text}" for text in (*SMALL, "keep=0")]
    arguments = ["--bundle", str(folder / "bundle"), "--out", str(tmp_path), "--preset", "refined_steps", *sets]
    arguments += ["--device", "cpu", "--num-envs", "4", "--iterations", "2", "--start-from", str(policy)]
    assert train(arguments) == 0
    assert read_json(tmp_path / "config.json")["start_from"] == digest(policy)
    with np.load(tmp_path / "policy.npz") as gone_on:
        for name in ("mean", "std"):
            np.testing.assert_allclose(gone_on[name], given[name], rtol=1e-6)
        for number in range(4):
            for part in "wb":
                np.testing.assert_array_equal(gone_on[f"L{number}_{part}"], given[f"L{number}_{part}"])


def test_runs_of_one_seed_are_equal_and_go_on_where_they_were_left(folder, tmp_path, capsys):
    begin = ["--start-from", str(folder / "stands.npz")]
    outs = tmp_path / "a", tmp_path / "b"
    for out in outs:
        assert distil.main(asked(folder, out, "--iterations", "2", *begin)) == 0
    left = (outs[0] / "policy.npz").read_bytes()
    assert left == (outs[1] / "policy.npz").read_bytes()
    assert read_json(outs[0] / "config.json")["start_from"] == digest(folder / "stands.npz")

    out = outs[0]
    on = ["--resume", "--iterations", "5"]
    assert distil.main(asked(folder, out, *on, "--minutes", "1e-6")) == 0
    done = read_json(out / "done.json")
    assert (done["reason"], done["iterations"]) == ("minutes", 2)
    assert (out / "policy.npz").read_bytes() == left

    config = (out / "config.json").read_bytes()
    capsys.readouterr()
    for other, told in (
        (["--teacher", f"pushed={folder / 'stands.npz'}"], 'was begun with pushed none, not "'),
        (["--ahead", ".4"], "config.json: the run was begun with ahead_m_s 0.55, not 0.4; ask the same, or give"),
        (["--walks", "other=1:1.1"], 'was begun with other none, not "1:1.1"'),
        (["--both-sides", "other"], 'was begun with both_sides [], not ["other"]'),
        (["--with-error", "other"], 'was begun with with_error [], not ["other"]'),
        (["--mirror-role", "ahead"], 'was begun with mirror_roles [], not ["ahead"]'),
        (["--clip-joint", "Elbow"], 'was begun with clip_joints [], not ["Elbow"]'),
        (["--clip-role", "run"], 'was begun with clip_roles ["ahead", "fast"], not ["run"]'),
        (["--start-from", str(folder / "walks.npz")], "walks.npz: is not what the run"),
    ):
        assert distil.main(asked(folder, out, *on, *other)) == 2
        assert told in capsys.readouterr().err
    assert (out / "config.json").read_bytes() == config
    assert (out / "policy.npz").read_bytes() == left

    same = ["--clip-role", "fast", "--clip-role", "ahead"]
    assert distil.main(asked(folder, out, "--resume", "--iterations", "3", *same)) == 0
    assert "iteration 3 of 3" in capsys.readouterr().out
    rows = list(csv.DictReader((out / "curves.csv").read_text().splitlines()))
    assert [int(row["iteration"]) for row in rows] == [1, 2, 3]
    assert read_json(out / "done.json")["steps"] == 3 * STEPS * ENVS
    assert read_json(out / "config.json")["start_from"] == digest(folder / "stands.npz")
    assert load_checkpoint(out / "checkpoints" / "model_000003.pt", "cpu")["environment_steps"] == 3 * STEPS
    assert (out / "policy.npz").read_bytes() != left
