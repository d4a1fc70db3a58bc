"""KP4's references: variants of the retargeted motions, and which of them are worth tracking."""

from collections.abc import Sequence
from functools import partial
from typing import Any

import dagster as dg

from assets.approved import approval_metadata, approved_part, noting
from assets.checks import check_specs
from assets.criteria import references_of, thresholds, write_table
from assets.plainly import plainly
from assets.plan import Plan
from assets.project import DEFAULT_ROBOT, PROJECT
from assets.report import picture, stage_metadata
from assets.resources import ClipPoolResource
from assets.stage import declared_motions, inputs_of, materialized, stage_of
from assets.variants import all_variants
from pipeline.batch import Entry, Manifest, run_stage
from pipeline.files import settings


def motion_variants(plan: Plan, retargeted: Plan, model: Plan) -> Any:
    """The asset `motion_variants` of a robot."""
    inputs = inputs_of(retargeted_motions=retargeted, robot_model=model)

    @dg.asset(
        **declared_motions(plan, "numpy", "4", inputs, "augmentation"),
        check_specs=check_specs(plan),
    )
    @plainly
    def motion_variants(
        context: dg.AssetExecutionContext,
        clip_pool: ClipPoolResource,
        retargeted_motions: Manifest,
        robot_model: Manifest,
    ):
        """KP4: each clip, its mirror image, both at other speeds, and with other steps or postures where asked for."""
        from pipeline.augment import AugmentSettings, process
        from pipeline.augment.process import KINDS
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
        metadata = stage_metadata(manifest, ["variant", "time_scale", "mirrored", *strengths]) | approval_metadata(
            feedback
        )
        return materialized(plan, manifest, metadata)

    return motion_variants


def reference_motions(plan: Plan, variants: Plan, adapted: Plan) -> Any:
    """The asset `reference_motions` of a robot."""

    @dg.asset(
        **declared_motions(plan, "mujoco", "4", inputs_of(motion_variants=variants, adapted_robot=adapted)),
        check_specs=check_specs(plan),
    )
    @plainly
    def reference_motions(
        context: dg.AssetExecutionContext,
        clip_pool: ClipPoolResource,
        motion_variants: Manifest,
        adapted_robot: Manifest,
    ):
        """KP4: variants that are worth tracking: limits, slip, penetration, self-collision, likeness hold."""
        from pipeline.feasibility import FeasibilitySettings, process
        from pipeline.feasibility.criteria_table import split
        from pipeline.robot import load_robot
        from pipeline.viewing.contact_sheet import worst_clips

        robot = load_robot(PROJECT.adapted_robot(plan.robot or DEFAULT_ROBOT))
        values = settings.read(PROJECT.settings("feasibility.yaml"), FeasibilitySettings)
        function = partial(process, settings=values, robot=robot, references=references_of(motion_variants))
        stage = stage_of(plan, function, values, robot_files=robot.digest)
        manifest = run_stage(stage, motion_variants, PROJECT.store, clip_pool.pool(), context.log)
        manifest, criteria = split(manifest, thresholds())
        metadata = stage_metadata(manifest, ["variant", "forward_m_s", "lateral_m_s", "yaw_rate_rad_s"])
        metadata |= write_table(plan, criteria, manifest)
        metadata["clips that lost most"] = picture(worst_clips(manifest, motion_variants, PROJECT.store, robot))
        return materialized(plan, manifest, metadata)

    return reference_motions
