"""What is stale, and why: by Dagster's record of versions, and by the files on disk.

An asset is stale when it was never materialized, when its stored result is not the one of the last
materialization, when its code, settings or robot changed, or when an input changed or is stale.
"""

from collections.abc import Mapping

import dagster as dg

from assets.plan import EXPORTS, FAULTS_TAG, FINGERPRINT_TAG, Plan
from assets.project import Project
from assets.sources import DATA_VERSION_TAG
from pipeline.errors import PipelineError
from pipeline.expert.index import database_version
from pipeline.feasibility.criteria_table import belongs, path_beside
from pipeline.files import digest

INPUT_VERSION_PREFIX = "dagster/input_data_version/"
NEVER_MATERIALIZED = "INITIAL"
"""What Dagster notes as the version of an input that was never materialized."""


def stale_reasons(
    instance: dg.DagsterInstance,
    project: Project,
    plans: Mapping[dg.AssetKey, Plan],
    parents: Mapping[dg.AssetKey, set[dg.AssetKey]],
    external: Mapping[dg.AssetKey, str],
) -> dict[dg.AssetKey, str]:
    """Each stale asset with the reason, upstream before downstream.

    Args:
        parents: the assets that each one takes, external ones among them
        external: version of each external asset, as its files are now
    """
    stale: dict[dg.AssetKey, str] = {}
    versions: dict[dg.AssetKey, str | None] = dict(external)
    for key in topological(parents):
        if key not in plans:
            continue
        tags = last_tags(instance, key)
        versions[key] = tags.get(DATA_VERSION_TAG) if tags is not None else None
        reason = _why(key, tags, project, plans[key], parents[key], stale, versions)
        if reason:
            stale[key] = reason
    project.store.note_blobs()
    return stale


def topological(parents: Mapping[dg.AssetKey, set[dg.AssetKey]]) -> list[dg.AssetKey]:
    """Keys ordered so that each comes after all of its parents; ties by name."""
    ordered: list[dg.AssetKey] = []
    open_keys = sorted(set(parents) | {key for each in parents.values() for key in each})
    while open_keys:
        ready = [key for key in open_keys if all(parent in ordered for parent in parents.get(key, ()))]
        ordered += ready
        open_keys = [key for key in open_keys if key not in ready]
    return ordered


def _why(
    key: dg.AssetKey,
    tags: Mapping[str, str] | None,
    project: Project,
    plan: Plan,
    parents: set[dg.AssetKey],
    stale: Mapping[dg.AssetKey, str],
    versions: Mapping[dg.AssetKey, str | None],
) -> str:
    if tags is None:
        return "it was never materialized"
    if stored_version(project, plan) != tags.get(DATA_VERSION_TAG):
        return "what is stored is not the result of its last materialization"
    if tags.get(FAULTS_TAG, "0") != "0":
        return f"the stage itself failed on {tags[FAULTS_TAG]} clips, which are tried again"
    if tags.get(FINGERPRINT_TAG) != plan.fingerprint(project):
        return "its code, settings or robot changed"
    for parent in sorted(parents):
        if parent in stale and not plan.takes_as_it_is(parent):
            return f"'{parent.to_user_string()}' is stale"
        if _noted(tags, parent) != versions.get(parent):
            return f"'{parent.to_user_string()}' has new content"
    return ""


def _noted(tags: Mapping[str, str], parent: dg.AssetKey) -> str | None:
    """Version of an input that a materialization noted; None for one that had never been materialized then."""
    version = tags.get(INPUT_VERSION_PREFIX + parent.to_user_string())
    return None if version == NEVER_MATERIALIZED else version


def stored_version(project: Project, plan: Plan) -> str | None:
    """Data version of what is on disk for an asset; None if nothing readable is there, or a file is missing."""
    try:
        if plan.name == "expert_db":
            return database_version(project.expert_db(plan.robot or ""))
        if plan.name in ("adapted_robot", "exported_policy", *EXPORTS.values()) and not _whole(project, plan):
            return None
        if plan.name == "feasible_motions" and not _has_criteria(project, plan):
            return None
        asset = plan.key.to_user_string()
        return digest.of_file(project.store.manifest_path(asset)) if project.store.holds_blobs_of(asset) else None
    except (PipelineError, OSError):
        return None


def _whole(project: Project, plan: Plan) -> bool:
    """The files of an adapted robot or an exported policy are those that its manifest names."""
    (facts,) = project.store.load(plan.key.to_user_string()).settings.values()
    folder = project.root / facts["folder"] if "folder" in facts else project.adapted_robot(plan.robot or "")
    return all(digest.of_file(folder / name) == content for name, content in facts["files"].items())


def _has_criteria(project: Project, plan: Plan) -> bool:
    """The table of criteria beside the manifest is that of this manifest."""

    manifest = project.store.manifest_path(plan.key.to_user_string())
    return belongs(path_beside(manifest), manifest)


def last_tags(instance: dg.DagsterInstance, key: dg.AssetKey) -> Mapping[str, str] | None:
    """Tags of an asset's last materialization; None where it never was."""
    event = instance.get_latest_materialization_event(key)
    return None if event is None or event.asset_materialization is None else event.asset_materialization.tags or {}
