"""Validations of the exported policy on the adapted robot.

`mujoco_validation`: command tracking and robustness in MuJoCo.
`cross_engine_validation`: the policy in MuJoCo, in MuJoCo with armature inertia moved to the links, and in DART.
`webots_validation`: a Webots project of robot and policy, run in Webots and in its stand-ins.
"""

from pathlib import Path
from typing import Any, Literal

import dagster as dg

from assets.plan import Plan
from assets.policy import VERDICT, EvaluatedPolicyConfig, evaluated_policy, remove_earlier_logs
from assets.report import check_result, picture, result_of, robot_asset, table_of
from assets.resources import ClipPoolResource
from pipeline.batch import Manifest
from pipeline.deployment import digest
from pipeline.files.shown_text import markdown_list
from pipeline.project import DEFAULT_ROBOT, PROJECT
from pipeline.robot.load import read_description
from pipeline.validation.failed_trials import log_path, write_failed_trials
from pipeline.validation.figures import measure
from pipeline.validation.suites import cells_of, named
from pipeline.validation.verdict import judge, table
from pipeline.validation.walk import Worlds, walk
from pipeline.webots.project import write_project
from pipeline.webots.result import WebotsSettings
from pipeline.webots.validate import WEBOTS, project_faults, validate

PASSED = "required_cells_passed"
HOLDS = "holds_in_both_engines"
MATCHES_ROBOT, WALKS = "project_is_the_robot", "walks_in_webots"
SHOWN = {"vx +1.0": 1, "vx +2.0": 1, "yaw +1.0": 1}
"""Cells whose walks the pictures show."""


class ValidationConfig(EvaluatedPolicyConfig):
    """Suite of trials, and the policy to evaluate."""

    suite: Literal["quick", "full"] = "full"


@robot_asset(
    "mujoco",
    deps=["adapted_robot"],
    checks={PASSED: "Every required cell of the robot's validation.yaml meets all of its thresholds."},
)
def mujoco_validation(
    context: dg.AssetExecutionContext,
    config: ValidationConfig,
    clip_pool: ClipPoolResource,
    exported_policy: Manifest,
    plan: Plan,
):
    """Validation of the policy in MuJoCo, with one verdict and every reason.

    Cells: constant and switching commands, initial states, terrain, disturbed conditions, pushes.
    """
    robot = plan.robot or DEFAULT_ROBOT
    one, bars = evaluated_policy(config, exported_policy, robot)
    cells = cells_of(config.suite, one.robot)
    measured = measure(one, cells, clip_pool.pool())
    verdict = judge(measured, bars, suite=config.suite, policy=digest(one.policy), robot=one.robot.digest)
    folder = PROJECT.simulated_failures(robot, "mujoco")
    logs = write_failed_trials(one, verdict, folder)
    tried = None if config.suite == "full" else {log_path(folder, cell.name) for cell in cells}
    remove_earlier_logs(folder, logs, tried)
    context.log.info(f"{config.suite}: {'passed' if verdict.passed else 'failed'}, {len(logs)} failure logs written")
    not_run = [] if config.suite == "full" else ["the full suite: only the quick suite was run"]
    record = {**verdict.to_dict(), "gains": one.gains(), "stage": plan.name, "not run": not_run}
    reasons = "; ".join(map(str, verdict.reasons[:20])) or "all required cells passed"
    check = check_result(plan, PASSED, verdict.passed, reasons, _note(verdict))
    return result_of(plan, {VERDICT: record}, _metadata(one, verdict, logs), [check])


def _note(verdict: Any) -> dict[str, str]:
    return {"note": verdict.note} if verdict.note else {}


def _metadata(one: Any, verdict: Any, logs: tuple[Path, ...]) -> dict[str, Any]:
    from pipeline.viewing.validation_plots import command_tracking, foot_contacts, survival_heatmap, torque_speed

    worlds = Worlds(one)
    walks = {cell.name: walk(worlds, cell.trials[0]) for cell in named(one.robot, SHOWN)}
    optional = {cell.measured.cell.name: cell.bars.why for cell in verdict.cells if not cell.bars.required}
    return {
        "passed": verdict.passed,
        **_note(verdict),
        "suite": verdict.suite,
        "cells": len(verdict.cells),
        "cells failed": len(verdict.failed_cells),
        "trials": sum(len(cell.measured.trials) for cell in verdict.cells),
        "reasons": dg.MetadataValue.md(markdown_list(verdict.reasons)),
        "not required": dg.MetadataValue.md(markdown_list(f"{name}: {why}" for name, why in optional.items())),
        "failure logs": ", ".join(path.name for path in logs) or "none",
        "command tracking": picture(command_tracking(verdict)),
        "survival of pushes": picture(survival_heatmap(verdict)),
        "torque over speed": picture(torque_speed(walks, one.envelope)),
        "foot contacts": picture(foot_contacts(walks)),
        "every cell": table_of(table(verdict)),
    }


@robot_asset(
    "dart", deps=["adapted_robot"], checks={HOLDS: "In every required cell: no fall, commands tracked, engines agree."}
)
def cross_engine_validation(
    context: dg.AssetExecutionContext,
    config: EvaluatedPolicyConfig,
    clip_pool: ClipPoolResource,
    exported_policy: Manifest,
    plan: Plan,
):
    """Validation of the same policy, gains and motors in MuJoCo and DART, whose contact models differ."""
    from pipeline.validation.cross_engine import cross_engine
    from pipeline.validation.cross_engine_trials import write_failures
    from pipeline.validation.cross_engine_walk import CrossEngineSettings
    from pipeline.viewing.validation_plots import cross_engine_plots

    grid = PROJECT.read("cross_engine.yaml", CrossEngineSettings)
    robot = plan.robot or DEFAULT_ROBOT
    evaluated, bars = evaluated_policy(config, exported_policy, robot)
    found = cross_engine(evaluated, grid, bars, pool=clip_pool.pool())
    folder = PROJECT.simulated_failures(robot, "cross_engine")
    logs = write_failures(evaluated, found, grid, folder)
    remove_earlier_logs(folder, logs)
    facts = {"stage": plan.name, "policy": digest(evaluated.policy), "gains": evaluated.gains()}
    verdict = {**facts, **found.to_dict()}
    check = check_result(
        plan, HOLDS, found.passed, "; ".join(found.reasons) or "all required cells passed", _note(found)
    )
    metadata = {
        "passed": found.passed,
        **_note(found),
        "required cells": len(found.cells) - len(found.not_required),
        "cells failed": len(found.failed_cells),
        "reasons": dg.MetadataValue.md(markdown_list(found.reasons)),
        "explained by the armature": "; ".join(verdict["explained"]) or "none",
        "not required": dg.MetadataValue.md(
            markdown_list(f"{name}: {why}" for name, why in found.not_required.items())
        ),
        "failure logs": ", ".join(path.name for path in logs) or "none",
        "pictures": picture(cross_engine_plots(found)),
        "cells": table_of(found.rows()),
    }
    return result_of(plan, {VERDICT: verdict}, metadata, [check])


@robot_asset(
    "webots",
    deps=["adapted_robot"],
    checks={WALKS: "The policy follows the commands of data/webots.yaml in Webots itself, not in a stand-in."},
    blocking={MATCHES_ROBOT: "PROTO and world have the same parameters as the robot model."},
)
def webots_validation(
    context: dg.AssetExecutionContext, config: EvaluatedPolicyConfig, exported_policy: Manifest, plan: Plan
):
    """Webots project (PROTO, world, controller) of the robot, run in Webots if installed, and in its stand-ins."""
    from pipeline.validation.derived_bars import allowed_of

    values = PROJECT.read("webots.yaml", WebotsSettings)
    robot = plan.robot or DEFAULT_ROBOT
    evaluated, rules = evaluated_policy(config, exported_policy, robot)
    folder, source = PROJECT.data / "webots" / robot, read_description(PROJECT.adapted_robot(robot))
    project = write_project(folder, source, evaluated.task, evaluated.envelope, evaluated.policy, values)
    faults = project_faults(project.world, evaluated.robot)
    verdicts = validate(project, values, allowed_of(rules.webots))
    note = rules.reference.note_on(evaluated.robot.digest)
    stored = {**stored_verdict(plan.name, digest(evaluated.policy), verdicts), "note": note or None}
    statuses = {each.engine: each.status for each in verdicts.values()}
    for engine, status in statuses.items():
        context.log.info(f"{engine}: {status}")
    metadata = {
        **statuses,
        **({"note": note} if note else {}),
        "dagster/uri": dg.MetadataValue.path(str(project.folder)),
        "segments": table_of(_segments(verdicts)),
    }
    return result_of(plan, {VERDICT: stored}, metadata, _webots_checks(plan, faults, verdicts[WEBOTS]))


def stored_verdict(stage: str, policy: str, verdicts: dict[str, Any]) -> dict[str, Any]:
    """Verdict for the manifest.

    `passed` is None if Webots is missing or failed to run; `not_run` and `failed_to_run` have the reason. Stand-ins are
    listed by name, those that failed to run also under `failed_to_run`.
    """
    own = verdicts[WEBOTS]
    others = {name: each.to_dict() for name, each in verdicts.items() if name != WEBOTS}
    return {
        "stage": stage,
        "policy": policy,
        "passed": own.status == "passed" if own.judged else None,
        "reasons": list(own.reasons),
        "not_run": [] if own.judged or own.failed_to_run else [own.status],
        "failed_to_run": [
            each.status if name == WEBOTS else f"{name}: {each.status}"
            for name, each in verdicts.items()
            if each.failed_to_run
        ],
        "webots": own.to_dict(),
        **{name: each["status"] for name, each in others.items()},
        "stand_ins": others,
    }


def _webots_checks(plan: Plan, faults: tuple[str, ...], webots: Any) -> list[dg.AssetCheckResult]:
    found = "; ".join(webots.reasons) or webots.status
    compared = "; ".join(faults) or "motors, limits, masses, inertias, poses, sensors, contacts"
    return [
        check_result(plan, MATCHES_ROBOT, not faults, compared, warn=False),
        check_result(plan, WALKS, webots.status == "passed", found, warn=not webots.failed_to_run),
    ]


def _segments(verdicts: dict[str, Any]) -> list[dict[str, Any]]:
    return [
        {"engine": each["engine"], "status": each["status"], **segment}
        for each in (verdict.to_dict() for verdict in verdicts.values())
        for segment in ((each["result"] or {}).get("segments") or [{}])
    ]
