"""Checks on the expert database: evaluated when it is written, reported again by a run that found nothing stale.

One of them: can a classifier distinguish the database from what the robot does in simulation?
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
from pipeline.feedback.windows import short_of_wanted
from pipeline.files import settings
from pipeline.project import DEFAULT_ROBOT, PROJECT
from pipeline.robot import load_robot
from pipeline.tracking.process import Setup, disturbed_motion
from pipeline.tracking.settings import TrackingSettings

REALIZABLE = "realizability"
WARN_ABOVE = 0.75
"""Held-out accuracy from which an adversarial discriminator has little to learn from."""
OTHER_SEED = 1000
"""Added to the seed of `data/tracking.yaml`: the same kind of disturbances, drawn again."""


class NoTrackerError(PipelineError):
    """A robot without a tracker: its database is made of references."""


def realizability_check(
    plan: Plan, feasible: Manifest, pool: Any, log: logging.Logger
) -> tuple[dg.AssetCheckResult, float | None]:
    """The check's result, and the accuracy; None where it is not measured: too few motions to hold some out, no
    tracker, or, with a warning, a file that can't be read."""
    try:
        accuracy = measured(plan.robot or DEFAULT_ROBOT, feasible, pool, log)
    except (TooFewMotionsError, NoTrackerError) as error:
        return check_result(plan, REALIZABLE, True, f"not measured: {error}"), None
    except FileError as error:
        return check_result(plan, REALIZABLE, False, f"not measured: {error}"), None
    found = f"held-out accuracy {accuracy:.2f}; 0.5 is chance, a warning above {WARN_ABOVE:g}"
    return check_result(plan, REALIZABLE, accuracy <= WARN_ABOVE, found), accuracy


def measured(robot_name: str, clips: Manifest, pool: Any, log: logging.Logger, seed: int = 0) -> float:
    """Held-out accuracy between clips and rollouts of their references under another seed, by the stored tracker."""
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


BLOCKING = {WHOLE: "It has clips; every file has its digest; frames finite, quaternions unit, weights positive."}
CHECKS = {
    COVERED: f"Each of the ten skills has at least {MIN_SKILL_SECONDS:g} s before mirroring.",
    COMMANDS: "The robot moves at every speed of the command ranges: forward, back, to both sides, turning.",
    REALIZABLE: f"A classifier tells windows of the database from rollouts under other seeds in at most "
    f"{100 * WARN_ABOVE:.0f} of 100 held-out windows; 50 is chance.",
}


def judge_database(plan: Plan) -> Iterator[dg.AssetCheckResult]:
    """One verdict per check on the database on disk."""
    try:
        database = check_database(PROJECT.expert_db(plan.robot or DEFAULT_ROBOT))
    except DatabaseError as error:
        for name in (WHOLE, COVERED, COMMANDS):
            yield check_result(plan, name, False, str(error), warn=False)
        return
    yield from judge_contents(plan, database)


def judge_contents(plan: Plan, database: Contents) -> Iterator[dg.AssetCheckResult]:
    """One verdict per check on a whole database."""
    yield check_result(plan, WHOLE, len(database.index) > 0, f"{len(database.index)} clips", warn=False)
    if database.index.empty:
        for name in (COVERED, COMMANDS):
            yield check_result(plan, name, False, "no clip is left", warn=False)
        return
    yield _every_skill(plan, database.index, database.manifest["stages"])
    yield _every_command(plan, database.index)


def last_verdicts(plan: Plan, instance: dg.DagsterInstance) -> list[dg.AssetCheckResult]:
    """The newest verdict a check, for a run that writes nothing: its plan would hide them, and they still hold.

    Evaluated again where one never was.
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
    short = short_of_wanted(stages)
    wanted = {"wanted by feedback": "; ".join(short)} if short else {}
    return check_result(plan, COVERED, not poor, ", ".join(poor) or "all", wanted)


def _every_command(plan: Plan, index: pd.DataFrame) -> dg.AssetCheckResult:
    values = PROJECT.read("feasibility.yaml", FeasibilitySettings)
    found = coverage(index, values.balance, PROJECT.read("commands.yaml", CommandSettings))
    axes, plane = found.cells.query("axis != 'forward_yaw'"), found.cells.query("axis == 'forward_yaw'")
    columns = ["axis", "low", "high", "seconds", "effective_seconds_before", "effective_seconds", "clips", "families"]
    shown = {
        "seconds by command": table_of(axes, columns),
        "seconds by forward speed and yaw rate": table_of(plane, ["low", "high", "low_2", "high_2", *columns[3:]]),
    }
    return check_result(plan, COMMANDS, not found.missing, " ".join(found.missing) or "nothing", shown)
