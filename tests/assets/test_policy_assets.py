"""Which policy is served, how it is marked, and that no training starts by itself."""

import dataclasses
import json
import re
import shutil
from typing import Any

import dagster as dg
import numpy as np
import pytest

from assets import amp_policy, policy, report, resources, training_process
from assets.bootstrap import _parents, hard_inputs, upstream
from assets.definitions import defs
from assets.freshness import stale_reasons
from assets.plan import digest_of_robot, plans, robot_plans
from assets.resources import ClipPoolResource, StoreIOManager
from pipeline.batch import Manifest
from pipeline.export.folder import Source, export_policy
from pipeline.learning.robot_facts import CURE
from pipeline.project import PROJECT, Project
from tests.factories.networks import network_file
from tests.factories.training_stand_in import write_training_stand_in

PLANS = robot_plans("t1")
TRAINED, EXPORTED = PLANS["amp_policy"], PLANS["exported_policy"]
DATABASE, MODEL = PLANS["expert_db"], PLANS["robot_model"]
FREE = {"strictest": "public-domain", "allowed_use": "Any use."}
CLOSED = {"strictest": "non-commercial", "allowed_use": "Research.", "licences": {"AMASS": "non-commercial"}}


@pytest.fixture
def project(tmp_path, root, monkeypatch):
    """A project with a robot, the stand-in of training and nothing made."""
    project = Project(tmp_path)
    shutil.copytree(root / "robots" / "t1", tmp_path / "robots" / "t1", ignore=shutil.ignore_patterns("policies"))
    write_training_stand_in(tmp_path)
    for module in (policy, amp_policy, report, resources):
        monkeypatch.setattr(module, "PROJECT", project)
    monkeypatch.setattr(training_process, "gpus_here", lambda: 0)
    return project


def ship(project, robot):
    """A policy that ships with the robot."""
    source = Source(
        policy=network_file(project.root / "shipped.npz", robot, seed=1),
        run={"name": "run of the shipped"},
        data={"digest": "d0", "licence": FREE},
    )
    folder = project.shipped_policies("t1") / "walk"
    return export_policy(folder, "walk", robot, source, np.random.default_rng(0), shippable=True, compact=True)


RUN = {"preset": "paper", "seed": 3, "commit": "abc", "command": "python -m pipeline.training --seed 3"}
"""What a run's configuration says of it."""


def trained(project, robot, *, trial, licence=FREE, store=True):
    """A training run as `amp_policy` leaves it."""
    folder = project.policy_runs("t1") / "run7"
    folder.mkdir(parents=True)
    network_file(folder / "policy.npz", robot, seed=2)
    about = {"database_digest": "d1", "licence": licence}
    (folder / "config.json").write_text(json.dumps({**RUN, "bundle": about}))
    (folder / "done.json").write_text(json.dumps({"iterations": 300}))
    facts = {
        "stage": "amp_policy",
        "run": "run7",
        "folder": folder.relative_to(project.root).as_posix(),
        "policy": "policy.npz",
        "trial": trial,
        **RUN,
    }
    manifest = Manifest(stage="amp_policy", entries=(), judged=(), settings={"run7": facts})
    if store:
        project.store.save("t1/amp_policy", manifest)
    return folder


def export(instance=None, **config):
    """Materialize `exported_policy`; what came of it."""
    return dg.materialize(
        [policy.exported_policy(EXPORTED)],
        resources={"io_manager": StoreIOManager(bootstrap=False)},
        run_config={"ops": {"exported_policy": {"config": config}}},
        instance=instance,
        raise_on_error=False,
    )


def told(result, key="exported_policy") -> dict[str, Any]:
    (event,) = result.asset_materializations_for_node(key)
    return {name: value.value for name, value in event.metadata.items()}


def why(result):
    """The sentence that a run failed with."""
    (failed,) = [event for event in result.all_events if event.is_step_failure]
    error = failed.step_failure_data.error
    return error.cause.message if error.cause else error.message


def test_without_any_policy_the_export_says_what_to_do(project):
    result = export()
    assert not result.success
    assert "none is shipped in robots/t1/policies/walk" in why(result)
    assert "dagster asset materialize --select t1/amp_policy" in why(result)


def test_the_policy_that_ships_is_served_with_the_run_that_made_it(project, robot):
    card = ship(project, robot)
    said = told(export())
    assert said["origin"] == "ships with the project"
    assert said["training run"] == "run of the shipped"
    assert said["digest"] == card.digest
    assert said["may ship"] is True
    facts = policy.export_facts(project.store.load("exported_policy"))
    assert "policy.onnx" in facts["files"] and "policy.onnx" not in card.files
    assert (project.root / facts["folder"] / "policy.onnx").is_file()


def test_golden_vectors_are_not_taken_for_a_policy(project, robot):
    ship(project, robot)
    assert [path.name for path in project.policy_files("t1")] == ["policy.npz"]


def test_a_full_training_here_takes_its_place(project, robot):
    card = ship(project, robot)
    trained(project, robot, trial=False)
    said = told(export())
    assert (said["origin"], said["training run"]) == ("trained here", "run7")
    assert said["digest"] != card.digest
    assert said["expert database"] == "d1"
    assert said["may ship"] is False
    stored = policy.export_facts(project.store.load("exported_policy"))
    assert stored["folder"] == "data/policies/t1/exported"
    assert policy.stored_policy(project.store.load("exported_policy")).gains is not None
    card = json.loads((project.root / stored["folder"] / "card.json").read_text())
    assert (card["run"]["commit"], card["run"]["command"]) == ("abc", "python -m pipeline.training --seed 3")


def test_a_trial_never_takes_its_place(project, robot):
    ship(project, robot)
    trained(project, robot, trial=True)
    assert told(export())["origin"] == "ships with the project"
    shutil.rmtree(project.shipped_policies("t1"))
    assert "there is no policy for 't1'" in why(export())


def test_a_training_whose_files_are_gone_is_none(project, robot):
    ship(project, robot)
    shutil.rmtree(trained(project, robot, trial=False))
    assert told(export())["origin"] == "ships with the project"


@pytest.mark.parametrize(("licence", "marked"), [(FREE, True), (CLOSED, False)])
def test_it_is_marked_shippable_only_where_the_licence_allows(project, robot, licence, marked):
    trained(project, robot, trial=False, licence=licence)
    result = export(shippable=True)
    assert result.success == marked
    if marked:
        assert told(result)["may ship"] is True
    else:
        assert "can't be marked shippable: the strictest licence of its database is non-commercial (AMASS)" in why(
            result
        )
        assert told(export())["may ship"] is False


def test_a_shipped_file_that_was_changed_fails_the_run(project, robot):
    ship(project, robot)
    (project.shipped_policies("t1") / "walk" / "policy.npz").write_bytes(b"other")
    assert "policy.npz: missing, or different from the digest in the card" in why(export())


def test_policies_that_ship_do_not_change_what_the_robot_is(project, robot):
    before, other = digest_of_robot(project, "t1"), MODEL.fingerprint(project)
    own = EXPORTED.fingerprint(project)
    ship(project, robot)
    (project.shipped_policies("t1") / "walk" / "curves.csv").write_text("iteration\n")
    assert (digest_of_robot(project, "t1"), MODEL.fingerprint(project)) == (before, other)
    assert EXPORTED.fingerprint(project) != own


def test_a_training_is_new_content_and_its_lack_makes_nothing_stale(project, robot):
    ship(project, robot)
    with dg.DagsterInstance.ephemeral() as instance:
        parents = {EXPORTED.key: {TRAINED.key}, TRAINED.key: set()}
        known = {EXPORTED.key: EXPORTED, TRAINED.key: TRAINED}

        def stale():
            return stale_reasons(instance, project, known, parents, {}).get(EXPORTED.key)

        assert stale() == "it was never materialized"
        assert export(instance).success
        assert stale() is None
        instance.report_runless_asset_event(
            dg.AssetMaterialization(TRAINED.key, tags={"dagster/data_version": "a training"})
        )
        assert stale() == "'t1/amp_policy' has new content"
        assert export(instance).success
        assert stale() is None
        path = project.root / policy.export_facts(project.store.load("exported_policy"))["folder"] / "policy.npz"
        path.write_bytes(b"other")
        assert stale() == "its stored result is not that of its last materialization"


def test_nothing_starts_a_training():
    """Neither the database, nor a policy that is wanted, nor a report; nor a clock."""
    parents = hard_inputs(_parents(), plans(PROJECT))
    for name in ("expert_db", "exported_policy", "limit_cycles", "mujoco_validation", "release_report"):
        above = upstream({dg.AssetKey([name])}, parents)
        assert TRAINED.key not in above
    assert upstream({dg.AssetKey(["release_report"])}, parents) == {dg.AssetKey(["release_report"])}
    assert DATABASE.key in upstream({TRAINED.key}, parents)
    assert defs.resolve_job_def("train").asset_layer.selected_asset_keys == {TRAINED.key}
    by_clock = {each.job_name for each in defs.schedules or ()}
    by_clock |= {target.job_name for each in defs.sensors or () for target in each.targets}
    assert by_clock
    for name in by_clock:
        assert TRAINED.key not in defs.resolve_job_def(name).asset_layer.selected_asset_keys


def test_the_cure_of_a_damaged_bundle_names_what_writes_it():
    asset, job = re.findall(r"--select (\S+)|-j (\S+?);", CURE)
    assert asset[0] == TRAINED.key.to_user_string()
    assert defs.resolve_job_def(job[1]).asset_layer.selected_asset_keys == {PLANS["tracking_policy"].key}


def test_a_trial_runs_without_a_gpu_and_says_what_it_is(project, robot, monkeypatch):
    monkeypatch.setattr(amp_policy, "bundle_of", lambda *_: bundle(project, robot))
    result = dg.materialize(
        [amp_policy.amp_policy(TRAINED)],
        resources={"io_manager": StoreIOManager(bootstrap=False), "clip_pool": ClipPoolResource(workers=1)},
        raise_on_error=False,
    )
    said = told(result, "t1__amp_policy")
    assert said["type of run"] == "a trial: a few iterations without a GPU, no policy"
    assert said["checkpoint"] == "the newest, not validated: a trial"
    assert (said["iterations"], said["d_policy"], said["episode_s"]) == (2, -0.5, 7.0)
    assert said["expert database"] == "d1"
    assert str(project.root) not in said["command"]
    assert "data:image/png;base64" in said["curves"]
    (row,) = said["commanded and achieved velocity"].records
    assert row.data == {"command": "top", "commanded": "1.9", "achieved": "1.7"}
    (facts,) = project.store.load("t1/amp_policy").settings.values()
    assert facts["trial"] is True


def test_approved_ranges_widen_one_end_each():
    @dataclasses.dataclass
    class Change:
        what: str
        value: float
        before: float

    found = amp_policy.widened("paper", [Change("friction", 0.3, 0.4), Change("push_speed", 1.7, 1.5)])
    assert found == ("pushes.kick_m_s=0.3,1.7", "randomization.friction=0.3,1.2")
    found = amp_policy.widened("recipe", [Change("gain_range", 0.85, 0.9), Change("push_speed", 1.7, 1.5)])
    assert found == ("pushes.kick_m_s=0,2.04", "randomization.gains=0.85,1.1")
    assert amp_policy.widened("recipe", [Change("friction", 0.25, 0.3)]) == ("randomization.friction=0.25,1.2",)
    assert amp_policy.widened("recipe", [Change("friction", 0.5, 0.6)]) == ("randomization.friction=0.3,1.2",)
    assert amp_policy.widened("paper", []) == ()


def bundle(project, robot):
    """The stand-in's bundle."""
    folder = project.policies("t1") / "bundle"
    about = {"database_digest": "d1", "licence": FREE}
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "bundle.json").write_text(json.dumps(about))
    network_file(folder / "network.npz", robot)
    return folder, about
