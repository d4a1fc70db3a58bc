"""A training is a process of its own: one at a time, resumed, ended with the asset, told with its last lines."""

import fcntl
import json
import logging
import os
import subprocess
import sys
import threading
import time

import psutil
import pytest

from assets import training_process
from assets.training_process import Run, TrainingConfig, TrainingFailedError, run_of, train
from pipeline.training.config import DEFAULT
from tests.factories.training_stand_in import write_training_stand_in

LOG = logging.getLogger("training")


@pytest.fixture
def place(tmp_path):
    write_training_stand_in(tmp_path)
    bundle = tmp_path / "bundle"
    bundle.mkdir()
    (bundle / "bundle.json").write_text(json.dumps({"database_digest": "d1"}))
    (bundle / "network.npz").write_bytes(b"a network")
    return tmp_path


def asked(place, here, monkeypatch, **config) -> Run:
    """The run of a config on a machine with so many GPUs."""
    monkeypatch.setattr(training_process, "gpus_here", lambda: here)
    return run_of(TrainingConfig(**config), place / "runs", place / "bundle", "digest")


def start(run, place):
    train(run, place, place / "lock", LOG)


def option(run, name):
    (value,) = (text.split("=")[1] for text in run.command if text.startswith(f"{name}="))
    return value


def test_without_a_gpu_a_trial_is_trained(place, monkeypatch):
    run = asked(place, 0, monkeypatch)
    assert (run.trial, run.device) == (True, "cpu")
    sizes = [option(run, name) for name in ("simulation.num_envs", "schedule.iterations", "distillation.iterations")]
    assert sizes == ["8", "2", "0"], "the bundle has no tracker"
    assert run.command[-3:] == ("--stages", "distillation", "amp")
    assert run.folder.name.startswith(f"trial-{DEFAULT}-seed1-")
    start(run, place)
    config = json.loads((run.folder / "config.json").read_text())
    assert (config["num_envs"], config["device"]) == (8, "cpu")
    assert run.done


def test_a_trial_distils_where_the_bundle_has_a_tracker(place, monkeypatch):
    (place / "bundle" / "tracker.npz").write_bytes(b"network")
    assert option(asked(place, 0, monkeypatch), "distillation.iterations") == "2"
    assert option(asked(place, 0, monkeypatch, preset="paper"), "distillation.iterations") == "0"


def test_with_gpus_it_is_a_full_training_by_torchrun(place, monkeypatch):
    one = asked(place, 4, monkeypatch)
    assert (one.trial, one.device) == (False, "cuda")
    assert one.command[:2] == ("-m", "pipeline.training") and not {"--stages", "--set"} & set(one.command)
    four = asked(place, 4, monkeypatch, gpus=4, num_envs=1024, iterations=1_000_000)
    assert "--nproc-per-node=4" in four.command
    assert (option(four, "simulation.num_envs"), option(four, "schedule.iterations")) == ("1024", "1000000")
    assert four.folder != one.folder


def test_a_gpu_that_is_not_there_is_no_silent_trial(place, monkeypatch):
    with pytest.raises(TrainingFailedError, match=r"2 GPUs are requested, 1 are available"):
        asked(place, 1, monkeypatch, device="cuda", gpus=2)


@pytest.mark.parametrize(
    "other", [{"seed": 2}, {"preset": "paper"}, {"options": ["discriminator.style=0"]}, {"num_envs": 16}]
)
def test_another_question_is_another_run(place, monkeypatch, other):
    assert asked(place, 0, monkeypatch).folder == asked(place, 0, monkeypatch).folder
    assert asked(place, 0, monkeypatch).folder != asked(place, 0, monkeypatch, **other).folder
    config = TrainingConfig(seed=1)
    elsewhere = run_of(config, place / "runs", place / "bundle", "another database")
    assert elsewhere.folder != asked(place, 0, monkeypatch).folder


def test_a_changed_recipe_is_another_run(place, monkeypatch):
    before = asked(place, 0, monkeypatch).folder
    recipe = training_process.preset(DEFAULT)
    monkeypatch.setattr(training_process, "preset", lambda _: recipe.changed({"rewards.power": -0.5}))
    assert asked(place, 0, monkeypatch).folder != before


def test_a_run_that_is_done_is_not_trained_again_but_said_to_be_of_other_code(place, monkeypatch, caplog):
    """The stand-in states the commit `abc`."""
    run = asked(place, 0, monkeypatch)
    start(run, place)
    monkeypatch.setattr(training_process, "commit_of", lambda _: "abc")
    start(run, place)
    assert "it was trained at commit" not in caplog.text
    monkeypatch.setattr(training_process, "commit_of", lambda _: "def")
    start(run, place)
    assert f"at commit abc, the code is at def. To train again, remove {run.folder}" in caplog.text
    assert (run.folder / "starts").read_text() == "from 1\n"


def test_a_run_is_taken_up_where_it_was_left(place, monkeypatch):
    run = asked(place, 0, monkeypatch, iterations=3)
    (run.folder / "amp" / "checkpoints").mkdir(parents=True)
    (run.folder / "amp" / "checkpoints" / "model_000002.pt").write_bytes(b"state")
    start(run, place)
    assert (run.folder / "starts").read_text() == "from 3\n"


def test_progress_goes_into_the_log(place, monkeypatch, caplog):
    caplog.set_level(logging.INFO)
    start(asked(place, 0, monkeypatch), place)
    assert "python -m pipeline.training --bundle" in caplog.text
    assert "iteration 1 of 2, 0 s: task 0.5" in caplog.text


def test_a_training_that_fails_tells_its_last_lines(place, monkeypatch):
    run = asked(place, 0, monkeypatch, seed=13)
    with pytest.raises(TrainingFailedError, match=r"status 3. Its last lines:\n(.*\n)*.*went to pieces"):
        start(run, place)
    assert not run.done


def test_two_trainings_run_one_after_the_other(place, monkeypatch, caplog):
    """A second one waits until the first one's lock is free."""
    caplog.set_level(logging.INFO)
    run = asked(place, 0, monkeypatch)
    with (place / "lock").open("a+") as held:
        fcntl.flock(held, fcntl.LOCK_EX)
        waiting = threading.Thread(target=start, args=(run, place))
        waiting.start()
        time.sleep(0.3)
        assert waiting.is_alive()
        assert not (run.folder / "starts").exists()
    waiting.join(30.0)
    assert run.done
    assert "waiting for another training to end" in caplog.text


def test_the_lock_is_the_processs_own_as_well(place, monkeypatch):
    """Killed with no word, an asset leaves a training behind; the GPU stays taken until that ends."""
    run = asked(place, 0, monkeypatch, seed=99)
    run.folder.mkdir(parents=True)
    code = f"""
import logging, sys
from pathlib import Path
from assets.training_process import Run, train
run = Run(folder=Path({str(run.folder)!r}), bundle=Path({str(run.bundle)!r}), device="cpu", command={run.command!r})
train(run, Path({str(place)!r}), Path({str(place / "lock")!r}), logging.getLogger())
"""
    asset = subprocess.Popen([sys.executable, "-c", code], start_new_session=True)
    checkpoint = run.folder / "amp" / "checkpoints" / "model_000001.pt"
    while not checkpoint.is_file():
        assert asset.poll() is None
        time.sleep(0.05)
    asset.kill()
    asset.wait()
    with (place / "lock").open("a+") as stream:
        with pytest.raises(BlockingIOError):
            fcntl.flock(stream, fcntl.LOCK_EX | fcntl.LOCK_NB)
        (training,) = _processes_of(run.folder)
        os.kill(training, 9)
        fcntl.flock(stream, fcntl.LOCK_EX)


def test_stopping_the_asset_stops_the_training(place, monkeypatch):
    run = asked(place, 0, monkeypatch, seed=99)

    class Stopped(Exception):
        pass

    class Log:
        def info(self, text):
            if text.startswith("iteration"):
                assert len(_processes_of(run.folder)) == 1
                raise Stopped

    with pytest.raises(Stopped):
        train(run, place, place / "lock", Log())
    assert _processes_of(run.folder) == []


def _processes_of(folder) -> list[int]:
    """Processes that were told to write into the run's folder."""
    found = []
    for process in psutil.process_iter(["cmdline", "status"]):
        arguments = process.info["cmdline"] or []
        if "--out" in arguments and str(folder) in arguments and process.info["status"] != psutil.STATUS_ZOMBIE:
            found.append(process.pid)
    return found
