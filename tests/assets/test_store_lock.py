"""One run at a time works on the store; a training leaves it to others, and notices what they changed."""

import fcntl
import logging
from types import SimpleNamespace
from typing import Any

import pytest

from assets import amp_policy, resources
from assets.amp_policy import train_beside_others
from assets.resources import _one_run_at_a_time, store_released
from assets.training_process import TrainingFailedError
from pipeline.project import Project

LOG = logging.getLogger("store")


@pytest.fixture
def project(tmp_path, monkeypatch):
    project = Project(tmp_path)
    monkeypatch.setattr(resources, "PROJECT", project)
    return project


def context_of(name: str) -> Any:
    return SimpleNamespace(run_id=name, log=LOG)


def is_free(project: Project) -> bool:
    """Whether another run could take the store now; it has a file of its own open, as another process would."""
    with (project.store.root / "lock").open("a+") as stream:
        try:
            fcntl.flock(stream, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            return False
    return True


def test_others_get_the_store_while_it_is_left_to_them_and_not_before_or_after(project):
    with _one_run_at_a_time(context_of("a")):
        assert not is_free(project)
        with store_released(LOG):
            assert is_free(project)
        assert not is_free(project)
        assert (project.store.root / "lock").read_text().startswith("run a ")
        with pytest.raises(ValueError, match="broken"), store_released(LOG):
            raise ValueError("broken")
        assert not is_free(project)
    assert is_free(project)


def test_without_a_lock_nothing_is_left_or_taken(project):
    with store_released(LOG):
        pass
    assert not (project.store.root / "lock").exists()


@pytest.mark.parametrize("changed", ["robot", "database", "bundle", "no database", None])
def test_a_training_leaves_the_store_and_refuses_inputs_that_became_others(project, monkeypatch, changed):
    bundle = project.policies("t1") / "bundle"
    inputs = {
        "robot": project.adapted_robot("t1") / "actuators.csv",
        "database": project.expert_db("t1") / "manifest.json",
        "bundle": bundle / "bundle.json",
    }
    for path in inputs.values():
        path.parent.mkdir(parents=True)
        path.write_text("first")
    run: Any = SimpleNamespace(folder=project.policy_runs("t1") / "seed1", bundle=bundle)
    seen = []

    def train(run, root, lock, log):
        seen.append(is_free(project))
        if changed == "no database":
            inputs["database"].unlink()
        elif changed:
            inputs[changed].write_text("second")

    monkeypatch.setattr(amp_policy, "train", train)
    with _one_run_at_a_time(context_of("a")):
        if changed:
            with pytest.raises(TrainingFailedError, match="seed1: the expert database or the adapted robot changed"):
                train_beside_others(run, project, "t1", LOG)
        else:
            train_beside_others(run, project, "t1", LOG)
        assert not is_free(project)
    assert seen == [True]
