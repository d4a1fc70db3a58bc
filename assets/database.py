"""`expert_db`: written when something it depends on changed, left alone when nothing did."""

from collections.abc import Iterator
from typing import Any

import dagster as dg
import pandas as pd

from assets.bootstrap import stale_now
from assets.curator_link import curator_link
from assets.database_checks import judge_database, last_verdicts
from assets.plan import FINGERPRINT_TAG, Plan
from assets.project import DEFAULT_ROBOT, PROJECT
from assets.realizability import realizability_check
from assets.report import picture, table_of
from pipeline.batch import Manifest
from pipeline.files import settings


def materialize_database(
    context: dg.AssetExecutionContext, plan: Plan, feasible: Manifest, pool: Any
) -> Iterator[dg.MaterializeResult | dg.AssetCheckResult]:
    """Write the database of what left KP5 and judge it, or say that nothing is stale and what was judged.

    Raises NoClipsError and DatabaseLossError for a database that may not take the place of the one before.
    """
    from pipeline.expert import DatabaseSettings, write_database
    from pipeline.expert.index import database_version
    from pipeline.robot import load_robot

    why = stale_now(context.instance, PROJECT).get(plan.key)
    if why is None:
        context.log.info(f"nothing is stale: '{plan.key.to_user_string()}' is up to date, nothing to do")
        yield from last_verdicts(plan, context.instance)
        return
    context.log.info(f"'{plan.key.to_user_string()}' is written: {why}")
    robot = load_robot(PROJECT.robot_folder(plan.robot or DEFAULT_ROBOT))
    folder = PROJECT.expert_db(robot.name)
    values = settings.read(PROJECT.settings("database.yaml"), DatabaseSettings)
    manifest = write_database(folder, _entries(feasible), robot, stages=feasible.settings, settings=values, pool=pool)
    realizable, accuracy = realizability_check(plan, feasible, pool, context.log)
    metadata = {
        **curator_link("databases"),
        "dagster/uri": dg.MetadataValue.path(str(folder)),
        **_metadata(manifest, feasible.entry_table()),
    }
    if accuracy is not None:
        metadata["realizability"] = accuracy
    yield dg.MaterializeResult(
        asset_key=plan.key,
        metadata=metadata,
        data_version=dg.DataVersion(database_version(folder)),
        tags={FINGERPRINT_TAG: plan.fingerprint(PROJECT)},
    )
    yield from judge_database(plan, frames=False)  # they were read when they were written
    yield realizable


def _entries(feasible: Manifest) -> Iterator[Any]:
    from pipeline.expert import ExpertEntry, StoredClip

    for entry in feasible.entries:
        yield ExpertEntry(
            clip=StoredClip(name=entry.clip, blob=entry.blob, store=PROJECT.store),
            weight=entry.numbers["weight"],
            skill=entry.numbers["skill"],
            licence=entry.numbers["licence"],
            numbers=entry.numbers,
            stages={"stages": [{**done, "parameters": feasible.settings[done["settings"]]} for done in entry.record]},
        )


def _metadata(manifest: dict[str, Any], index: pd.DataFrame) -> dict[str, Any]:
    from pipeline.feasibility.command_space import by_command
    from pipeline.viewing.plots import command_seconds

    title = f"{manifest['robot']} expert database"
    seconds = manifest["seconds_by_skill"]
    by_skill = pd.DataFrame({"skill": list(seconds), "seconds": [float(value) for value in seconds.values()]})
    columns = ["clip", "skill", "seconds", "weight", "forward_m_s", "lateral_m_s", "yaw_rate_rad_s", "licence"]
    return {
        "clips": manifest["clips"],
        "frames": manifest["frames"],
        "seconds": manifest["seconds"],
        "strictest licence": manifest["licence"]["strictest"],
        "allowed use": manifest["licence"]["allowed_use"],
        "dagster/row_count": manifest["clips"],
        **({"coverage": picture(command_seconds(by_command(index), title))} if len(index) else {}),
        "seconds by skill": table_of(by_skill, ["skill", "seconds"]),
        "clips of the database": table_of(index.sort_values("clip"), columns),
    }
