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
from pipeline.files import settings

WHOLE = "whole_database"
COVERED = "every_skill_has_seconds"
COMMANDS = "command_coverage"
MIN_SKILL_SECONDS = 4.0


def database_checks(plan: Plan) -> dg.AssetChecksDefinition:
    """The checks on the database, as a step of their own: one that wrote nothing has nothing to check."""
    specs = [
        dg.AssetCheckSpec(
            WHOLE,
            asset=plan.key,
            blocking=True,
            description="It has clips; every file has its digest; frames finite, quaternions unit, weights positive.",
        ),
        dg.AssetCheckSpec(
            COVERED,
            asset=plan.key,
            description=f"Each of the ten skills has at least {MIN_SKILL_SECONDS:g} s before mirroring.",
        ),
        dg.AssetCheckSpec(
            COMMANDS,
            asset=plan.key,
            description="The robot moves at every speed of the command ranges: forward, back, to both sides, turning.",
        ),
    ]

    @dg.multi_asset_check(name="_".join([*plan.key.path, "checks"]), specs=specs)
    def checks(context: dg.AssetCheckExecutionContext) -> Iterator[dg.AssetCheckResult]:
        from pipeline.expert import DatabaseError, read_database

        try:
            database = read_database(PROJECT.expert_db(plan.robot or DEFAULT_ROBOT))
        except DatabaseError as error:
            for name in (WHOLE, COVERED, COMMANDS):
                yield dg.AssetCheckResult(
                    asset_key=plan.key, check_name=name, passed=False, metadata={"faults": str(error)}
                )
            return
        found = {"clips": len(database.index)}
        yield dg.AssetCheckResult(asset_key=plan.key, check_name=WHOLE, passed=len(database.index) > 0, metadata=found)
        if database.index.empty:
            for name in (COVERED, COMMANDS):
                yield dg.AssetCheckResult(
                    asset_key=plan.key, check_name=name, passed=False, metadata={"found": "no clip is left"}
                )
            return
        yield _every_skill(plan, database.index)
        yield _every_command(plan, database.index)

    return checks


def materialize_database(
    context: dg.AssetExecutionContext, plan: Plan, feasible: Manifest
) -> Iterator[dg.MaterializeResult]:
    """Write the database of what left KP5, or say that nothing is stale and yield nothing."""
    from pipeline.expert import write_database
    from pipeline.expert.version import database_version
    from pipeline.robot import load_robot

    why = stale_now(context.instance, PROJECT).get(plan.key)
    if why is None:
        context.log.info(f"nothing is stale: '{plan.key.to_user_string()}' is up to date, nothing to do")
        return
    context.log.info(f"'{plan.key.to_user_string()}' is written: {why}")
    robot = load_robot(PROJECT.robot_folder(plan.robot or DEFAULT_ROBOT))
    folder = PROJECT.expert_db(robot.name)
    if not feasible.entries:
        context.log.error("no clip is left after KP5: the database is empty. The assets upstream say why, clip by clip")
    manifest = write_database(folder, _entries(feasible), robot, stages=feasible.settings)
    yield dg.MaterializeResult(
        asset_key=plan.key,
        metadata={"dagster/uri": dg.MetadataValue.path(str(folder)), **_metadata(manifest, feasible.entry_table())},
        data_version=dg.DataVersion(database_version(folder)),
        tags={FINGERPRINT_TAG: plan.fingerprint(PROJECT)},
    )


def _entries(feasible: Manifest) -> Iterator[Any]:
    from pipeline.clips.robot_clip import RobotClip
    from pipeline.expert import ExpertEntry

    for entry in feasible.entries:
        clip = PROJECT.store.get_clip(entry.blob, entry.clip)
        assert isinstance(clip, RobotClip)
        yield ExpertEntry(
            clip=clip,
            weight=entry.numbers["weight"],
            skill=entry.numbers["skill"],
            licence=entry.numbers["licence"],
            numbers=entry.numbers,
            stages={"stages": [{**done, "parameters": feasible.settings[done["settings"]]} for done in entry.record]},
        )


def _metadata(manifest: dict[str, Any], index: pd.DataFrame) -> dict[str, Any]:
    from pipeline.feasibility.command_seconds import by_command
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


def _every_skill(plan: Plan, index: pd.DataFrame) -> dg.AssetCheckResult:
    from pipeline.viewing.plots import SKILL_COLORS

    own = index[index["variant"] == "original"]
    seconds = {skill: float(own.loc[own["skill"] == skill, "seconds"].sum()) for skill in SKILL_COLORS}
    poor = [
        f"{skill} {value:.1f} s"
        for skill, value in seconds.items()
        if skill != "transition" and value < MIN_SKILL_SECONDS
    ]
    return dg.AssetCheckResult(
        asset_key=plan.key,
        check_name=COVERED,
        passed=not poor,
        severity=dg.AssetCheckSeverity.WARN,
        metadata={"found": ", ".join(poor) or "all"},
    )


def _every_command(plan: Plan, index: pd.DataFrame) -> dg.AssetCheckResult:
    from pipeline.feasibility import FeasibilitySettings, coverage

    found = coverage(index, settings.read(PROJECT.settings("feasibility.yaml"), FeasibilitySettings))
    axes, plane = found.cells.query("axis != 'forward_yaw'"), found.cells.query("axis == 'forward_yaw'")
    columns = ["axis", "low", "high", "seconds", "effective_seconds", "clips"]
    return dg.AssetCheckResult(
        asset_key=plan.key,
        check_name=COMMANDS,
        passed=not found.missing,
        severity=dg.AssetCheckSeverity.WARN,
        metadata={
            "missing": " ".join(found.missing) or "nothing",
            "seconds by command": table_of(axes, columns),
            "seconds by forward speed and yaw rate": table_of(
                plane, ["low", "high", "low_2", "high_2", "seconds", "effective_seconds", "clips"]
            ),
        },
    )
