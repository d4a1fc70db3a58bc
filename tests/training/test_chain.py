"""The chain of stages: from a bundle to a policy, resumed, refused, and from scratch."""

from __future__ import annotations

import csv
import dataclasses
import json
import shutil
from types import SimpleNamespace

import mujoco
import numpy as np
import pytest
import torch

from pipeline.deployment import load_policy
from pipeline.learning.checkpoint import load_checkpoint, newest_checkpoint
from pipeline.learning.policy_file import Network
from pipeline.learning.run_command import PACKAGES
from pipeline.training import bundle, chain, runner
from pipeline.training.__main__ import main
from pipeline.training.amp.algorithm import ramp
from pipeline.training.bundle import read_bundle
from pipeline.training.config import RECIPE
from pipeline.training.stage import Stage
from tests.factories.training_bundle import small_bundle

SIZES = {"simulation.num_envs": 4, "distillation.iterations": 2, "schedule.iterations": 2}


@pytest.fixture(scope="module")
def folder(tmp_path_factory, root, robot):
    return small_bundle(tmp_path_factory.mktemp("chain"), root, robot, tracker="passive")


def command(folder, out, *stages: str, **changed) -> list[str]:
    values = {**SIZES, **{name.replace("__", "."): value for name, value in changed.items()}}
    sets = [text for name, value in values.items() for text in ("--set", f"{name}={value}")]
    chosen = ["--stages", *stages] if stages else []
    return ["--bundle", str(folder), "--out", str(out), "--device", "cpu", *sets, *chosen]


BOTH = ("distillation", "amp")


@pytest.fixture(scope="module")
def run(folder, tmp_path_factory):
    """A run of both stages."""
    out = tmp_path_factory.mktemp("run") / "out"
    assert main(command(folder, out, *BOTH)) == 0
    return out


def rows_of(path):
    return list(csv.DictReader(path.read_text().splitlines()))


def test_both_stages_make_a_policy(run, folder, tmp_path):
    done = json.loads((run / "done.json").read_text())
    assert {name: stage["iterations"] for name, stage in done["stages"].items()} == {"distillation": 2, "amp": 2}
    assert done["steps"] == 2 * 2 * 4 * 24
    config = json.loads((run / "config.json").read_text())
    assert (config["preset"], config["seed"], config["device"]) == ("recipe", 1, "cpu")
    assert config["changed"] == SIZES
    assert config["bundle"]["database_digest"]
    assert config["versions"]["mujoco"] == mujoco.__version__ and set(PACKAGES) < set(config["versions"])
    rows = rows_of(run / "curves.csv")
    assert [row["iteration"] for row in rows] == ["1", "2"]
    assert all(float(row[name]) == float(row[name]) for row in rows for name in ("task_reward", "d_expert", "accuracy"))
    newest = newest_checkpoint(run / "amp" / "checkpoints")
    assert newest is not None
    policy = load_policy(run / "policy.npz")
    assert policy.gains is not None
    observation = torch.randn(5, 720)
    arrays = dict(np.load(run / "policy.npz"))
    assert policy.act(observation.double().numpy()) == pytest.approx(
        Network(arrays, "cpu")(observation).numpy(), abs=1e-3
    )


def test_amp_begins_with_the_distilled_network_and_its_frozen_normalizer(run):
    """The critic learns alone at first, so two iterations later the actor is still the distilled one."""
    states = [load_checkpoint(run / name / "checkpoints" / "model_000002.pt", "cpu") for name in BOTH]
    distilled, trained = (state["actor_state_dict"] for state in states)
    for name in distilled:
        if name.startswith("mlp."):
            assert torch.equal(distilled[name], trained[name]), name
        elif not name.endswith("count"):
            assert torch.allclose(distilled[name], trained[name], atol=1e-3), name
    assert int(trained["obs_normalizer.count"]) >= runner.FROZEN


def test_repeating_a_finished_run_trains_nothing(run, folder, monkeypatch):
    before = (run / "policy.npz").read_bytes()
    monkeypatch.setattr(Stage, "run", lambda stage: pytest.fail("trained again"))
    assert main(command(folder, run, *BOTH)) == 0
    assert (run / "policy.npz").read_bytes() == before


@pytest.mark.parametrize("killed", BOTH)
def test_a_killed_stage_continues_from_its_newest_checkpoint(folder, tmp_path, monkeypatch, killed):
    """Where no stage validates, the policy is the newest of the last stage."""
    monkeypatch.setattr("pipeline.training.stage.SAVE_EVERY", 1)
    kind = chain.DistillationStage if killed == "distillation" else chain.AmpStage
    stages = BOTH[: BOTH.index(killed) + 1]
    iterate = kind.iterate

    def dies(stage, share):
        if stage.iteration == 1:
            raise KeyboardInterrupt
        return iterate(stage, share)

    monkeypatch.setattr(kind, "iterate", dies)
    assert main(command(folder, tmp_path, *stages)) == 130
    assert not (tmp_path / killed / "done.json").exists()
    begun = []
    monkeypatch.setattr(kind, "iterate", lambda stage, share: begun.append(stage.iteration) or iterate(stage, share))
    monkeypatch.setattr(chain, "commit_of", lambda _: "the next commit")
    before = json.loads((tmp_path / "config.json").read_text())
    assert main(command(folder, tmp_path, *stages)) == 0
    assert begun == [1]
    config = json.loads((tmp_path / "config.json").read_text())
    commits = f"{before['commit'] or 'not stated'}, the next commit"
    assert config == {**before, "commit": commits}, "each place where it was trained, once"
    rows = rows_of(tmp_path / killed / "curves.csv")
    assert [row["iteration"] for row in rows] == ["1", "2"]
    assert float(rows[0]["seconds"]) < float(rows[1]["seconds"])
    assert (tmp_path / "policy.npz").read_bytes() == (tmp_path / killed / "policy.npz").read_bytes()
    assert json.loads((tmp_path / "done.json").read_text())["stages"][killed]["resumed_at"] == [1]
    assert (tmp_path / "amp").exists() == ("amp" in stages) and not (tmp_path / "export").exists()


def test_a_diverged_network_is_not_saved_and_the_run_can_continue(folder, tmp_path, monkeypatch, capsys):
    monkeypatch.setattr("pipeline.training.stage.SAVE_EVERY", 1)
    iterate = chain.AmpStage.iterate

    def diverges(stage, share):
        figures = iterate(stage, share)
        if stage.iteration == 1:
            with torch.no_grad():
                stage.algorithm.get_policy().mlp[0].weight[0, 0] = torch.nan
        return figures

    monkeypatch.setattr(chain.AmpStage, "iterate", diverges)
    assert main(command(folder, tmp_path, *BOTH)) == 2
    error = capsys.readouterr().err
    assert f"{tmp_path / 'amp'}, iteration 2: the network has a weight of nan" in error and "Repeating" in error
    assert newest_checkpoint(tmp_path / "amp" / "checkpoints") == tmp_path / "amp/checkpoints/model_000001.pt"
    monkeypatch.setattr(chain.AmpStage, "iterate", iterate)
    assert main(command(folder, tmp_path, *BOTH)) == 0
    assert json.loads((tmp_path / "amp" / "done.json").read_text())["iterations"] == 2


def test_a_folder_of_another_run_is_refused(run, folder, tmp_path, capsys):
    assert main([*command(folder, run, *BOTH), "--seed", "7"]) == 2
    assert (
        "belongs to a run with another seed. Repeat its own command, or give another --out." in capsys.readouterr().err
    )
    assert main(command(folder, run, *BOTH, ppo__entropy=0.5)) == 2
    assert "another ppo.entropy." in capsys.readouterr().err
    config = json.loads((run / "config.json").read_text())
    shutil.copytree(run, tmp_path / "older")
    config["options"]["schedule.minutes"] = 45.0
    (tmp_path / "older" / "config.json").write_text(json.dumps(config))
    assert main(command(folder, tmp_path / "older", *BOTH)) == 2
    cure = f"Repeat its own command at commit {config['commit']}, or give another --out."
    assert f"another schedule.minutes. {cure}" in capsys.readouterr().err


@pytest.mark.parametrize("content", ["[]", '{"options": 3}'])
def test_a_folder_of_another_program_is_refused(folder, tmp_path, capsys, content):
    (tmp_path / "config.json").write_text(content)
    assert main(command(folder, tmp_path, *BOTH)) == 2
    assert (
        f"{tmp_path / 'config.json'}: is not the config of a training run. Give another --out."
        in capsys.readouterr().err
    )


def test_a_stage_killed_after_its_last_checkpoint_was_not_continued(run, folder, tmp_path, monkeypatch):
    shutil.copytree(run, tmp_path / "run")
    (tmp_path / "run" / "amp" / "done.json").unlink()
    monkeypatch.setattr(chain.AmpStage, "iterate", lambda *_: pytest.fail("trained again"))
    assert main(command(folder, tmp_path / "run", *BOTH)) == 0
    assert json.loads((tmp_path / "run" / "amp" / "done.json").read_text())["resumed_at"] == []
    assert (tmp_path / "run" / "policy.npz").read_bytes() == (run / "policy.npz").read_bytes()


def test_a_run_continues_with_the_same_number_of_processes(run, folder, tmp_path, capsys):
    """Its steps and GPU time are counted by their number; a finished run may be validated by any."""
    shutil.copytree(run, tmp_path / "run")
    config = json.loads((tmp_path / "run" / "config.json").read_text())
    (tmp_path / "run" / "config.json").write_text(json.dumps({**config, "processes": 4}))
    assert main(command(folder, tmp_path / "run", *BOTH)) == 0
    (tmp_path / "run" / "amp" / "done.json").unlink()
    assert main(command(folder, tmp_path / "run", *BOTH)) == 2
    assert "another number of processes. Repeat its own command" in capsys.readouterr().err


@pytest.mark.parametrize(("removed", "later"), [("distillation", "amp"), ("amp", "validation")])
def test_a_stage_is_not_trained_again_below_what_was_made_from_it(run, folder, tmp_path, capsys, removed, later):
    """Else the run would end with the policy, or the figures, of the stage that was removed."""
    out = tmp_path / "run"
    shutil.copytree(run, out)
    (out / "validation").mkdir()
    shutil.rmtree(out / removed)
    assert main(command(folder, out, *BOTH)) == 2
    error = capsys.readouterr().err
    assert f"{out / removed}: is not done, but {out / later} was made from it. Remove {out / later} as well." in error


def test_from_scratch_no_stage_distils(folder, tmp_path, capsys):
    assert main(command(folder, tmp_path, distillation__iterations=0)) == 2
    assert "no stage is left to train: distillation.iterations is 0" in capsys.readouterr().err
    assert main(command(folder, tmp_path, "amp")) == 2
    assert "AMP + PPO begins with the distilled network. Name that stage too" in capsys.readouterr().err
    assert main(command(folder, tmp_path, *BOTH, distillation__iterations=0)) == 0
    assert not (tmp_path / "distillation").exists()


def test_a_bundle_without_a_tracker_is_refused_with_what_to_do(tmp_path, root, robot, capsys):
    bare = small_bundle(tmp_path / "bare", root, robot)
    assert main(command(bare, tmp_path / "out")) == 2
    assert f"{bare}: the bundle has no tracker to distil from" in capsys.readouterr().err


def test_clips_shorter_than_a_window_are_refused_before_training(folder, tmp_path, capsys, monkeypatch):
    whole = read_bundle(folder)
    short = dataclasses.replace(whole.expert, clip_start=np.array([0, 9, 18]))
    monkeypatch.setattr(bundle, "read_bundle", lambda *_: dataclasses.replace(whole, expert=short))
    assert main(command(folder, tmp_path / "out", *BOTH)) == 2
    assert "its longest clip has 9 frames, fewer than a window's discriminator.frames (10)." in capsys.readouterr().err
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--device", "cpu"], "--out is required"),
        (["--out", "o", "--device", "cpu", "--seed", "-1"], "--seed is -1; 0 to 2147483647 is allowed."),
        (["--out", "o", "--device", "cpu", "--seed", "4294967296"], "--seed is 4294967296; 0 to 2147483647 is"),
        (["--bundle", "b", "--out", "o", "--device", "cpu", "--preset", "none"], "unknown preset 'none'"),
        (
            ["--bundle", "b", "--out", "o", "--device", "cpu"],
            "bundle.json: the file is missing. Write the bundle again",
        ),
        (["--bundle", "b", "--out", "o", "--device", "cuda"], "PyTorch finds no GPU here. Use --device cpu"),
    ],
)
def test_a_wrong_request_gets_one_sentence(arguments, message, capsys, monkeypatch):
    monkeypatch.setattr(torch.cuda, "is_available", lambda: False)
    assert main(arguments) == 2
    assert message in capsys.readouterr().err


@pytest.mark.parametrize(
    ("device", "processes", "message"),
    [
        ("cuda:2", "1", "there is no device 'cuda:2': PyTorch finds cuda:0 to cuda:1 here"),
        ("gpu", "1", "there is no device 'gpu'"),
        ("cuda", "4", "there is no device 'cuda:3'"),
        ("cuda:0", "2", "torchrun gives each process its own GPU"),
        ("cpu", "2", "--device is 'cpu', but torchrun is for several GPUs"),
    ],
)
def test_a_gpu_that_is_not_there_gets_one_sentence(capsys, monkeypatch, device, processes, message):
    monkeypatch.setattr(torch.cuda, "is_available", lambda: True)
    monkeypatch.setattr(torch.cuda, "device_count", lambda: 2)
    monkeypatch.setenv("WORLD_SIZE", processes)
    monkeypatch.setenv("LOCAL_RANK", str(int(processes) - 1))
    assert main(["--bundle", "b", "--out", "o", "--device", device]) == 2
    assert message in capsys.readouterr().err


@pytest.mark.parametrize(
    "error",
    [
        torch.OutOfMemoryError("CUDA out of memory. Tried to allocate 2 GiB"),
        RuntimeError("Failed to allocate 9 bytes on device 'cuda:0'"),
        RuntimeError("DefaultCPUAllocator: can't allocate memory: you tried to allocate 9 bytes."),
        RuntimeError("CUDA error: CUBLAS_STATUS_ALLOC_FAILED when calling `cublasCreate(handle)`"),
        MemoryError(),
    ],
)
def test_a_shortage_of_memory_gets_a_sentence(folder, tmp_path, capsys, monkeypatch, error):
    def full(*_):
        raise error

    monkeypatch.setattr(chain, "train", full)
    assert main(command(folder, tmp_path)) == 2
    assert "4 environments need more memory than is free on 'cpu'" in capsys.readouterr().err


def test_a_shortage_of_memory_is_no_fault_of_the_checkpoint(run, folder, tmp_path, capsys, monkeypatch):
    def full(*_):
        raise torch.OutOfMemoryError("CUDA out of memory. Tried to allocate 2 GiB")

    shutil.copytree(run, tmp_path / "run")
    (tmp_path / "run" / "amp" / "done.json").unlink()
    monkeypatch.setattr(chain.AmpStage, "load", full)
    assert main(command(folder, tmp_path / "run", *BOTH)) == 2
    error = capsys.readouterr().err
    assert "need more memory than is free" in error and "another network" not in error


def test_another_runtime_error_is_not_called_a_shortage(folder, tmp_path, monkeypatch):
    def broken(*_):
        raise RuntimeError("shapes differ")

    monkeypatch.setattr(chain, "train", broken)
    with pytest.raises(RuntimeError, match="shapes differ"):
        main(command(folder, tmp_path))


def test_ramps_go_from_0_to_1_over_their_span():
    assert [ramp(at, (0.2, 0.4)) for at in (0.0, 0.2, 0.3, 0.4, 1.0)] == pytest.approx([0.0, 0.0, 0.5, 1.0, 1.0])
    assert [ramp(at, (0.0, 0.0)) for at in (0.0, 1.0)] == [1.0, 1.0]


def test_the_final_ramp_reaches_the_power_in_the_environment():
    env = SimpleNamespace(set_disturbance=lambda share: None, final=torch.zeros(()))
    stage = SimpleNamespace(
        env=env, request=SimpleNamespace(config=RECIPE.changed({"schedule.final_ramp": (0.6, 1.0)}))
    )
    for share, final in ((0.5, 0.0), (0.8, 0.5), (1.0, 1.0)):
        runner.AmpStage._set_ramps(stage, share)
        assert float(env.final) == pytest.approx(final)
