"""`expert_db`: written when something it depends on changed, left alone when nothing did."""

from collections.abc import Iterator
from typing import Any

import dagster as dg
import pandas as pd

from assets.bootstrap import stale_now
from assets.plan import FINGERPRINT_TAG, Plan
from assets.project import DEFAULT_ROBOT, PROJECT
from assets.report import picture, table_of
from pipeline.batch import Manifest

WHOLE = "whole_database"
COVERED = "every_skill_has_seconds"
MIN_SKILL_SECONDS = 4.0


def database_checks(plan: Plan) -> list[dg.AssetCheckSpec]:
    """The checks that the database declares."""
    return [
        dg.AssetCheckSpec(
            WHOLE,
            asset=plan.key,
            blocking=True,
            description="Every file is there with its digest; frames are finite, quaternions unit, weights positive.",
        ),
        dg.AssetCheckSpec(
            COVERED,
            asset=plan.key,
            description=f"Each of the ten skills has at least {MIN_SKILL_SECONDS:g} s before mirroring.",
        ),
    ]


def materialize_database(
    context: dg.AssetExecutionContext, plan: Plan, feasible: Manifest
) -> Iterator[dg.MaterializeResult]:
    """Write the database of what left KP5, or say that nothing is stale and yield nothing."""
    from pipeline.expert import read_database, write_database
    from pipeline.expert.version import database_version
    from pipeline.robot import load_robot

    why = stale_now(context.instance, PROJECT).get(plan.key)
    if why is None:
        context.log.info(f"nothing is stale: '{plan.key.to_user_string()}' is up to date, nothing to do")
        return
    context.log.info(f"'{plan.key.to_user_string()}' is written: {why}")
    robot = load_robot(PROJECT.robot_folder(plan.robot or DEFAULT_ROBOT))
    folder = PROJECT.expert_db(robot.name)
    write_database(folder, _entries(feasible), robot, stages=feasible.settings)
    database = read_database(folder)
    yield dg.MaterializeResult(
        asset_key=plan.key,
        metadata={"dagster/uri": dg.MetadataValue.path(str(folder)), **_metadata(database.manifest, database.index)},
        check_results=_check_results(plan, database.index),
        data_version=dg.DataVersion(database_version(folder)),
        tags={FINGERPRINT_TAG: plan.fingerprint(PROJECT)},
    )


def _entries(feasible: Manifest) -> Iterator[Any]:
    from pipeline.clips.robot_clip import RobotClip
    from pipeline.expert import ExpertEntry

    for entry in feasible.entries:
        clip = PROJECT.store.get_clip(entry.blob)
        assert isinstance(clip, RobotClip)
        yield ExpertEntry(
            clip=clip,
            weight=entry.numbers["weight"],
            skill=entry.numbers["skill"],
            licence=entry.numbers["licence"],
            numbers=entry.numbers,
            stages={"stages": list(entry.record)},
        )


def _metadata(manifest: dict[str, Any], index: pd.DataFrame) -> dict[str, Any]:
    from pipeline.viewing.plots import command_coverage

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
        "seconds by skill": table_of(by_skill, ["skill", "seconds"]),
        "clips of the database": table_of(index.sort_values("clip"), columns),
        "coverage": picture(command_coverage(index, f"{manifest['robot']} expert database")),
    }


def _check_results(plan: Plan, index: pd.DataFrame) -> list[dg.AssetCheckResult]:
    from pipeline.viewing.plots import SKILL_COLORS

    own = index[index["variant"] == "original"] if "variant" in index else index
    seconds = own.groupby("skill")["seconds"].sum() if len(own) else pd.Series(dtype=float)
    poor = [
        f"{skill} {seconds.get(skill, 0.0):.1f} s"
        for skill in SKILL_COLORS
        if skill != "transition" and seconds.get(skill, 0.0) < MIN_SKILL_SECONDS
    ]
    return [
        dg.AssetCheckResult(asset_key=plan.key, check_name=WHOLE, passed=True, metadata={"clips": len(index)}),
        dg.AssetCheckResult(
            asset_key=plan.key,
            check_name=COVERED,
            passed=not poor,
            severity=dg.AssetCheckSeverity.WARN,
            metadata={"found": ", ".join(poor) or "all"},
        ),
    ]
