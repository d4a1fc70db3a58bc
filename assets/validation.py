"""`mujoco_validation`: does the exported policy follow its commands in MuJoCo, on the adapted robot?"""

from pathlib import Path
from typing import Any, Literal

import dagster as dg
import pandas as pd

from assets.plan import Plan
from assets.policy import VERDICT, EvaluatedPolicyConfig, evaluated_policy, remove_earlier_logs
from assets.project import DEFAULT_ROBOT, PROJECT
from assets.report import asset_of, check_result, picture, result_of, table_of
from assets.resources import ClipPoolResource
from pipeline.batch import Manifest
from pipeline.deployment import digest
from pipeline.files.shown_text import markdown_list
from pipeline.validation.bars import read_validation
from pipeline.validation.failed_trials import write_failed_trials
from pipeline.validation.figures import measure
from pipeline.validation.suites import cells_of, named
from pipeline.validation.verdict import judge, table
from pipeline.validation.walk import Worlds, walk

PASSED = "required_cells_passed"
SHOWN = {"vx +1.0": 1, "vx +2.0": 1, "yaw +1.0": 1}
"""Walks that pictures show, by cell."""


class ValidationConfig(EvaluatedPolicyConfig):
    """What is tried, and with which policy."""

    suite: Literal["quick", "full"] = "full"


def mujoco_validation(plan: Plan, exported: Plan, adapted: Plan) -> Any:
    """The asset `mujoco_validation` of a robot."""
    checks = {PASSED: "Every required cell of the robot's validation.yaml holds all of its bars."}

    @asset_of(plan, "mujoco", inputs={"exported_policy": exported}, deps=[adapted.key], checks=checks)
    def mujoco_validation(
        context: dg.AssetExecutionContext,
        config: ValidationConfig,
        clip_pool: ClipPoolResource,
        exported_policy: Manifest,
    ):
        """Commands, switches, starts, terrain, conditions, pushes in MuJoCo: one verdict with every reason."""
        robot = plan.robot or DEFAULT_ROBOT
        bars = read_validation(PROJECT.settings("validation.yaml"), PROJECT.bars(robot))
        one = evaluated_policy(config, exported_policy, robot)
        measured = measure(one, cells_of(config.suite, one.robot), clip_pool.pool())
        verdict = judge(measured, bars, suite=config.suite, policy=digest(one.policy), robot=one.robot.digest)
        folder = PROJECT.simulated_failures(robot, "mujoco")
        logs = write_failed_trials(one, verdict, folder)
        remove_earlier_logs(folder, logs)
        context.log.info(f"{config.suite}: {'passed' if verdict.passed else 'failed'}, {len(logs)} failures written")
        not_run = [] if config.suite == "full" else ["the full suite: only the quick one was run"]
        record = {**verdict.to_dict(), "gains": one.gains(), "stage": plan.name, "not run": not_run}
        manifest = Manifest(stage=plan.name, entries=(), judged=(), settings={VERDICT: record})
        reasons = "; ".join(map(str, verdict.reasons[:20])) or "all required cells passed"
        check = check_result(plan, PASSED, verdict.passed, reasons, _note(verdict))
        return result_of(plan, manifest, _metadata(one, verdict, logs), [check])

    return mujoco_validation


def _note(verdict: Any) -> dict[str, str]:
    return {"note": verdict.note} if verdict.note else {}


def _metadata(one: Any, verdict: Any, logs: tuple[Path, ...]) -> dict[str, Any]:
    from pipeline.viewing.validation_plots import command_tracking, foot_contacts, survival_heatmap, torque_speed

    worlds = Worlds(one)
    walks = {cell.name: walk(worlds, cell.trials[0]) for cell in named(one.robot, SHOWN)}
    rows = pd.DataFrame(table(verdict))
    spared = {cell.measured.cell.name: cell.bars.why for cell in verdict.cells if not cell.bars.required}
    return {
        "passed": verdict.passed,
        **_note(verdict),
        "suite": verdict.suite,
        "cells": len(verdict.cells),
        "cells failed": len(verdict.failed_cells),
        "trials": sum(len(cell.measured.trials) for cell in verdict.cells),
        "reasons": dg.MetadataValue.md(markdown_list(verdict.reasons)),
        "not required": dg.MetadataValue.md(markdown_list(f"{name}: {why}" for name, why in spared.items())),
        "failures written": ", ".join(path.name for path in logs) or "none",
        "command tracking": picture(command_tracking(verdict)),
        "survival of pushes": picture(survival_heatmap(verdict)),
        "torque against speed": picture(torque_speed(walks, one.envelope)),
        "foot contacts": picture(foot_contacts(walks)),
        "every cell": table_of(rows, list(rows)),
    }
