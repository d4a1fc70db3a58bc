"""A source is a partition: its job works again on its clips alone, through all stages to the databases."""

import logging

import dagster as dg
import pytest

from assets import bootstrap, source_jobs
from assets.bootstrap import rerun_stages
from assets.plan import SHARED, plans, robot_plans
from assets.source_jobs import rerun_source
from assets.sources import SOURCES_NAME, note_sources
from pipeline.batch.again import clips_again
from pipeline.project import PROJECT

LOG = logging.getLogger("test")


@pytest.fixture
def instance():
    with dg.DagsterInstance.ephemeral() as made:
        yield made


def test_the_sources_in_use_are_the_partitions(instance):
    note_sources(instance, ["walks", "runs"])
    note_sources(instance, ["runs", "turns"])
    assert set(instance.get_dynamic_partitions(SOURCES_NAME)) == {"runs", "turns"}


def test_the_job_of_a_source_works_again_on_its_clips_alone(instance, monkeypatch):
    note_sources(instance, ["walks", "runs"])
    seen = {}

    def work(instance, run, project, log):
        seen.update({clip: clip in clips_again() for clip in ("walks/a@0-10~mirror", "runs/a", "walks2/a", "walks")})

    monkeypatch.setattr(source_jobs, "rerun_stages", work)
    made = rerun_source.execute_in_process(instance=instance, partition_key="walks", resources={"io_manager": object()})
    assert made.success
    assert seen == {"walks/a@0-10~mirror": True, "runs/a": False, "walks2/a": False, "walks": False}
    assert not clips_again()


def test_a_source_that_there_is_not_is_refused(instance):
    note_sources(instance, ["walks"])
    with pytest.raises(dg.DagsterUnknownPartitionError, match="nowhere"):
        rerun_source.execute_in_process(instance=instance, partition_key="nowhere", resources={"io_manager": object()})


def worked_on(instance, monkeypatch, stale: list[str]) -> set[str]:
    """What `rerun_stages` materializes in a graph of this project's keys, whose assets do nothing."""
    done: set[str] = set()

    def stage(key: dg.AssetKey, needs: set[dg.AssetKey]) -> dg.AssetsDefinition:
        @dg.asset(key=key, deps=needs)
        def nothing() -> None:
            done.add(key.to_user_string())

        return nothing

    known = plans(PROJECT)
    from assets.definitions import defs

    graph = defs.resolve_asset_graph()
    empty = dg.Definitions(assets=[stage(key, set(graph.get(key).parent_keys)) for key in known])
    monkeypatch.setattr(bootstrap, "_GRAPH", [empty])
    monkeypatch.setattr(
        bootstrap, "stale_now", lambda instance, project: {dg.AssetKey(name.split("/")): "new" for name in stale}
    )
    run = instance.create_run_for_job(rerun_source)
    rerun_stages(instance, run, PROJECT, LOG)
    return done


STAGES = (
    *("retargeted_motions", "motion_variants", "reference_motions", "tracking_policy", "augmented_motions"),
    *("feasible_motions", "expert_db"),
)


def motions_of(robot: str) -> set[str]:
    of_robot = robot_plans(robot)
    return {plan.name for plan in SHARED} | {of_robot[name].key.to_user_string() for name in STAGES}


def test_all_stages_of_motions_run_and_of_the_rest_what_is_stale_and_needed(instance, monkeypatch):
    found = worked_on(instance, monkeypatch, ["robot_model", "k1/robot_model", "mujoco_validation"])
    assert found == motions_of("t1") | {"robot_model"}


def test_another_robot_s_stages_run_where_it_has_a_database(instance, monkeypatch):
    instance.report_runless_asset_event(dg.AssetMaterialization(asset_key=robot_plans("k1")["expert_db"].key))
    assert worked_on(instance, monkeypatch, []) == motions_of("t1") | motions_of("k1")


def test_a_run_that_is_launched_by_the_tag_of_no_source_works_on_nothing(instance, monkeypatch):
    note_sources(instance, ["walks"])
    monkeypatch.setattr(source_jobs, "rerun_stages", lambda *_: pytest.fail("it works"))
    tags = {"dagster/partition": "nowhere"}
    done = rerun_source.execute_in_process(
        instance=instance, tags=tags, resources={"io_manager": object()}, raise_on_error=False
    )
    (failed,) = (each for each in done.all_events if each.is_step_failure)
    assert "unknown source 'nowhere'; there are: walks" in str(failed.event_specific_data)
