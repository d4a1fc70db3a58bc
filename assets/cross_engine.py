"""`cross_engine_validation`: the exported policy in MuJoCo, in MuJoCo with the armature on the links, and in DART."""

from typing import Any

import dagster as dg
import pandas as pd

from assets.plan import Plan
from assets.policy import VERDICT, EvaluatedPolicyConfig, evaluated_policy, remove_earlier_logs
from assets.project import DEFAULT_ROBOT, PROJECT
from assets.report import asset_of, check_result, picture, result_of, table_of
from assets.resources import ClipPoolResource
from pipeline.batch import Manifest
from pipeline.deployment import digest
from pipeline.files import settings
from pipeline.files.shown_text import markdown_list
from pipeline.validation.bars import read_validation

HOLDS = "holds_in_both_engines"


def cross_engine_validation(plan: Plan, exported: Plan, adapted: Plan) -> Any:
    """The asset `cross_engine_validation` of a robot."""
    checks = {HOLDS: "No fall, commands kept, engines agree where required."}

    @asset_of(plan, "dart", inputs={"exported_policy": exported}, deps=[adapted.key], checks=checks)
    def cross_engine_validation(
        context: dg.AssetExecutionContext,
        config: EvaluatedPolicyConfig,
        clip_pool: ClipPoolResource,
        exported_policy: Manifest,
    ):
        """The same policy, gains and motors in engines with other contacts: a figure a cell, every reason."""
        from pipeline.validation.cross_engine import cross_engine
        from pipeline.validation.cross_engine_trials import write_failures
        from pipeline.validation.cross_engine_walk import CrossEngineSettings
        from pipeline.viewing.validation_plots import cross_engine_plots

        grid = settings.read(PROJECT.settings("cross_engine.yaml"), CrossEngineSettings)
        robot = plan.robot or DEFAULT_ROBOT
        bars = read_validation(PROJECT.settings("validation.yaml"), PROJECT.bars(robot))
        judged = evaluated_policy(config, exported_policy, robot)
        found = cross_engine(judged, grid, bars, pool=clip_pool.pool())
        folder = PROJECT.simulated_failures(robot, "cross_engine")
        logs = write_failures(judged, found, grid, folder)
        remove_earlier_logs(folder, logs)
        note = {"note": found.note} if found.note else {}
        facts = {"stage": plan.name, "policy": digest(judged.policy), "gains": judged.gains()}
        verdict = {**facts, **found.to_dict()}
        manifest = Manifest(stage=plan.name, entries=(), judged=(), settings={VERDICT: verdict})
        check = check_result(plan, HOLDS, found.passed, "; ".join(found.reasons) or "every required cell holds", note)
        rows = pd.DataFrame(found.rows())
        metadata = {
            "passed": found.passed,
            **note,
            "required cells": len(found.cells) - len(found.not_required),
            "cells failed": len(found.failed_cells),
            "reasons": dg.MetadataValue.md(markdown_list(found.reasons)),
            "explained by the armature": "; ".join(verdict["explained"]) or "none",
            "not required": dg.MetadataValue.md(
                markdown_list(f"{name}: {why}" for name, why in found.not_required.items())
            ),
            "failures written": ", ".join(path.name for path in logs) or "none",
            "pictures": picture(cross_engine_plots(found)),
            "cells": table_of(rows, list(rows)),
        }
        return result_of(plan, manifest, metadata, [check])

    return cross_engine_validation
