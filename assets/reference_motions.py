"""Variants of the retargeted motions (KP4), and the references for tracking: the feasible variants (KP5)."""

import dataclasses
from collections.abc import Callable, Sequence
from functools import partial
from typing import Any

import dagster as dg

from assets.approved import approval_metadata, approved_part
from assets.checks import check_specs
from assets.plan import Plan
from assets.report import picture, robot_asset, stage_metadata
from assets.resources import ClipPoolResource
from assets.stage import feasibility_stage, materialized, references_of, stage_of, thresholds, write_table
from pipeline.augment import AugmentSettings, process
from pipeline.augment.mirror import mirror_skill
from pipeline.augment.process import KINDS
from pipeline.batch import Entry, Manifest, run_stage
from pipeline.feasibility.criteria_table import split
from pipeline.feedback.approved import further_variants, with_applied_changes
from pipeline.feedback.change import Change
from pipeline.project import DEFAULT_ROBOT, PROJECT

MakeVariants = Callable[[Any, Sequence[Entry]], Manifest]
"""`make(settings, entries)`: runs the stage with the settings on the entries; on all clips if empty."""


def all_variants(retargeted: Manifest, values: Any, feedback: Sequence[Change], make: MakeVariants) -> Manifest:
    """Make the variants of all clips, and the additional variants of single skills that approved changes request.

    Mirroring swaps left and right skills, so the clips of the mirrored skill are processed too.

    Args:
        retargeted: clips of `retargeted_motions`
        values: settings for all clips (`AugmentSettings`)
        feedback: approved changes of the section `augmentation`
        make: runs the stage
    """

    manifest = make(values, ())
    for skill, further in further_variants(feedback, values).items():
        sides = {skill, mirror_skill(skill)} if values.mirror else {skill}
        entries = [entry for entry in retargeted.entries if entry.numbers.get("skill") in sides]
        if entries:
            manifest = with_further_variants(manifest, make(further, entries), skill)
    return manifest


def with_further_variants(manifest: Manifest, made: Manifest, skill: str) -> Manifest:
    """Add the variants of a skill from `made` to `manifest`; both are made from the same clips."""
    known = {entry.clip for entry in manifest.entries}
    new = [entry for entry in made.entries if entry.clip not in known and entry.numbers.get("skill") == skill]
    seconds = {entry.clip: float(entry.numbers.get("seconds", 0.0)) for entry in new}
    rows = {row.clip: row for row in made.judged}
    judged = []
    for row in manifest.judged:
        if row.clip in rows:
            names = [clip for clip in rows[row.clip].pieces if clip in seconds]
            more_s = sum(seconds[name] for name in names)
            numbers = {**row.numbers, "seconds_out": row.numbers.get("seconds_out", 0.0) + more_s}
            reasons = (*row.reasons, *rows[row.clip].reasons)
            row = dataclasses.replace(row, pieces=(*row.pieces, *names), numbers=numbers, reasons=reasons)
        judged.append(row)
    return dataclasses.replace(
        manifest,
        entries=(*manifest.entries, *new),
        judged=tuple(judged),
        settings={**manifest.settings, **made.settings},
        recomputed=manifest.recomputed + made.recomputed,
        unsound=manifest.unsound + made.unsound,
    )


@robot_asset("numpy", "4", deps=["approved_variants"], specs=check_specs)
def motion_variants(
    context: dg.AssetExecutionContext,
    clip_pool: ClipPoolResource,
    retargeted_motions: Manifest,
    robot_model: Manifest,
    plan: Plan,
):
    """KP4: variants of the retargeted clips by data/augment.yaml: mirrored, time-scaled, other steps and postures."""

    robot = PROJECT.robot(plan.robot or DEFAULT_ROBOT)
    values = PROJECT.read("augment.yaml", AugmentSettings)
    feedback = approved_part(PROJECT, "augmentation", plan.robot)

    def make(values: AugmentSettings, entries: Sequence[Entry]) -> Manifest:
        function = partial(process, settings=values, robot=robot)
        stage = stage_of(plan, function, values)
        return run_stage(stage, retargeted_motions, PROJECT.store, clip_pool.pool(), context.log, entries)

    manifest = with_applied_changes(all_variants(retargeted_motions, values, feedback, make), feedback, "augmentation")
    strengths = [each.number for each in KINDS.values()]
    metadata = stage_metadata(manifest, ["variant", "time_scale", "mirrored", *strengths]) | approval_metadata(feedback)
    return materialized(plan, manifest, metadata)


@robot_asset("mujoco", "4", specs=check_specs)
def reference_motions(
    context: dg.AssetExecutionContext,
    clip_pool: ClipPoolResource,
    motion_variants: Manifest,
    adapted_robot: Manifest,
    plan: Plan,
):
    """KP5: variants that pass the feasibility criteria for references, which the tracking policy then follows.

    Criteria (data/feasibility.yaml): joint limits, foot slip, floor penetration, self-collision, likeness to the human
    motion.
    """
    from pipeline.viewing.contact_sheet import worst_clips

    stage, _, robot = feasibility_stage(plan, references_of(motion_variants))
    manifest = run_stage(stage, motion_variants, PROJECT.store, clip_pool.pool(), context.log)
    manifest, criteria = split(manifest, thresholds())
    metadata = stage_metadata(manifest, ["variant", "forward_m_s", "lateral_m_s", "yaw_rate_rad_s"])
    metadata |= write_table(plan, criteria, manifest)
    metadata["clips that lost most"] = picture(worst_clips(manifest, motion_variants, PROJECT.store, robot))
    return materialized(plan, manifest, metadata)
