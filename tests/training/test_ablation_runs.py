"""Runs of an ablation that were trained elsewhere: taken where they are one, refused with the file and what to do."""

from __future__ import annotations

import json
import re
import shlex

import pandas as pd
import pytest

from pipeline.learning.arguments import pairs
from pipeline.learning.training_error import TrainingError
from pipeline.training.__main__ import _parser, main
from pipeline.training.ablation_runs import COLUMNS, OPTION, read_runs
from pipeline.training.config import changed_by_texts, preset
from pipeline.viewing.tracking_plots import discriminator_curves
from tests.factories.ablation_runs import ARMS, change_config, write_arm_run, write_arm_runs
from tests.factories.training_bundle import small_bundle

EXTRA = ("discriminator.style=0.4", "pushes.impulse_n_s=0.0,50.0")
SMALL = ["schedule.iterations=1", "simulation.num_envs=4", "simulation.terrain=plane"]


@pytest.fixture
def bundle(tmp_path):
    """A bundle's head, which is all that is read of it."""
    folder = tmp_path / "bundle"
    folder.mkdir()
    about = {"robot": "t1", "robot_digest": "r1", "database_digest": "d1", "files": {"expert.npz": "e1"}}
    (folder / "bundle.json").write_text(json.dumps(about))
    return folder


@pytest.fixture
def runs(tmp_path, bundle):
    """Both arms with two seeds."""
    return write_arm_runs(
        tmp_path / "runs", bundle, seeds=(10, 2), discriminator__style=0.4, pushes__impulse_n_s=(0.0, 50.0)
    )


def test_runs_are_read_seed_by_seed_in_the_order_of_the_arms(runs, bundle):
    (runs / "choice.json").write_text("{}")
    found = read_runs(runs, ARMS, bundle)
    assert [run.name for run in found] == ["augmented-seed2", "original-seed2", "augmented-seed10", "original-seed10"]
    assert [(run.arm, run.seed) for run in found[1:3]] == [("original", 2), ("augmented", 10)]
    assert all(set(EXTRA) == set(run.options) for run in found)
    assert found[0].done == {"iterations": 2, "reason": "minutes", "seconds": 3.0}


def test_the_command_makes_the_run_again(runs, bundle):
    run = read_runs(runs, ARMS, bundle)[1]
    python, flag, module, *arguments = shlex.split(run.command(bundle))
    assert (python, flag, module) == ("python", "-m", "pipeline.training")
    given = _parser().parse_args(arguments)
    assert (given.bundle, given.preset, given.device, given.physics) == (bundle, "paper", "cuda", "warp")
    assert given.seed == 2
    changes = {OPTION: False, "discriminator.style": 0.4, "pushes.impulse_n_s": (0.0, 50.0)}
    assert changed_by_texts(preset(given.preset), pairs(given.set)) == preset("paper").changed(changes)


def test_the_command_has_the_runs_number_of_gpus(runs, bundle):
    for run in runs.iterdir():
        change_config(run, lambda config: config.update(processes=4))
    command = read_runs(runs, ARMS, bundle)[0].command(bundle)
    assert command.startswith("python -m torch.distributed.run --standalone --nproc-per-node=4 -m pipeline.training ")


def test_what_training_writes_is_taken(tmp_path, root, robot):
    bundle = small_bundle(tmp_path, root, robot)
    for arm, augmented in ARMS.items():
        given = ["--bundle", str(bundle), "--out", str(tmp_path / "runs" / f"{arm}-seed3"), "--seed", "3"]
        given += ["--preset", "paper", "--device", "cpu", "--stages", "amp"]
        options = [*SMALL, f"{OPTION}={str(augmented).lower()}"]
        assert main([*given, *(text for each in options for text in ("--set", each))]) == 0
    one, other = read_runs(tmp_path / "runs", ARMS, bundle)
    assert (one.arm, other.arm, one.seed, one.config["device"]) == ("augmented", "original", 3, "cpu")
    assert one.options == sorted(SMALL)
    assert "--device cpu" in one.command(bundle)
    assert other.command(bundle).endswith("--set simulation.num_envs=4 --set simulation.terrain=plane")


def test_the_columns_are_those_that_the_picture_draws():
    def picture(**columns):
        return discriminator_curves({"augmented, seed 1": pd.DataFrame(columns)}, "")

    table = {"seconds": [1.0, 2.0], "d_rollout": [-0.5, 0.5]}
    assert set(table) == set(COLUMNS)
    assert picture(**table) != picture(seconds=[1.0, 2.0])


def refused(runs, bundle) -> str:
    with pytest.raises(TrainingError) as error:
        read_runs(runs, ARMS, bundle)
    return str(error.value)


def test_a_folder_that_is_not_there_or_has_no_runs_is_refused(tmp_path, bundle):
    assert "gone: there is no such folder. Name the one" in refused(tmp_path / "gone", bundle)
    (tmp_path / "empty").mkdir()
    assert "the arms' seeds are augmented none; original none" in refused(tmp_path / "empty", bundle)


@pytest.mark.parametrize("name", ["other-seed1", "augmented-seed01", "augmented-seed1-old"])
def test_a_folder_of_another_name_is_refused(runs, bundle, name):
    (runs / name).mkdir()
    assert f"{name}: is no run's folder. Name it runs/<arm>-seed<N>, the arm augmented or original" in refused(
        runs, bundle
    )


def test_arms_of_other_seeds_are_refused(runs, bundle):
    write_arm_run(runs, bundle, arm="original", seed=3)
    assert "the arms' seeds are augmented 2, 10; original 2, 3, 10. Each arm needs the same" in refused(runs, bundle)


@pytest.mark.parametrize("name", ["config.json", "curves.csv", "policy.npz"])
def test_a_missing_file_is_refused(runs, bundle, name):
    (runs / "original-seed2" / name).unlink()
    assert f"original-seed2/{name}: there is no such file. Bring the whole folder" in refused(runs, bundle)


def test_every_unfinished_run_is_listed(runs, bundle):
    for name in ("original-seed2", "augmented-seed10"):
        (runs / name / "done.json").unlink()
    message = refused(runs, bundle)
    for name in ("original-seed2", "augmented-seed10"):
        assert f"{name}/done.json: there is none, so the run is not finished. Repeat its command" in message


@pytest.mark.parametrize("name", ["config.json", "done.json"])
@pytest.mark.parametrize(("text", "message"), [("{", "is no JSON ("), ("[1]", "is no JSON object")])
def test_a_broken_file_is_refused(runs, bundle, name, text, message):
    (runs / "augmented-seed2" / name).write_text(text)
    assert f"augmented-seed2/{name}: {message}" in refused(runs, bundle)


CONFIGS = {
    "seed": (lambda config: config.update(seed=4), "the seed is 4, the folder's name says 2. Name the folder by"),
    "augmented": (
        lambda config: config["options"].update({OPTION: True}),
        r"option 'discriminator.use_augmented' is true, arm 'original' has false. Name the folder by its arm, or train",
    ),
    "lacks": (lambda config: config.pop("preset"), "does not say preset. Take what python -m pipeline.training wrote"),
    "form": (lambda config: config.update(changed=[]), "does not say changed. Take what"),
    "contradicts": (
        lambda config: config["changed"].update({"discriminator.style": 0.1}),
        "'changed' and 'options' disagree on discriminator.style",
    ),
    "database": (
        lambda config: config["bundle"].update(database_digest="d2"),
        "was trained on another expert database than the bundle in .* Train on that bundle, or check out",
    ),
    "robot": (lambda config: config["bundle"].update(robot_digest="r2"), "was trained on another robot than"),
    "both": (
        lambda config: config["bundle"].update(robot_digest="r2", database_digest="d2"),
        "was trained on another expert database and another robot than",
    ),
    "bundle": (lambda config: config.update(bundle_digest="b2"), r"was trained on another bundle \(its files\) than"),
    "preset": (
        lambda config: config.update(preset="recipe"),
        r"differs from augmented-seed2 in more than 'discriminator.use_augmented' \(preset: paper there, recipe here\)",
    ),
    "option": (
        lambda config: config["options"].update({"discriminator.updates": 7}),
        r"differs from augmented-seed2 .*\(options.discriminator.updates: 8 there, 7 here\)",
    ),
    "size": (lambda config: config.update(num_envs=512), r"\(num_envs: 4096 there, 512 here\)"),
    "device": (lambda config: config.update(device="cpu"), r"\(device: NVIDIA H100 80GB HBM3 there, cpu here\)"),
}


@pytest.mark.parametrize("case", CONFIGS)
def test_a_config_that_makes_it_no_ablation_is_refused(runs, bundle, case):
    change, message = CONFIGS[case]
    change_config(runs / "original-seed2", change)
    assert re.search(rf"original-seed2/config.json: .*{message}", refused(runs, bundle))


def test_seeds_may_be_of_other_machines_and_not_of_other_settings(runs, bundle):
    for arm in ARMS:
        change_config(runs / f"{arm}-seed10", lambda config: config.update(device="NVIDIA H200"))
    assert len(read_runs(runs, ARMS, bundle)) == 4
    for arm in ARMS:
        change_config(runs / f"{arm}-seed10", lambda config: config.update(num_envs=512))
    assert "augmented-seed10/config.json: differs from augmented-seed2" in refused(runs, bundle)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("iteration,seconds,d_policy\n1,2.0,0.5\n", "has no rows with d_rollout. Bring the file back"),
        ("iteration,d_rollout\n1,0.5\n", "has no rows with seconds. Bring"),
        ("seconds,d_rollout\n", "has no rows with seconds, d_rollout. Bring"),
        ("", "has no rows with seconds, d_rollout. Bring"),
        ("seconds,d_rollout\n1.0,nan\n", "has no number in seconds or d_rollout. Train with discriminator.style"),
    ],
)
def test_curves_without_the_discriminators_score_are_refused(runs, bundle, text, message):
    (runs / "augmented-seed10" / "curves.csv").write_text(text)
    assert f"augmented-seed10/curves.csv: {message}" in refused(runs, bundle)
