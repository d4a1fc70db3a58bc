"""An asset is stale after faults of its stage, and where what it stored is not whole."""

from pathlib import Path

import dagster as dg
import pytest

from assets.freshness import INPUT_VERSION_PREFIX, TRIALS_TAG, digest_of_trials, stale_reasons, stored_version
from assets.plan import FAULTS_TAG, FINGERPRINT_TAG, SHARED, TRIALS, Plan, robot_plans
from assets.sources import DATA_VERSION_TAG
from pipeline.batch import Entry, Manifest
from pipeline.feasibility import criteria_table
from pipeline.files import settings
from pipeline.files.sourced import origins
from pipeline.project import Project
from pipeline.robot import Robot
from tests.factories.bare_project import bare_project
from tests.factories.robot_clips import standing, wandering

REPAIRED = next(plan for plan in SHARED if plan.name == "repaired_motions")
FEASIBLE = robot_plans("t1")["feasible_motions"]


@pytest.fixture
def project(root: Path, tmp_path: Path) -> Project:
    """A project with the settings of this one and an empty store."""
    return bare_project(root, tmp_path)


def stored(project: Project, plan: Plan, robot: Robot) -> Manifest:
    """Two clips in the store, as the result of an asset."""
    clips = (standing(robot), wandering(robot))
    entries = tuple(Entry(clip=clip.name, blob=project.store.put_clip(clip), numbers={}) for clip in clips)
    manifest = Manifest(stage=plan.name, entries=entries, judged=())
    project.store.save(plan.key.to_user_string(), manifest)
    return manifest


def reason(project: Project, plan: Plan, manifest: Manifest, faults: int) -> str:
    """Why an asset without inputs is stale after a materialization in which the stage failed on so many clips."""
    tags = {DATA_VERSION_TAG: manifest.digest, FINGERPRINT_TAG: plan.fingerprint(project), FAULTS_TAG: str(faults)}
    with dg.DagsterInstance.ephemeral() as instance:
        instance.report_runless_asset_event(dg.AssetMaterialization(plan.key, tags=tags))
        return stale_reasons(instance, project, {plan.key: plan}, {plan.key: set()}, {}).get(plan.key, "")


def test_clips_that_were_lost_to_a_fault_make_their_asset_stale(project: Project, robot: Robot):
    manifest = stored(project, REPAIRED, robot)
    assert reason(project, REPAIRED, manifest, faults=0) == ""
    assert reason(project, REPAIRED, manifest, faults=2) == "the stage itself failed on 2 clips; they are tried again"


def test_what_lacks_a_blob_has_no_version(project: Project, robot: Robot):
    manifest = stored(project, REPAIRED, robot)
    assert stored_version(project, REPAIRED) == manifest.digest
    project.store.own_blobs.path(manifest.entries[1].blob).unlink()
    again = Project(project.root)
    assert again.store.manifest_path("repaired_motions").is_file()
    assert stored_version(again, REPAIRED) is None


def test_feasible_motions_have_a_version_with_their_own_table_of_criteria_alone(project: Project, robot: Robot):
    manifest = stored(project, FEASIBLE, robot)
    assert stored_version(project, FEASIBLE) is None, "there is no table"
    limits = settings.read_yaml(project.settings("feasibility.yaml"))
    bare, table = criteria_table.split(manifest, origins(limits))
    path = criteria_table.path_beside(project.store.manifest_path("feasible_motions"))
    criteria_table.write(path, table, bare)
    assert stored_version(project, FEASIBLE) == manifest.digest
    other = Manifest(stage=FEASIBLE.name, entries=manifest.entries[:1], judged=())
    project.store.save("feasible_motions", other)
    assert stored_version(project, FEASIBLE) is None, "the table is of what was stored before"


def test_of_logs_only_those_of_its_policy_make_limit_cycles_stale(project: Project):
    cycles = robot_plans("t1")["limit_cycles"]
    facts = {"digest": "of the policy", "files": {"policy.npz": "of its network"}}
    project.store.save("exported_policy", Manifest(stage="", entries=(), judged=(), settings={"": facts}))
    entries: list[Entry] = []

    def version_with(*logged: tuple[str, str]) -> str:
        """Store further trials, each of a robot and a policy; the version of all of them."""
        for robot, policy in logged:
            name = str(len(entries))
            entries.append(Entry(clip=name, blob=name, numbers={"robot": robot, "policy_digest": policy}))
        manifest = Manifest(stage=TRIALS.name, entries=tuple(entries), judged=())
        project.store.save(TRIALS.name, manifest)
        return manifest.digest

    def why(version: str) -> str:
        parents, external = {cycles.key: {TRIALS.key}}, {TRIALS.key: version}
        return stale_reasons(instance, project, {cycles.key: cycles}, parents, external).get(cycles.key, "")

    before = version_with(("t1", "of the policy"))
    made = Manifest(stage=cycles.name, entries=(), judged=(), settings={"": {"passed": True}})
    project.store.save(cycles.name, made)
    tags = {DATA_VERSION_TAG: made.digest, FINGERPRINT_TAG: cycles.fingerprint(project)}
    tags |= {INPUT_VERSION_PREFIX + TRIALS.name: before, TRIALS_TAG: digest_of_trials(project, "t1")}
    with dg.DagsterInstance.ephemeral() as instance:
        instance.report_runless_asset_event(dg.AssetMaterialization(cycles.key, tags=tags))
        after = version_with(("t1", "of another"), ("k1", "of the policy"))
        assert after != before and why(after) == ""
        assert why(version_with(("t1", "of its network"))) == "'hardware_trials' has new content"
