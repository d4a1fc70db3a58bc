"""Whether a classifier can tell the database from what the robot does in simulation, with its asset check."""

import dataclasses
import logging
from functools import partial
from typing import Any

import dagster as dg

from assets.plan import Plan, robot_plans
from assets.project import DEFAULT_ROBOT, PROJECT
from assets.tracking_policy import tracker_file
from pipeline.actuators import read_actuators, torque_envelope
from pipeline.batch import Manifest, Stage
from pipeline.errors import FileError
from pipeline.expert.realizability import SECONDS, TooFewMotionsError, accuracy_against_rollouts
from pipeline.files import settings
from pipeline.robot import load_robot
from pipeline.tracking.process import disturbed_motion
from pipeline.tracking.settings import TrackingSettings

REALIZABLE = "realizability"
WARN_ABOVE = 0.75
"""Held-out accuracy from which an adversarial discriminator has little to learn from."""
OTHER_SEED = 1000
"""Added to the seed of `data/tracking.yaml`: the same kind of disturbances, drawn again."""


def realizability_spec(plan: Plan) -> dg.AssetCheckSpec:
    """The check that `expert_db` declares."""
    return dg.AssetCheckSpec(
        REALIZABLE,
        asset=plan.key,
        description=f"A classifier tells windows of the database from rollouts under other seeds in at most "
        f"{100 * WARN_ABOVE:.0f} of 100 held-out windows; 50 is chance.",
    )


def realizability_check(
    plan: Plan, feasible: Manifest, pool: Any, log: logging.Logger
) -> tuple[dg.AssetCheckResult, float | None]:
    """The check's result, and the accuracy; None where the database has too few motions to hold some out."""

    try:
        accuracy = measured(plan.robot or DEFAULT_ROBOT, feasible, pool, log)
    except (TooFewMotionsError, FileError) as error:
        return _result(plan, True, f"not measured: {error}"), None
    found = f"held-out accuracy {accuracy:.2f}; 0.5 is chance, a warning above {WARN_ABOVE:g}"
    return _result(plan, accuracy <= WARN_ABOVE, found), accuracy


def measured(robot_name: str, clips: Manifest, pool: Any, log: logging.Logger, seed: int = 0) -> float:
    """Held-out accuracy between clips and rollouts of their references under another seed, by the stored tracker."""

    plans, folder = robot_plans(robot_name), PROJECT.adapted_robot(robot_name)
    robot = load_robot(folder)
    references = PROJECT.store.load(plans["reference_motions"].key.to_user_string())
    found = tracker_file(PROJECT, PROJECT.store.load(plans["tracking_policy"].key.to_user_string()))
    if found is None:
        raise FileError(PROJECT.shipped_policies(robot_name) / "tracker", f"there is no tracker of '{robot_name}'.")
    tracker, content = found
    values = settings.read(PROJECT.settings("tracking.yaml"), TrackingSettings)
    other = dataclasses.replace(values, seed=values.seed + OTHER_SEED + seed)
    function = partial(
        disturbed_motion,
        settings=other,
        robot=robot,
        envelope=torque_envelope(read_actuators(folder)),
        tracker=tracker,
        longest_s=SECONDS,
    )
    stage = Stage(
        name=REALIZABLE,
        version=plans["augmented_motions"].code_version(),
        function=function,
        settings={**settings.plain(other), "longest_s": SECONDS},
        depends={"robot_files": robot.digest, "tracker": content},
    )
    return accuracy_against_rollouts(clips, references, stage, robot, PROJECT.store, pool, log, seed)


def _result(plan: Plan, passed: bool, found: str) -> dg.AssetCheckResult:
    return dg.AssetCheckResult(
        asset_key=plan.key,
        check_name=REALIZABLE,
        passed=passed,
        severity=dg.AssetCheckSeverity.WARN,
        metadata={"found": found},
    )
