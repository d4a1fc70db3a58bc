"""Which assets are stale, and why, by the versions that Dagster recorded and the files on disk.

An asset is stale if it was never materialized, if its stored result differs from the last materialization, if its
code, settings or robot changed, or if an input changed or is stale.
"""

import contextlib
from collections.abc import Collection, Mapping
from graphlib import TopologicalSorter

import dagster as dg

from assets.plan import EXPORTS, FAULTS_TAG, FINGERPRINT_DIGITS, FINGERPRINT_TAG, TRIALS, Plan, key_of
from assets.sources import DATA_VERSION_TAG
from pipeline.errors import PipelineError
from pipeline.expert.index import database_version
from pipeline.feasibility.criteria_table import belongs, path_beside
from pipeline.files import digest
from pipeline.project import DEFAULT_ROBOT, Project

INPUT_VERSION_PREFIX = "dagster/input_data_version/"
TRIALS_TAG = "booster_lab/trials"
"""Tag of a materialization that uses only the trials of its policy: their digest (`digest_of_trials`)."""
NEVER_MATERIALIZED = "INITIAL"
"""Version that Dagster records for an input that was never materialized."""


def stale_reasons(
    instance: dg.DagsterInstance,
    project: Project,
    plans: Mapping[dg.AssetKey, Plan],
    parents: Mapping[dg.AssetKey, set[dg.AssetKey]],
    external: Mapping[dg.AssetKey, str],
    forced: Mapping[dg.AssetKey, str] | None = None,
) -> dict[dg.AssetKey, str]:
    """Each stale asset with the reason, upstream before downstream.

    Args:
        parents: inputs of each asset, including external ones
        external: current version of each external asset
        forced: assets to treat as stale in any case, with the reason
    """
    stale: dict[dg.AssetKey, str] = {}
    versions: dict[dg.AssetKey, str | None] = dict(external)
    last = last_tags_of(instance, plans)
    for key in topological(parents):
        if key not in plans:
            continue
        tags, plan = last.get(key), plans[key]
        versions[key] = (tags or {}).get(DATA_VERSION_TAG)
        inputs = (_why_by_input(tags or {}, project, plan, parent, stale, versions) for parent in sorted(parents[key]))
        reason = (forced or {}).get(key) or _why_by_itself(tags, project, plan) or next(filter(None, inputs), "")
        if reason:
            stale[key] = reason
    project.store.note_blobs()
    return stale


def topological(parents: Mapping[dg.AssetKey, set[dg.AssetKey]]) -> list[dg.AssetKey]:
    """Keys ordered so that each comes after all of its parents; equal graphs give equal orders."""
    return list(TopologicalSorter({key: sorted(parents[key]) for key in sorted(parents)}).static_order())


def _why_by_itself(tags: Mapping[str, str] | None, project: Project, plan: Plan) -> str:
    """Why an asset is stale regardless of its inputs; empty if it is not."""
    if tags is None:
        return "it was never materialized"
    if stored_version(project, plan) != tags.get(DATA_VERSION_TAG):
        return "its stored result is not that of its last materialization"
    if tags.get(FAULTS_TAG, "0") != "0":
        return f"the stage itself failed on {tags[FAULTS_TAG]} clips; they are tried again"
    return "" if tags.get(FINGERPRINT_TAG) == plan.fingerprint(project) else "its code, settings or robot changed"


def _why_by_input(
    tags: Mapping[str, str],
    project: Project,
    plan: Plan,
    parent: dg.AssetKey,
    stale: Mapping[dg.AssetKey, str],
    versions: Mapping[dg.AssetKey, str | None],
) -> str:
    """Why an input makes an asset stale; empty if it does not."""
    name = parent.to_user_string()
    if parent in stale and not plan.is_soft_input(parent):
        return f"'{name}' is stale"
    used = tags.get(INPUT_VERSION_PREFIX + name)
    unchanged = (None if used == NEVER_MATERIALIZED else used) == versions.get(parent)
    if not unchanged and parent == TRIALS.key and TRIALS_TAG in tags:
        unchanged = tags[TRIALS_TAG] == digest_of_trials(project, plan.robot or DEFAULT_ROBOT)
    return "" if unchanged else f"'{name}' has new content"


def digest_of_trials(project: Project, robot: str) -> str:
    """Digest of the ingested trials of a robot's exported policy; no policy and no trials have the same digest."""
    trials: list[tuple[str, str]] = []
    with contextlib.suppress(PipelineError):
        (facts,) = project.store.load(key_of("exported_policy", robot).to_user_string()).settings.values()
        policies = {facts["digest"], facts["files"]["policy.npz"]}  # logs name either
        for entry in project.store.load(TRIALS.name).entries:
            if entry.numbers.get("robot") == robot and entry.numbers.get("policy_digest") in policies:
                trials.append((entry.clip, entry.blob))
    return digest.of_json(sorted(trials))[:FINGERPRINT_DIGITS]


def stored_version(project: Project, plan: Plan) -> str | None:
    """Data version of an asset's stored result; None if there is none, it is unreadable, or a file is missing."""
    try:
        if plan.name == "expert_db":
            return database_version(project.expert_db(plan.robot or ""))
        if plan.name in ("adapted_robot", "exported_policy", *EXPORTS.values()) and not _files_intact(project, plan):
            return None
        asset = plan.key.to_user_string()
        manifest = project.store.manifest_path(asset)
        if plan.name == "feasible_motions" and not belongs(path_beside(manifest), manifest):
            return None  # the criteria table beside the manifest belongs to another manifest
        return digest.of_file(manifest) if project.store.holds_blobs_of(asset) else None
    except (PipelineError, OSError):
        return None


def _files_intact(project: Project, plan: Plan) -> bool:
    """Whether the files of an adapted robot, an exported policy or a dataset match the digests in its manifest."""
    (facts,) = project.store.load(plan.key.to_user_string()).settings.values()
    folder = project.root / facts["folder"] if "folder" in facts else project.adapted_robot(plan.robot or "")
    return all(digest.of_file(folder / name) == content for name, content in facts["files"].items())


def last_tags(instance: dg.DagsterInstance, key: dg.AssetKey) -> Mapping[str, str] | None:
    """Tags of an asset's last materialization; None if it was never materialized."""
    return last_tags_of(instance, [key]).get(key)


def last_tags_of(instance: dg.DagsterInstance, keys: Collection[dg.AssetKey]) -> dict[dg.AssetKey, Mapping[str, str]]:
    """Tags of the last materialization of each asset, in one query; assets that never were materialized are missing."""
    events = instance.event_log_storage.get_latest_materialization_events(keys)
    made = {key: event.asset_materialization for key, event in events.items() if event is not None}
    return {key: materialization.tags or {} for key, materialization in made.items() if materialization is not None}
