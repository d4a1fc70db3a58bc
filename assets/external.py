"""What comes from outside the graph, as it is now, noted in the history where it changed."""

from typing import Any

import dagster as dg

from assets.actuators import measurements_key, measurements_version
from assets.approved import approved_versions
from assets.hardware import HARDWARE_LOGS, logs_version
from assets.project import Project
from assets.sources import DATA_VERSION_TAG, RAW_MOTIONS, motions_version
from pipeline.errors import PipelineError


def note_external(instance: dg.DagsterInstance, project: Project) -> dict[dg.AssetKey, str]:
    """Version of each external asset; one that changed since it was last noted is noted in the history.

    Motions that can't be listed keep the version that was noted last: what needs them asks for them itself
    (`assets.bootstrap`) and fails with the reason, what does not (logs, approvals) is not kept from its work.
    """
    versions = _motions(instance, project)
    for robot in project.robots:
        key, version = measurements_key(robot), measurements_version(project, robot)
        versions[key] = version
        _note(instance, key, version, {"files": len(list(project.actuators(robot).glob("*.csv")))})
    versions[HARDWARE_LOGS], facts = logs_version(project)
    _note(instance, HARDWARE_LOGS, versions[HARDWARE_LOGS], facts)
    for key, (version, facts) in approved_versions(project).items():
        versions[key] = version
        _note(instance, key, version, facts)
    return versions


def _motions(instance: dg.DagsterInstance, project: Project) -> dict[dg.AssetKey, str]:
    """The version of the motions, where there is one."""
    try:
        version, facts = motions_version(project)
    except PipelineError:
        noted = _noted(instance, RAW_MOTIONS)
        return {} if noted is None else {RAW_MOTIONS: noted}
    _note(instance, RAW_MOTIONS, version, facts)
    return {RAW_MOTIONS: version}


def _noted(instance: dg.DagsterInstance, key: dg.AssetKey) -> str | None:
    """The version of an asset that the history notes."""
    last = instance.get_latest_materialization_event(key)
    noted = last.asset_materialization.tags if last and last.asset_materialization else None
    return (noted or {}).get(DATA_VERSION_TAG)


def _note(instance: dg.DagsterInstance, key: dg.AssetKey, version: str, facts: dict[str, Any]) -> None:
    """As a materialization that happened outside: Dagster holds an external asset's versions against these."""
    if _noted(instance, key) != version:
        event = dg.AssetMaterialization(asset_key=key, tags={DATA_VERSION_TAG: version}, metadata=facts)
        instance.report_runless_asset_event(event)
