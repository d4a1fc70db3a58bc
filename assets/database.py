"""`expert_db`, written again when one of its inputs changed, and its exports to other formats."""

from collections.abc import Iterator
from typing import Any

import dagster as dg
import pandas as pd

from assets.bootstrap import stale_now
from assets.database_checks import BLOCKING, CHECKS, judge_contents, last_verdicts, realizability_check
from assets.plan import EXPORTS, FINGERPRINT_TAG, Plan, robot_plans
from assets.report import asset_of, curator_link, picture, result_of, robot_asset, table_of
from assets.resources import ClipPoolResource
from pipeline.batch import Manifest
from pipeline.dataset_export import export_database
from pipeline.expert import DatabaseSettings, ExpertEntry, StoredClip, write_database
from pipeline.expert.manifest import FILE as MANIFEST
from pipeline.feasibility.command_space import SECONDS_COLUMN, VELOCITIES, by_command
from pipeline.files import digest
from pipeline.files.swap import replace_folder
from pipeline.project import DEFAULT_ROBOT, PROJECT


@robot_asset("json", checks=CHECKS, blocking=BLOCKING, output_required=False)
def expert_db(
    context: dg.AssetExecutionContext,
    clip_pool: ClipPoolResource,
    feasible_motions: Manifest,
    robot_model: Manifest,
    plan: Plan,
) -> Iterator[dg.MaterializeResult | dg.AssetCheckResult]:
    """Expert motion database: one AMP clip per file, an index with weights and provenance, and a manifest."""
    feasible, pool = feasible_motions, clip_pool.pool()
    why = stale_now(context.instance, PROJECT).get(plan.key)
    if why is None:
        context.log.info(f"nothing is stale: '{plan.key.to_user_string()}' is up to date, nothing to do")
        yield from last_verdicts(plan, context.instance)
        return
    context.log.info(f"'{plan.key.to_user_string()}' is written: {why}")
    robot = PROJECT.robot(plan.robot or DEFAULT_ROBOT)
    folder = PROJECT.expert_db(robot.name)
    values = PROJECT.read("database.yaml", DatabaseSettings)
    written = write_database(folder, _entries(feasible), robot, stages=feasible.settings, settings=values, pool=pool)
    version = dg.DataVersion(digest.of_file(folder / MANIFEST))  # now: a person may restore another one later
    realizable, accuracy = realizability_check(plan, feasible, pool, context.log)
    metadata = {
        **curator_link("databases"),
        "dagster/uri": dg.MetadataValue.path(str(folder)),
        **_metadata(written.manifest, feasible.entry_table([*SHOWN, *VELOCITIES, SECONDS_COLUMN])),
    }
    if accuracy is not None:
        metadata["realizability"] = accuracy
    yield dg.MaterializeResult(
        asset_key=plan.key,
        metadata=metadata,
        data_version=version,
        tags={FINGERPRINT_TAG: plan.fingerprint(PROJECT)},
    )
    yield from judge_contents(plan, written)
    yield realizable


def _entries(feasible: Manifest) -> Iterator[Any]:
    """Yield an entry for each clip; consecutive clips with equal records share one description of their stages."""
    record, stages = None, {}
    for entry in feasible.entries:
        if entry.record != record:
            record = entry.record
            stages = {"stages": [{**done, "parameters": feasible.settings[done["settings"]]} for done in record]}
        yield ExpertEntry(
            clip=StoredClip(name=entry.clip, blob=entry.blob, store=PROJECT.store),
            weight=entry.numbers["weight"],
            skill=entry.numbers["skill"],
            licence=entry.numbers["licence"],
            numbers=entry.numbers,
            stages=stages,
        )


SHOWN = ("clip", "skill", "seconds", "weight", "forward_m_s", "lateral_m_s", "yaw_rate_rad_s", "licence")
"""Columns of the table of clips on the asset's page."""


def _metadata(manifest: dict[str, Any], index: pd.DataFrame) -> dict[str, Any]:
    from pipeline.viewing.plots import command_seconds

    title = f"{manifest['robot']} expert database"
    seconds = manifest["seconds_by_skill"]
    by_skill = pd.DataFrame({"skill": list(seconds), "seconds": [float(value) for value in seconds.values()]})
    by_velocity = pd.DataFrame(
        index, columns=[name for name in ("seconds", *VELOCITIES, SECONDS_COLUMN) if name in index]
    )
    return {
        "clips": manifest["clips"],
        "frames": manifest["frames"],
        "seconds": manifest["seconds"],
        "strictest licence": manifest["licence"]["strictest"],
        "allowed use": manifest["licence"]["allowed_use"],
        "dagster/row_count": manifest["clips"],
        **({"coverage": picture(command_seconds(by_command(by_velocity), title))} if len(index) else {}),
        "seconds by skill": table_of(by_skill, ["skill", "seconds"]),
        "clips of the database": table_of(index.sort_values("clip"), SHOWN),
    }


EXPORT = "export"
"""Key of the export's facts in its manifest."""


def dataset_exports(robot: str) -> list[Any]:
    """One asset for each format of `booster-lab export`."""
    plans = robot_plans(robot)
    return [_export(plans[name], kind) for kind, name in EXPORTS.items()]


def _export(plan: Plan, kind: str) -> Any:
    @asset_of(
        plan,
        kind,
        deps=["expert_db"],
        description=f"Expert database in the format of `booster-lab export --format {kind}`, with its dataset card.",
    )
    def dataset_export(context: dg.AssetExecutionContext):
        robot = plan.robot or DEFAULT_ROBOT
        folder = PROJECT.exports(robot, kind)
        written: list[int] = []

        def fill(part: Any) -> None:
            source = PROJECT.expert_db(robot)
            written.append(export_database(source, kind, PROJECT.robot, part))

        replace_folder(folder, fill)
        files = {
            path.relative_to(folder).as_posix(): digest.of_file(path)
            for path in sorted(folder.rglob("*"))
            if path.is_file()
        }
        facts = {
            "stage": plan.name,
            "format": kind,
            "folder": folder.relative_to(PROJECT.root).as_posix(),
            "clips": written[0],
            "files": files,
        }
        context.log.info(f"{written[0]} clips in {folder}")
        metadata = {
            "clips": written[0],
            "files": len(files),
            "size [MB]": sum((folder / name).stat().st_size for name in files) / 1e6,
            "dagster/uri": dg.MetadataValue.path(str(folder)),
        }
        return result_of(plan, {EXPORT: facts}, metadata)

    return dataset_export
