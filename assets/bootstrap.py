"""Materialize stale upstream assets in a second run, before the first step of a run.

Thus `dagster asset materialize --select expert_db` is sufficient on a fresh clone and after any change. The second run
appears in Dagster's history. The versions of the external assets are recorded first.
"""

import logging
import time
from collections.abc import Mapping
from typing import Any

import dagster as dg

from assets.actuators import MEASUREMENTS, measurements_version
from assets.approved import approved_versions
from assets.freshness import last_tags, last_tags_of, stale_reasons
from assets.hardware import HARDWARE_LOGS, logs_version
from assets.plan import SHARED, Plan, key_of, plans, robot_plans
from assets.report import stop
from assets.sources import (
    DATA_VERSION_TAG,
    RAW_MOTIONS,
    find_motions,
    motions_version,
    note_sources,
    remember_sources,
)
from assets.tracker_choice import trackers_for
from pipeline.errors import PipelineError
from pipeline.project import DEFAULT_ROBOT, Project


def note_external(instance: dg.DagsterInstance, project: Project) -> dict[dg.AssetKey, str]:
    """Version of each external asset; a changed version is recorded in Dagster's history.

    If the motions can't be listed, their last recorded version stays. `bring_up_to_date` lists them again for a run
    that needs them and fails with the reason; runs that do not need them (logs, approvals) continue.
    """
    found: dict[dg.AssetKey, tuple[str, dict[str, Any]]] = {HARDWARE_LOGS: logs_version(project)}
    found |= {key_of(MEASUREMENTS, robot): measurements_version(project, robot) for robot in project.robots}
    found |= approved_versions(project)
    tags = last_tags_of(instance, [RAW_MOTIONS, *found])
    recorded = {key: own[DATA_VERSION_TAG] for key, own in tags.items() if DATA_VERSION_TAG in own}
    versions: dict[dg.AssetKey, str] = {}
    try:
        found[RAW_MOTIONS] = motions_version(project)
    except PipelineError:
        versions |= {key: version for key, version in recorded.items() if key == RAW_MOTIONS}
    else:
        note_sources(instance, [source.name for source in project.sources().all])
    for key, (version, facts) in found.items():
        versions[key] = version
        if recorded.get(key) != version:  # Dagster compares an external asset's versions with materializations
            event = dg.AssetMaterialization(asset_key=key, tags={DATA_VERSION_TAG: version}, metadata=facts)
            instance.report_runless_asset_event(event)
    return versions


BOOTSTRAP_TAG = "booster_lab/bootstrap_for"
"""Tag of a run that was started to bring inputs up to date; its value is the run it was started for."""

_GRAPH: list[dg.Definitions] = []


def serve(graph: dg.Definitions) -> dg.Definitions:
    """Register the assembled graph, called by `assets.definitions`: this module can't import it (import cycle)."""
    _GRAPH[:] = [graph]
    return graph


def _graph() -> dg.Definitions:
    if not _GRAPH:
        raise RuntimeError("no graph was assembled in this process; import assets.definitions first")
    return _GRAPH[0]


def stale_now(
    instance: dg.DagsterInstance, project: Project, forced: Mapping[dg.AssetKey, str] | None = None
) -> dict[dg.AssetKey, str]:
    """Every stale asset with the reason, upstream first. Reads the external files again.

    Args:
        forced: assets to treat as stale in any case, with the reason
    """
    external = note_external(instance, project)
    return stale_reasons(instance, project, plans(project), _parents(), external, forced or {})


def bring_up_to_date(instance: dg.DagsterInstance, run: dg.DagsterRun, project: Project, log: logging.Logger | None):
    """Materialize the stale assets upstream of a run that the run itself does not materialize, in a second run.

    Before a policy is trained on a GPU, its tracker is trained if the references require it. If the second run fails,
    the first one stops. Raises SourceLostError if motions are needed and a source of an earlier run is gone.
    """
    selected = assets_of(run)
    parents = hard_inputs(_parents(), plans(project))
    needed = upstream(selected, parents) - selected
    motions = find_motions(project) if SHARED[0].key in needed | selected else None
    if motions and log:
        for sentence in motions.warnings():
            log.warning(sentence)
    every_stale = stale_now(instance, project)
    if motions and SHARED[0].key not in every_stale:
        remember_sources(project, motions)
    trackers = trackers_for(selected, run.run_config, needed & set(every_stale), project)
    if set(trackers) - set(every_stale):
        why = "the policy needs a tracker that was trained on these references"
        every_stale = stale_now(instance, project, dict.fromkeys(trackers, why))
    stale = {key: why for key, why in every_stale.items() if key in needed}
    if not stale:
        return
    if log:
        for key, why in stale.items():
            log.info(f"'{key.to_user_string()}' is brought up to date first: {why}")
    configs = {key: config for key, config in trackers.items() if key in stale}
    _materialize(instance, run, list(stale), log, "the upstream assets could not be brought up to date", configs)


def rerun_stages(instance: dg.DagsterInstance, run: dg.DagsterRun, project: Project, log: logging.Logger) -> None:
    """Materialize all stages from the motions to the databases in a second run, stale or not.

    Robots: the default one, and those that already have a database. If the second run fails, the first one stops.
    """
    databases = {robot: robot_plans(robot)["expert_db"].key for robot in project.robots}
    targets = {
        key for robot, key in databases.items() if robot == DEFAULT_ROBOT or last_tags(instance, key) is not None
    }
    between = dg.AssetSelection.assets(SHARED[0].key).downstream() & dg.AssetSelection.assets(*targets).upstream()
    stages = between.resolve(_graph().resolve_asset_graph())
    needed = upstream(targets, hard_inputs(_parents(), plans(project)))
    stale = [key for key in stale_now(instance, project) if key in needed - stages]
    _materialize(instance, run, [*stale, *sorted(stages)], log, "not all stages could be materialized")


def _materialize(
    instance: dg.DagsterInstance,
    run: dg.DagsterRun,
    keys: list[dg.AssetKey],
    log: logging.Logger | None,
    beginning: str,
    configs: Mapping[dg.AssetKey, dict[str, Any]] | None = None,
) -> None:
    """Materialize assets in a second run for `run`. If it fails, `run` stops with a message that starts with
    `beginning`."""
    job = _graph().resolve_implicit_global_asset_job_def()
    if log:
        job = job.with_hooks({_progress(log, len(keys))})
    result = job.execute_in_process(
        instance=instance,
        asset_selection=keys,
        run_config={
            **{name: value for name, value in run.run_config.items() if name == "resources"},
            "ops": {key.to_python_identifier(): {"config": config} for key, config in (configs or {}).items()},
        },
        tags={BOOTSTRAP_TAG: run.run_id},
        raise_on_error=False,
    )
    if not result.success:
        failed = [f"'{event.step_key}': {cause(event)}" for event in result.all_events if event.is_step_failure]
        stop(f"{beginning} (run {result.run_id}). {'; '.join(failed)}")


def _progress(log: logging.Logger, stages: int) -> dg.HookDefinition:
    """Hook that logs the progress of the second run to the log of the run that a person started."""
    started_s, done = time.monotonic(), []

    @dg.success_hook
    def stage_done(context: dg.HookContext) -> None:
        done.append(context.op.name)
        left_s = (time.monotonic() - started_s) / len(done) * max(stages - len(done), 0)
        percent = 100 * len(done) // max(stages, len(done))
        rest = f", about {left_s:.0f} s left" if len(done) < stages else ""
        log.info(f"stage {len(done)} of {stages} is done ({percent} %): '{context.op.name}'{rest}")

    return stage_done


def assets_of(run: dg.DagsterRun) -> set[dg.AssetKey]:
    """The assets that a run materializes: its selection, or without one all assets of its job (sensor, schedule)."""
    if run.asset_selection:
        return set(run.asset_selection)
    return set(_graph().resolve_job_def(run.job_name).asset_layer.executable_asset_keys)


def cause(event: dg.DagsterEvent) -> str:
    """Message of the innermost error of a failed step."""
    error = event.step_failure_data.error
    while error is not None and error.cause is not None:
        error = error.cause
    return "no error was recorded" if error is None else error.message.split(": ", 1)[-1].strip()


def _parents() -> dict[dg.AssetKey, set[dg.AssetKey]]:
    graph = _graph().resolve_asset_graph()
    return {key: set(graph.get(key).parent_keys) for key in graph.get_all_asset_keys()}


def hard_inputs(
    parents: Mapping[dg.AssetKey, set[dg.AssetKey]], plans: Mapping[dg.AssetKey, Plan]
) -> dict[dg.AssetKey, set[dg.AssetKey]]:
    """Each asset -> its parents without soft inputs (`Plan.as_they_are`), which are materialized for it if stale.

    A policy is a soft input, so that no training starts on demand. External assets are left out.
    """
    return {
        key: {each for each in parents[key] if not plan.is_soft_input(each)}
        for key, plan in plans.items()
        if key in parents
    }


def upstream(keys: set[dg.AssetKey], parents: Mapping[dg.AssetKey, set[dg.AssetKey]]) -> set[dg.AssetKey]:
    """The given assets and everything upstream of them."""
    found, todo = set(keys), list(keys)
    while todo:
        new = parents.get(todo.pop(), set()) - found
        found |= new
        todo += new
    return found
