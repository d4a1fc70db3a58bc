"""The stages of one robot: model, KP3 (retargeting), KP5 (feasibility). The same factories serve every robot."""

import dataclasses
from collections.abc import Sequence
from functools import partial
from typing import Any

import dagster as dg
import pandas as pd

from assets.actuators import MODELS_AGREE, actuator_calibration, actuator_measurements, adapted_robot
from assets.approved import approval_metadata, approved_part, approved_specs
from assets.augmented_motions import augmented_motions
from assets.checks import check_specs
from assets.database import expert_db
from assets.plan import Plan, robot_plans
from assets.reference_motions import motion_variants, reference_motions
from assets.report import (
    assets_of,
    check_result,
    joint_table,
    picture,
    result_of,
    robot_asset,
    stage_metadata,
    table_of,
)
from assets.resources import ClipPoolResource
from assets.stage import feasibility_stage, materialized, references_of, stage_of, thresholds, write_table
from assets.tracker_choice import no_tracker
from assets.tracking_policy import tracking_policy
from pipeline.batch import Entry, Manifest, Rows, changed, run_stage
from pipeline.batch.shard import MISSING
from pipeline.errors import FileError
from pipeline.feasibility import CommandSettings, balance, coverage, criteria_table
from pipeline.feasibility.balance import READ
from pipeline.feasibility.command_space import SECONDS_COLUMN, VELOCITIES, by_command
from pipeline.feasibility.coverage import NEEDED, WHERE_THERE
from pipeline.feasibility.criteria_table import split, with_origins
from pipeline.feasibility.evaluated import criteria_of_pieces, together, with_evaluated, without_evaluated
from pipeline.feedback.approved import with_applied_changes
from pipeline.feedback.cell_weights import reweigh
from pipeline.files import digest, settings
from pipeline.project import DEFAULT_ROBOT, PROJECT
from pipeline.robot_check.agreement import models_agree
from pipeline.selection import Curation, without_excluded
from pipeline.tracking.neighbours import AT_FAULT
from pipeline.tracking.variations import accepted_variations, distances

EFFECTIVE_SECONDS = (
    *("axis", "low", "high", "low_2", "high_2", "seconds", "clips", "families"),
    *("effective_seconds_before", "effective_seconds"),
)
"""Columns of the table of command cells, with their effective seconds before and after weighting."""

COMMANDS = "commands that weights are spread over"
"""Stage name of the entry of a manifest that holds the command cells."""


def robot_assets(robot: str) -> list[dg.AssetsDefinition | dg.AssetSpec]:
    """Assets of the robot in `robots/<robot>`, from its model to its database."""
    factories = (
        *(robot_model, actuator_calibration, adapted_robot, retargeted_motions, motion_variants, reference_motions),
        *(tracking_policy, augmented_motions, feasible_motions, expert_db),
    )
    return [*approved_specs(robot), actuator_measurements(robot), *assets_of(robot, factories)]


@robot_asset("mujoco", blocking={"models_agree": MODELS_AGREE})
def robot_model(context: dg.AssetExecutionContext, plan: Plan):
    """Nominal robot model: MJCF, URDF and tables of joints, limits, gains, armatures and collision shapes."""
    robot = PROJECT.robot(plan.robot or DEFAULT_ROBOT)
    facts = {"stage": plan.name, "robot": robot.name, "digest": robot.digest}
    check = check_result(plan, "models_agree", *models_agree(robot), warn=False)
    return result_of(plan, {robot.digest: facts}, {"joints": table_of(joint_table(robot))}, [check])


@robot_asset("placo", "4", specs=check_specs)
def retargeted_motions(
    context: dg.AssetExecutionContext,
    clip_pool: ClipPoolResource,
    repaired_motions: Manifest,
    robot_model: Manifest,
    plan: Plan,
):
    """KP3: human motions retargeted onto the robot by inverse kinematics.

    Recordings of the same robot are only resampled; recordings of other robots are rejected.
    """
    from pipeline.retarget import RetargetSettings
    from pipeline.retarget.process import onto_robot

    robot = PROJECT.robot(plan.robot or DEFAULT_ROBOT)
    values = PROJECT.read("retarget.yaml", RetargetSettings)
    stage = stage_of(plan, partial(onto_robot, settings=values, robot=robot), values)
    manifest = run_stage(stage, repaired_motions, PROJECT.store, clip_pool.pool(), context.log)
    numbers = ["worst_figure", "times_its_bar", "leg_ratio", "slip_m_s", "slip_strict_m_s", "drift_m"]
    numbers += ["penetration_m", "height_shift_m", "limb_error_deg", "thigh_error_deg", "shank_error_deg"]
    numbers += ["trunk_error_deg", "heading_error_deg", "jerk_rad_s3", "jump_percent"]
    numbers += ["pelvis_velocity_error_m_s", "pelvis_acceleration_ratio", "lateral_share", "lean_taken_off_deg"]
    return materialized(plan, manifest, stage_metadata(manifest, numbers, highest_first="times_its_bar"))


STORED = "stored_as_evaluated"
STORED_TEXT = (
    "Every accepted clip is stored under the digest of its bytes, and reading and writing it again gives the same "
    "bytes, so that the stored clip is the evaluated one."
)


@robot_asset("mujoco", "5", deps=["approved_weights"], specs=check_specs, blocking={STORED: STORED_TEXT})
def feasible_motions(
    context: dg.AssetExecutionContext,
    clip_pool: ClipPoolResource,
    augmented_motions: Manifest,
    reference_motions: Manifest,
    adapted_robot: Manifest,
    plan: Plan,
):
    """KP5: motions that the robot can execute: a value, a limit and a verdict for each criterion, and sampling weights.

    The weights balance the clips over the command space. data/feasibility.yaml has the criteria.
    """
    from pipeline.viewing.contact_sheet import worst_clips
    from pipeline.viewing.plots import command_seconds, lost_seconds

    commands = PROJECT.read("commands.yaml", CommandSettings)
    curation = PROJECT.read("curation.yaml", Curation)
    kind = curation.expert_motions
    if untracked(augmented_motions, reference_motions) and kind != "references":
        context.log.warning(no_tracker(plan.robot or DEFAULT_ROBOT))
        kind = "references"
    candidates = candidate_motions(augmented_motions, reference_motions, kind)
    stage, values, robot = feasibility_stage(plan, references_of(candidates, reference_motions))
    references = robot_plans(robot.name)["reference_motions"]
    evaluated = criteria_of_references(references) if kind != "rollouts" else None
    pieces = set() if evaluated is None else set(evaluated["piece"].cat.categories)
    rest, known = without_evaluated(candidates, stage, pieces)
    if known:
        context.log.info(f"{plan.name}: {len(known)} references were evaluated by {references.name}")
    manifest = run_stage(stage, rest, PROJECT.store, clip_pool.pool(), context.log)
    manifest, criteria = split(manifest, thresholds())
    if evaluated is not None and known:
        own = with_origins(criteria_of_pieces(evaluated, known), thresholds())
        manifest, criteria = with_evaluated(manifest, stage, known), together([criteria, own])
    manifest = without_excluded(manifest, curation.decisions)
    damaged = PROJECT.store.damaged(manifest, clip_pool.pool())  # the result is awaited at the end
    manifest = _balanced(manifest, values, commands)
    feedback = approved_part(PROJECT, "weights", plan.robot)
    manifest = with_applied_changes(manifest, approved_part(PROJECT, "motors", plan.robot), "motors")
    manifest, reweighted = _reweighed(with_applied_changes(manifest, feedback, "weights"), feedback, values, commands)
    metadata = stage_metadata(manifest, ["weight", "forward_m_s", "lateral_m_s", "yaw_rate_rad_s"])
    metadata |= (
        approval_metadata(feedback) | reweighted | write_table(plan, criteria, manifest) | {"expert motions": kind}
    )
    metadata |= _variations(augmented_motions, manifest)
    if manifest.entries:
        by_cell = by_command(manifest.entry_table(["seconds", *VELOCITIES, SECONDS_COLUMN]))
        metadata["coverage"] = picture(command_seconds(by_cell, "robot speed, feasible clips"))
        cells = coverage(manifest.entry_table([*NEEDED, *WHERE_THERE]), values.balance, commands).cells
        metadata["effective seconds by command"] = table_of(cells, EFFECTIVE_SECONDS)
    metadata["seconds lost"] = picture(lost_seconds(manifest.judged_table([]), "KP5: clips that lost most"))
    metadata["clips that lost most"] = picture(worst_clips(manifest, candidates, PROJECT.store, robot))
    damaged_clips = [*damaged]
    what = ", ".join(damaged_clips) or f"{len(manifest.entries)} clips are stored as evaluated"
    check = check_result(plan, STORED, not damaged_clips, what, warn=False)
    result = materialized(plan, manifest, metadata)
    return result._replace(check_results=[*result.check_results, check])


def criteria_of_references(references: Plan) -> pd.DataFrame | None:
    """Stored criteria of the references.

    None if the table is missing, damaged, or not of the stored references; they are then evaluated again.
    """
    manifest = PROJECT.store.manifest_path(references.key.to_user_string())
    path = criteria_table.path_beside(manifest)
    try:
        return criteria_table.read(path, manifest, references.name)
    except FileError:
        return None


def untracked(rollouts: Manifest, references: Manifest) -> bool:
    """Whether the references were not rolled out, because there is no tracker."""
    return bool(references.entries) and not rollouts.judged


def candidate_motions(rollouts: Manifest, references: Manifest, kind: str) -> Manifest:
    """The clips that KP5 evaluates: `rollouts`, their `references`, or `both`.

    References that their rollouts showed to be faulty (`pipeline.tracking.neighbours`) are excluded.
    """
    if kind == "rollouts":
        return rollouts
    at_fault = {clip for clip, fault in rollouts.findings("clip", AT_FAULT) if fault is not MISSING and fault}
    if at_fault:
        kept = changed(Entry, references.entries, lambda entry: None if entry.clip in at_fault else entry)
        references = dataclasses.replace(references, entries=kept)
    if kind == "references":
        return references
    return dataclasses.replace(
        rollouts,
        entries=Rows((*rollouts.entry_shards, *references.entry_shards)),
        settings={**references.settings, **rollouts.settings},
    )


def _variations(rollouts: Manifest, feasible: Manifest) -> dict[str, Any]:
    """Accepted disturbed rollouts per source clip, and their distances from the references."""
    found = accepted_variations(rollouts, feasible) if rollouts.judged else pd.DataFrame()
    if found.empty:
        return {}
    accepted, tried = found["accepted"].tolist(), found["tried"].tolist()
    return {
        "disturbed rollouts accepted": f"{sum(accepted)} of {sum(tried)}, at least {min(accepted)} per source clip",
        "disturbed rollouts accepted, per source clip": table_of(found),
        "distance of disturbed rollouts from their references": table_of(distances(feasible)),
    }


def _balanced(manifest: Manifest, values: Any, commands: Any) -> Manifest:
    """Add each clip's weight and family to KP5's result, and the command cells to its settings."""
    made = balance(manifest.entry_table(READ), values.balance, commands)[["clip", "weight", "family"]]
    facts = {"stage": COMMANDS, **settings.plain(commands)}
    named = dataclasses.replace(manifest, settings={**manifest.settings, digest.of_json(facts): facts})
    return named.with_numbers(
        {clip: {"weight": float(weight), "family": own} for clip, weight, own in made.itertuples(index=False)}
    )


def _reweighed(
    manifest: Manifest, feedback: Sequence[Any], values: Any, commands: Any
) -> tuple[Manifest, dict[str, Any]]:
    """Apply approved factors on command cells to the weights. Returns the result and a table of the cells."""
    if not feedback or not manifest.entries:
        return manifest, {}

    factors = {change.what: change.value for change in feedback}
    found = reweigh(manifest.entry_table(), factors, values.balance, commands)
    before = {entry.clip: entry.numbers["weight"] for entry in manifest.entries}
    numbers = {
        clip: {"weight": weight, "weight_before_feedback": before[clip]} for clip, weight in found.weight.items()
    }
    cells = [vars(cell) for cell in found.cells]
    return manifest.with_numbers(numbers), {"command cells by feedback": table_of(cells)}
