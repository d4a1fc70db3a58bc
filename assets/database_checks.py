"""Checks on the expert database: evaluated when it is written, reported again by a run that found nothing stale."""

from collections.abc import Iterator, Mapping
from typing import Any

import dagster as dg
import pandas as pd
from dagster._core.storage.asset_check_execution_record import AssetCheckExecutionRecordStatus

from assets.chosen_windows import short_of_wanted
from assets.plan import Plan
from assets.project import DEFAULT_ROBOT, PROJECT
from assets.realizability import realizability_spec
from assets.report import table_of
from pipeline.files import settings

WHOLE = "whole_database"
COVERED = "every_skill_has_seconds"
COMMANDS = "command_coverage"
MIN_SKILL_SECONDS = 4.0
TOLD = {AssetCheckExecutionRecordStatus.SUCCEEDED, AssetCheckExecutionRecordStatus.FAILED}
"""A check that was evaluated; the third status is one that a run planned and never evaluated."""


def database_check_specs(plan: Plan) -> list[dg.AssetCheckSpec]:
    """The checks that the database declares."""
    return [
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
        realizability_spec(plan),
    ]


def judge_database(plan: Plan, *, frames: bool = True) -> Iterator[dg.AssetCheckResult]:
    """A verdict a check on the database as it is on the disk; without `frames` files are known by their digests."""
    from pipeline.expert import DatabaseError, check_database

    try:
        database = check_database(PROJECT.expert_db(plan.robot or DEFAULT_ROBOT), frames=frames)
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
    yield _every_skill(plan, database.index, database.manifest["stages"])
    yield _every_command(plan, database.index)


def last_verdicts(plan: Plan, instance: dg.DagsterInstance) -> list[dg.AssetCheckResult]:
    """The newest verdict a check, for a run that writes nothing: its plan would hide them, and they still hold.

    Evaluated again where one never was.
    """
    evaluations = []
    for spec in database_check_specs(plan):
        records = instance.event_log_storage.get_asset_check_execution_history(
            spec.key,
            limit=1,
            status={AssetCheckExecutionRecordStatus.SUCCEEDED, AssetCheckExecutionRecordStatus.FAILED},
        )
        evaluation = records[0].evaluation if records else None
        if evaluation is None:
            return list(judge_database(plan))
        evaluations.append(
            dg.AssetCheckResult(
                asset_key=plan.key,
                check_name=spec.name,
                passed=evaluation.passed,
                severity=evaluation.severity,
                metadata=evaluation.metadata,
            )
        )
    return evaluations


def _every_skill(plan: Plan, index: pd.DataFrame, stages: Mapping[str, Any]) -> dg.AssetCheckResult:
    from pipeline.viewing.plots import SKILL_COLORS

    own = index[index["variant"] == "original"]
    seconds = {skill: float(own.loc[own["skill"] == skill, "seconds"].sum()) for skill in SKILL_COLORS}
    poor = [
        f"{skill} {value:.1f} s"
        for skill, value in seconds.items()
        if skill != "transition" and value < MIN_SKILL_SECONDS
    ]
    short = short_of_wanted(stages)
    return dg.AssetCheckResult(
        asset_key=plan.key,
        check_name=COVERED,
        passed=not poor,
        severity=dg.AssetCheckSeverity.WARN,
        metadata={"found": ", ".join(poor) or "all", **({"wanted by feedback": "; ".join(short)} if short else {})},
    )


def _every_command(plan: Plan, index: pd.DataFrame) -> dg.AssetCheckResult:
    from pipeline.feasibility import CommandSettings, FeasibilitySettings, coverage

    values = settings.read(PROJECT.settings("feasibility.yaml"), FeasibilitySettings)
    found = coverage(index, values.balance, settings.read(PROJECT.settings("commands.yaml"), CommandSettings))
    axes, plane = found.cells.query("axis != 'forward_yaw'"), found.cells.query("axis == 'forward_yaw'")
    columns = ["axis", "low", "high", "seconds", "effective_seconds_before", "effective_seconds", "clips", "families"]
    return dg.AssetCheckResult(
        asset_key=plan.key,
        check_name=COMMANDS,
        passed=not found.missing,
        severity=dg.AssetCheckSeverity.WARN,
        metadata={
            "missing": " ".join(found.missing) or "nothing",
            "seconds by command": table_of(axes, columns),
            "seconds by forward speed and yaw rate": table_of(plane, ["low", "high", "low_2", "high_2", *columns[3:]]),
        },
    )
