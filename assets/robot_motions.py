"""The stages of one robot, from one factory: a robot is a folder in `robots/`, no stage knows which."""

import dataclasses
from collections.abc import Iterator, Sequence
from functools import partial
from typing import Any

import dagster as dg
import pandas as pd

from assets.actuators import actuator_calibration, actuator_measurements, adapted_robot
from assets.approved import approved_key, approved_part, approved_specs, noting, told
from assets.checks import check_specs
from assets.criteria import references, thresholds, write_table
from assets.database import materialize_database
from assets.database_checks import database_check_specs
from assets.plainly import plainly, told_plainly
from assets.plan import Plan, robot_plans
from assets.project import DEFAULT_ROBOT, PROJECT
from assets.report import picture, stage_metadata, table_of
from assets.resources import ClipPoolResource
from assets.stage import materialized, stage_of
from assets.variants import all_variants
from pipeline.batch import Entry, Manifest, run_stage
from pipeline.files import digest, settings

EFFECTIVE_SECONDS = (
    *("axis", "low", "high", "low_2", "high_2", "seconds", "clips", "families"),
    *("effective_seconds_before", "effective_seconds"),
)
"""Columns of the table of command cells: what their seconds count for before weighting and after."""

COMMANDS = "commands that weights are spread over"
"""Stage name under which a manifest says the command cells."""


def robot_assets(robot: str) -> list[dg.AssetsDefinition | dg.AssetSpec]:
    """Model, its adaptation, KP3, KP4, KP5 and database of the robot in `robots/<robot>`."""
    model, calibration, adapted, retargeted, augmented, feasible, database = robot_plans(robot)
    return [
        *approved_specs(robot),
        actuator_measurements(robot),
        _robot_model(model),
        actuator_calibration(calibration),
        adapted_robot(adapted, calibration, model),
        _retargeted_motions(retargeted, model),
        _augmented_motions(augmented, retargeted, model),
        _feasible_motions(feasible, augmented, adapted),
        _expert_db(database, feasible, model),
    ]


def _declared(
    plan: Plan, kind: str, kp: str = "", inputs: dict[str, Any] | None = None, feedback: str = ""
) -> dict[str, Any]:
    """What all assets of a robot declare alike. Step names bear the robot, for keys with a prefix.

    `feedback` is the section of the approved feedback that the asset heeds.
    """
    return {
        "key": plan.key,
        "ins": inputs or {},
        "deps": [approved_key(feedback, plan.robot)] if feedback else [],
        "group_name": f"{plan.robot}_motions",
        "kinds": {kind},
        "tags": {"robot": plan.robot or "", **({"kp": kp} if kp else {})},
        "code_version": plan.code_version(),
    }


def _from(**plans: Plan) -> dict[str, dg.AssetIn]:
    return {name: dg.AssetIn(plan.key) for name, plan in plans.items()}


def _robot_model(plan: Plan) -> Any:
    @dg.asset(
        **_declared(plan, "mujoco"),
        check_specs=[
            dg.AssetCheckSpec(
                "models_agree",
                asset=plan.key,
                blocking=True,
                description="MJCF and URDF compile and have the same mass and joints.",
            )
        ],
    )
    @plainly
    def robot_model(context: dg.AssetExecutionContext):
        """The robot as MJCF, URDF and tables: joints, limits, gains, armatures, collision shapes."""
        from assets.model_report import joint_table, models_agree
        from pipeline.robot import load_robot

        robot = load_robot(PROJECT.robot_folder(plan.robot or DEFAULT_ROBOT))
        facts = {"stage": plan.name, "robot": robot.name, "digest": robot.digest}
        manifest = Manifest(stage=plan.name, entries=(), judged=(), settings={robot.digest: facts})
        agree = models_agree(robot)
        result = materialized(plan, manifest, {"joints": table_of(joint_table(robot), list(joint_table(robot)))})
        check = dg.AssetCheckResult(
            asset_key=plan.key, check_name="models_agree", passed=agree.holds, metadata={"found": agree.found}
        )
        return result._replace(check_results=[check])

    return robot_model


def _retargeted_motions(plan: Plan, model: Plan) -> Any:
    repaired = dg.AssetKey(["repaired_motions"])

    @dg.asset(
        **_declared(plan, "placo", "3", {"repaired_motions": dg.AssetIn(repaired), **_from(robot_model=model)}),
        check_specs=check_specs(plan),
    )
    @plainly
    def retargeted_motions(
        context: dg.AssetExecutionContext,
        clip_pool: ClipPoolResource,
        repaired_motions: Manifest,
        robot_model: Manifest,
    ):
        """KP3: human windows onto the robot; its own recordings pass, those of other robots do not."""
        from pipeline.retarget import RetargetSettings
        from pipeline.retarget.recording import onto_robot
        from pipeline.robot import load_robot

        robot = load_robot(PROJECT.robot_folder(plan.robot or DEFAULT_ROBOT))
        values = settings.read(PROJECT.settings("retarget.yaml"), RetargetSettings)
        stage = stage_of(plan, partial(onto_robot, settings=values, robot=robot), values)
        manifest = run_stage(stage, repaired_motions, PROJECT.store, clip_pool.pool(), context.log)
        numbers = ["worst_figure", "times_its_bar", "leg_ratio", "slip_m_s", "slip_strict_m_s", "drift_m"]
        numbers += ["penetration_m", "height_shift_m", "limb_error_deg", "thigh_error_deg", "shank_error_deg"]
        numbers += ["trunk_error_deg", "heading_error_deg", "jerk_rad_s3", "jump_percent"]
        return materialized(plan, manifest, stage_metadata(manifest, numbers, highest_first="times_its_bar"))

    return retargeted_motions


def _augmented_motions(plan: Plan, retargeted: Plan, model: Plan) -> Any:
    @dg.asset(
        **_declared(plan, "numpy", "4", _from(retargeted_motions=retargeted, robot_model=model), "augmentation"),
        check_specs=check_specs(plan),
    )
    @plainly
    def augmented_motions(
        context: dg.AssetExecutionContext,
        clip_pool: ClipPoolResource,
        retargeted_motions: Manifest,
        robot_model: Manifest,
    ):
        """KP4: each clip, its mirror image, both at other speeds, and with other steps or postures where asked for."""
        from pipeline.augment import AugmentSettings, process
        from pipeline.augment.strengths import KINDS
        from pipeline.robot import load_robot

        robot = load_robot(PROJECT.robot_folder(plan.robot or DEFAULT_ROBOT))
        values = settings.read(PROJECT.settings("augment.yaml"), AugmentSettings)
        feedback = approved_part(PROJECT, "augmentation", plan.robot)

        def make(wanted: AugmentSettings, entries: Sequence[Entry]) -> Manifest:
            made_with = partial(process, settings=wanted, robot=robot)
            stage = stage_of(plan, made_with, wanted)
            return run_stage(stage, retargeted_motions, PROJECT.store, clip_pool.pool(), context.log, entries)

        manifest = noting(all_variants(retargeted_motions, values, feedback, make), feedback, "augmentation")
        strengths = [each.number for each in KINDS.values()]
        metadata = stage_metadata(manifest, ["variant", "time_scale", "mirrored", *strengths]) | told(feedback)
        return materialized(plan, manifest, metadata)

    return augmented_motions


def _feasible_motions(plan: Plan, augmented: Plan, adapted: Plan) -> Any:
    satisfied = dg.AssetCheckSpec(
        "satisfies_its_own_file",
        asset=plan.key,
        blocking=True,
        description="Every clip that goes on, judged anew from its stored bytes, holds all of data/feasibility.yaml.",
    )

    @dg.asset(
        **_declared(plan, "mujoco", "5", _from(augmented_motions=augmented, adapted_robot=adapted), "weights"),
        check_specs=[*check_specs(plan), satisfied],
    )
    @plainly
    def feasible_motions(
        context: dg.AssetExecutionContext,
        clip_pool: ClipPoolResource,
        augmented_motions: Manifest,
        adapted_robot: Manifest,
    ):
        """KP5: what the robot can do: a number, a limit and a verdict a criterion; then the weight that balances it."""
        from pipeline.feasibility import CommandSettings, FeasibilitySettings, coverage, process
        from pipeline.feasibility.command_seconds import by_command
        from pipeline.feasibility.criteria_table import split
        from pipeline.feasibility.recheck import recheck
        from pipeline.robot import load_robot
        from pipeline.viewing.plots import command_seconds, lost_seconds
        from pipeline.viewing.worst_clips import worst_clips

        robot = load_robot(PROJECT.adapted_robot(plan.robot or DEFAULT_ROBOT))
        values = settings.read(PROJECT.settings("feasibility.yaml"), FeasibilitySettings)
        commands = settings.read(PROJECT.settings("commands.yaml"), CommandSettings)
        judged_by = {"settings": values, "robot": robot, "references": references(augmented_motions)}
        stage = stage_of(plan, partial(process, **judged_by), values, robot_files=robot.digest)
        manifest = run_stage(stage, augmented_motions, PROJECT.store, clip_pool.pool(), context.log)
        manifest, criteria = split(manifest, thresholds())
        # Before the weights, which change with every other clip: what was judged anew once is known.
        again = stage_of(plan, partial(recheck, **judged_by), values, name="recheck", robot_files=robot.digest)
        judged = run_stage(again, manifest, PROJECT.store, clip_pool.pool(), context.log).judged
        broken = [row.clip for row in judged if row.reasons]
        manifest = _weighed(manifest, values, commands)
        feedback = approved_part(PROJECT, "weights", plan.robot)
        manifest = noting(manifest, approved_part(PROJECT, "motors", plan.robot), "motors")
        manifest, reweighted = _reweighed(noting(manifest, feedback, "weights"), feedback, values, commands)
        metadata = stage_metadata(manifest, ["weight", "forward_m_s", "lateral_m_s", "yaw_rate_rad_s"])
        metadata |= told(feedback) | reweighted | write_table(plan, criteria, manifest)
        if manifest.entries:
            spent = by_command(manifest.entry_table())
            metadata["coverage"] = picture(command_seconds(spent, "robot speed, feasible clips"))
            cells = coverage(manifest.entry_table(), values, commands).cells
            metadata["effective seconds by command"] = table_of(cells, EFFECTIVE_SECONDS)
        metadata["seconds lost"] = picture(lost_seconds(manifest.judged_table(), "KP5: clips that lost most"))
        metadata["clips that lost most"] = picture(worst_clips(manifest, augmented_motions, PROJECT.store, robot))
        check = dg.AssetCheckResult(
            asset_key=plan.key,
            check_name=satisfied.name,
            passed=not broken,
            metadata={"found": ", ".join(broken) or f"{len(manifest.entries)} clips hold"},
        )
        result = materialized(plan, manifest, metadata)
        return result._replace(check_results=[*result.check_results, check])

    return feasible_motions


def _weighed(manifest: Manifest, values: Any, commands: Any) -> Manifest:
    """KP5's result with each clip's weight and family. It names the commands, which no clip's verdict depends on."""
    from pipeline.feasibility import balance

    made = balance(manifest.entry_table(), values, commands)[["clip", "weight", "family"]].itertuples(index=False)
    said = {"stage": COMMANDS, **settings.plain(commands)}
    named = dataclasses.replace(manifest, settings={**manifest.settings, digest.of_json(said): said})
    return named.with_numbers({clip: {"weight": float(weight), "family": own} for clip, weight, own in made})


def _reweighed(
    manifest: Manifest, feedback: Sequence[Any], values: Any, commands: Any
) -> tuple[Manifest, dict[str, Any]]:
    """KP5's result with approved factors on command cells, and what became of each cell; as it is without any."""
    if not feedback or not manifest.entries:
        return manifest, {}
    from pipeline.feedback.cell_weights import reweigh

    factors = {change.what: change.value for change in feedback}
    found = reweigh(manifest.entry_table(), factors, values.balance, commands)
    before = {entry.clip: entry.numbers["weight"] for entry in manifest.entries}
    numbers = {
        clip: {"weight": weight, "weight_before_feedback": before[clip]} for clip, weight in found.weight.items()
    }
    cells = pd.DataFrame([vars(cell) for cell in found.cells])
    return manifest.with_numbers(numbers), {"command cells by feedback": table_of(cells, list(cells))}


def _expert_db(plan: Plan, feasible: Plan, model: Plan) -> Any:
    @dg.asset(
        **_declared(plan, "json", inputs=_from(feasible_motions=feasible, robot_model=model)),
        output_required=False,
        check_specs=database_check_specs(plan),
    )
    def expert_db(
        context: dg.AssetExecutionContext, feasible_motions: Manifest, robot_model: Manifest
    ) -> Iterator[dg.MaterializeResult | dg.AssetCheckResult]:
        """The expert motion database: one AMP clip a file, an index with weights and provenance, a manifest."""
        with told_plainly():
            yield from materialize_database(context, plan, feasible_motions)

    return expert_db
