"""Steps that all clip stages share: the stage with its versions, and the result with checks and metadata."""

from collections.abc import Callable, Mapping
from functools import partial
from typing import Any

import dagster as dg
import pandas as pd

from assets.checks import evaluate
from assets.plan import Plan, digest_of_robot
from assets.report import curator_link, result_of, table_of
from pipeline.batch import Manifest, Stage
from pipeline.batch.shard import MISSING
from pipeline.errors import PipelineError
from pipeline.feasibility import FeasibilitySettings, criteria_table, process
from pipeline.feasibility.criteria_table import BY_CRITERION, MARGINS, by_criterion, worst_margins
from pipeline.feasibility.image import nothing_assessed, pair
from pipeline.feasibility.reference import CONTENT, StoredReferences
from pipeline.files import settings
from pipeline.files.sourced import Origin, origins
from pipeline.project import DEFAULT_ROBOT, PROJECT
from pipeline.readers.listing import load_reference, named_reference
from pipeline.robot import Robot, load_robot
from pipeline.robot.size import scaled


def stage_of(
    plan: Plan,
    function: Callable[..., Any],
    values: Any,
    *,
    prepare: Callable[..., Any] | None = None,
    together: Callable[[str], str] | None = None,
    name: str = "",
    robot_files: str | None = None,
) -> Stage:
    """The stage of an asset.

    Args:
        plan: plan of the asset
        function: pure function of a clip (docs/architecture.md)
        values: settings dataclass, or None
        prepare: see `pipeline.batch.Stage`
        together: see `pipeline.batch.Stage`
        name: name of the stage if the asset has more than one
        robot_files: digest of the robot, if it is not that of the robot's folder
    """
    if plan.robot and robot_files is None:
        robot_files = digest_of_robot(PROJECT, plan.robot)
    return Stage(
        name=name or plan.name,
        version=plan.code_version(),
        function=function,
        prepare=prepare,
        together=together,
        settings=settings.plain(values) if values is not None else {},
        depends={"robot_files": robot_files} if robot_files else {},
        robot=plan.robot or "",
    )


def feasibility_stage(plan: Plan, tracked: StoredReferences) -> tuple[Stage, FeasibilitySettings, Robot]:
    """KP5 on the adapted robot: the stage, its settings scaled to the robot's size, and the robot.

    `reference_motions` and `feasible_motions` share it, so that the second reuses the first one's results.

    Args:
        plan: plan of the asset
        tracked: references of the rollouts among the clips
    """
    robot = load_robot(PROJECT.adapted_robot(plan.robot or DEFAULT_ROBOT))
    values = scaled(PROJECT.read("feasibility.yaml", FeasibilitySettings), robot)
    function = partial(process, settings=values, robot=robot, references=tracked)
    stage = stage_of(plan, function, values, prepare=nothing_assessed, together=pair, robot_files=robot.digest)
    return stage, values, robot


def materialized(plan: Plan, manifest: Manifest, metadata: Mapping[str, Any]) -> dg.MaterializeResult:
    """Result of a stage with its checks and a link to its clips on the curator's page."""
    link = curator_link(f"?stage={plan.name}") if manifest.judged else {}
    faults = manifest.reason_counts("rejected")["failed"]
    return result_of(plan, manifest, {**metadata, **link}, evaluate(plan, manifest), faults=faults)


def thresholds() -> dict[str, Origin]:
    """Name -> unit and source of each threshold in data/feasibility.yaml."""
    return origins(settings.read_yaml(PROJECT.settings("feasibility.yaml")))


def write_table(plan: Plan, table: pd.DataFrame, manifest: Manifest) -> dict[str, Any]:
    """Write the criteria table beside the manifest that will be stored. Returns rows for the asset's page."""

    path = criteria_table.path_beside(PROJECT.store.manifest_path(plan.key.to_user_string()))
    criteria_table.write(path, table, manifest)
    return {
        "table of criteria": dg.MetadataValue.path(str(path)),
        "criteria": table_of(by_criterion(table), BY_CRITERION),
        "margins, the worst first": table_of(worst_margins(table), MARGINS),
    }


def references_of(manifest: Manifest, reference_motions: Manifest | None = None) -> StoredReferences:
    """References of the rollouts among the clips of a manifest, readable from any process.

    Args:
        manifest: clips to evaluate
        reference_motions: references of the rollouts of `augmented_motions`; other rollouts name a file of their source
    """

    files = {
        content: (source, file)
        for content, source, file in manifest.kept(CONTENT, "source", "file")
        if content is not MISSING and content
    }
    blobs = dict(reference_motions.kept("clip", "blob")) if reference_motions else {}
    for content, (source, file) in sorted(files.items()):
        found = _reference(str(source), str(file))
        if found is not None and found.content == content:
            blobs[content] = PROJECT.store.put_clip(found.clip)
    return StoredReferences(store=PROJECT.store, blobs=blobs)


def _reference(source_name: str, file: str) -> Any:
    """The current motion in a file of a source; None if it no longer exists or is unreadable."""

    try:
        source = next(source for source in PROJECT.sources().all if source.name == source_name)
        named = named_reference(source.folder / file, source)
        return None if named is None else load_reference(source.folder / file, source, named)
    except (PipelineError, OSError, StopIteration):
        return None
