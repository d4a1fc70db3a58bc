"""Checks on the expert database: evaluated when it is written, repeated by a run that finds nothing stale.

The check `realizability` measures whether a classifier can distinguish the database from rollouts in simulation.
"""

import dataclasses
import logging
from collections.abc import Iterator, Mapping
from functools import partial
from typing import Any

import dagster as dg
import pandas as pd
from dagster._core.storage.asset_check_execution_record import AssetCheckExecutionRecordStatus

from assets.plan import Plan, robot_plans
from assets.report import check_result, table_of
from assets.tracker_choice import tracker_file
from pipeline.actuators.adapted_robot import read_actuators, torque_envelope
from pipeline.batch import Manifest, Stage
from pipeline.errors import FileError, PipelineError
from pipeline.expert import DatabaseError, check_database
from pipeline.expert.read import Contents
from pipeline.expert.realizability import SECONDS, TooFewMotionsError, accuracy_against_rollouts
from pipeline.feasibility import CommandSettings, FeasibilitySettings, coverage
from pipeline.feedback.windows import unmet_requests
from pipeline.files import settings
from pipeline.project import DEFAULT_ROBOT, PROJECT
from pipeline.robot import load_robot
from pipeline.tracking.process import Setup, disturbed_motion
from pipeline.tracking.settings import TrackingSettings

REALIZABLE = "realizability"
WARN_ABOVE = 0.75
"""Held-out accuracy above which a discriminator separates them too easily to give a useful reward."""
OTHER_SEED = 1000
"""Offset to the seed of `data/tracking.yaml`: the same distribution of disturbances, other samples."""


class NoTrackerError(PipelineError):
    """The robot has no tracker; its database consists of references."""


def realizability_check(
    plan: Plan, feasible: Manifest, pool: Any, log: logging.Logger
) -> tuple[dg.AssetCheckResult, float | None]:
    """Result of the check, and the held-out accuracy.

    The accuracy is None if it is not measured: too few motions, no tracker, or (a warning) an unreadable file.
    """
    try:
        accuracy = held_out_accuracy(plan.robot or DEFAULT_ROBOT, feasible, pool, log)
    except (TooFewMotionsError, NoTrackerError) as error:
        return check_result(plan, REALIZABLE, True, f"not measured: {error}"), None
    except FileError as error:
        return check_result(plan, REALIZABLE, False, f"not measured: {error}"), None
    found = f"held-out accuracy {accuracy:.2f} (0.5 is chance level; warning above {WARN_ABOVE:g})"
    return check_result(plan, REALIZABLE, accuracy <= WARN_ABOVE, found), accuracy


def held_out_accuracy(robot_name: str, clips: Manifest, pool: Any, log: logging.Logger, seed: int = 0) -> float:
    """Held-out accuracy of a classifier between clips and rollouts of their references with another seed.

    The rollouts are of the stored tracker. Raises NoTrackerError, TooFewMotionsError.
    """
    plans, folder = robot_plans(robot_name), PROJECT.adapted_robot(robot_name)
    robot = load_robot(folder)
    references = PROJECT.store.load(plans["reference_motions"].key.to_user_string())
    found = tracker_file(PROJECT, PROJECT.store.load(plans["tracking_policy"].key.to_user_string()))
    if found is None:
        raise NoTrackerError(f"there is no tracker of '{robot_name}'.")
    tracker, content = found
    values = PROJECT.read("tracking.yaml", TrackingSettings)
    other = dataclasses.replace(values, seed=values.seed + OTHER_SEED + seed)
    envelope = torque_envelope(read_actuators(folder))
    setup = Setup(settings=other, robot=robot, envelope=envelope, tracker=tracker)
    stage = Stage(
        name=REALIZABLE,
        version=plans["augmented_motions"].code_version(),
        function=partial(disturbed_motion, setup=setup, longest_s=SECONDS),
        settings={**settings.plain(other), "longest_s": SECONDS},
        depends={"robot_files": robot.digest, "tracker": content},
    )
    return accuracy_against_rollouts(clips, references, stage, robot, PROJECT.store, pool, log, seed)


WHOLE = "whole_database"
COVERED = "every_skill_has_seconds"
COMMANDS = "command_coverage"
MIN_SKILL_SECONDS = 4.0


BLOCKING = {WHOLE: "It has clips, files match their digests, frames are finite, quaternions unit, weights positive."}
CHECKS = {
    COVERED: f"Each of the ten skills has at least {MIN_SKILL_SECONDS:g} s before mirroring.",
    COMMANDS: "The clips cover every speed of the command ranges: forward, backward, lateral, turning.",
    REALIZABLE: f"A classifier distinguishes windows of the database from rollouts with other seeds with an "
    f"accuracy of at most {100 * WARN_ABOVE:.0f} % on held-out windows; 50 % is chance level.",
}


def judge_database(plan: Plan) -> Iterator[dg.AssetCheckResult]:
    """Evaluate the checks on the database on disk."""
    try:
        database = check_database(PROJECT.expert_db(plan.robot or DEFAULT_ROBOT))
    except DatabaseError as error:
        for name in (WHOLE, COVERED, COMMANDS):
            yield check_result(plan, name, False, str(error), warn=False)
        return
    yield from judge_contents(plan, database)


def judge_contents(plan: Plan, database: Contents) -> Iterator[dg.AssetCheckResult]:
    """Evaluate the checks on a database that was read completely."""
    yield check_result(plan, WHOLE, len(database.index) > 0, f"{len(database.index)} clips", warn=False)
    if database.index.empty:
        for name in (COVERED, COMMANDS):
            yield check_result(plan, name, False, "there are no clips", warn=False)
        return
    yield _every_skill(plan, database.index, database.manifest["stages"])
    yield _every_command(plan, database.index)


def last_verdicts(plan: Plan, instance: dg.DagsterInstance) -> list[dg.AssetCheckResult]:
    """The last result of each check, for a run that finds nothing stale; without them Dagster would show no results.

    Evaluates the checks again if one has no result yet.
    """
    evaluations = []
    for name in (*BLOCKING, *CHECKS):
        records = instance.event_log_storage.get_asset_check_execution_history(
            dg.AssetCheckKey(plan.key, name),
            limit=1,
            status={AssetCheckExecutionRecordStatus.SUCCEEDED, AssetCheckExecutionRecordStatus.FAILED},
        )
        evaluation = records[0].evaluation if records else None
        if evaluation is None:
            return list(judge_database(plan))
        evaluations.append(
            dg.AssetCheckResult(
                asset_key=plan.key,
                check_name=name,
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
    missing = unmet_requests(stages)
    unmet = {"requested by feedback, not met": "; ".join(missing)} if missing else {}
    return check_result(plan, COVERED, not poor, ", ".join(poor) or "all", unmet)


def _every_command(plan: Plan, index: pd.DataFrame) -> dg.AssetCheckResult:
    values = PROJECT.read("feasibility.yaml", FeasibilitySettings)
    found = coverage(index, values.balance, PROJECT.read("commands.yaml", CommandSettings))
    axes, plane = found.cells.query("axis != 'forward_yaw'"), found.cells.query("axis == 'forward_yaw'")
    columns = ["axis", "low", "high", "seconds", "effective_seconds_before", "effective_seconds", "clips", "families"]
    shown = {
        "seconds by command": table_of(axes, columns),
        "seconds by forward speed and yaw rate": table_of(plane, ["low", "high", "low_2", "high_2", *columns[3:]]),
    }
    return check_result(plan, COMMANDS, not found.missing, " ".join(found.missing) or "nothing is missing", shown)
