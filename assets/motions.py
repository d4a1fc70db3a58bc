"""Stages that all robots share: motion catalogue, KP1 (selection), KP2 (repair)."""

import dataclasses
from functools import partial

import dagster as dg

from assets.approved import approval_metadata, approved_part
from assets.checks import check_specs
from assets.plan import SHARED
from assets.report import asset_of, picture, stage_metadata
from assets.resources import ClipPoolResource
from assets.sources import RAW_MOTIONS, find_motions, remember_sources, source_notes
from assets.stage import materialized, stage_of
from pipeline.batch import Manifest, run_files, run_stage
from pipeline.feedback.windows import chosen_windows
from pipeline.files.shown_text import markdown_list
from pipeline.project import PROJECT
from pipeline.selection import Curation, idle_patterns, process

CATALOG, SELECTED, REPAIRED = SHARED


@asset_of(CATALOG, "python", deps=[RAW_MOTIONS], specs=check_specs)
def motion_catalog(context: dg.AssetExecutionContext, clip_pool: ClipPoolResource):
    """Catalogue of all motion files: format, skeleton, unit, measured frame rate [Hz], speeds [m/s], defects."""
    from pipeline.catalog import CatalogSettings, catalogue_file

    values = PROJECT.read("catalog.yaml", CatalogSettings)
    stage = stage_of(CATALOG, partial(catalogue_file, settings=values), values)
    motions = find_motions(PROJECT)
    manifest = run_files(stage, motions.files(), PROJECT.store, clip_pool.pool(), context.log)
    remember_sources(PROJECT, motions)
    metadata = stage_metadata(manifest, ["kind", "format", "skeleton", "unit", "fps", "speed_mean", "licence"])
    notes = source_notes(PROJECT)
    for text in notes:
        context.log.warning(text)
    if notes:
        metadata["files not read, empty folders and patterns"] = dg.MetadataValue.md(markdown_list(notes))
    return materialized(CATALOG, manifest, metadata)


@asset_of(SELECTED, "python", "1", deps=["approved_windows"], specs=check_specs)
def selected_motions(context: dg.AssetExecutionContext, clip_pool: ClipPoolResource, motion_catalog: Manifest):
    """KP1: windows of one skill each, labelled by measured velocity, and the selection among them.

    data/curation.yaml has the limits and rules; each window that is left out has a reason.
    """
    from pipeline.viewing.plots import command_coverage

    curation = PROJECT.read("curation.yaml", Curation)
    windows_only = dataclasses.replace(curation, expert_motions="rollouts", decisions=())  # they change no window
    stage = stage_of(SELECTED, partial(process, settings=windows_only), windows_only)
    windows = run_stage(stage, motion_catalog, PROJECT.store, clip_pool.pool(), context.log)
    for pattern in idle_patterns(windows.entry_table(), curation):
        context.log.warning(f"excluded_clips in data/curation.yaml: the pattern '{pattern}' matches no clip")
    feedback = approved_part(PROJECT, "selection", None)
    manifest, bounds = chosen_windows(windows, curation, feedback)
    metadata = stage_metadata(
        manifest, ["forward_m_s", "lateral_m_s", "yaw_rate_rad_s", "licence"]
    ) | approval_metadata(feedback)
    if bounds:
        metadata["effect of feedback"] = dg.MetadataValue.md(markdown_list(each.text() for each in bounds))
    metadata["windows not taken"] = len(windows.entries) - len(manifest.entries)
    metadata["coverage"] = picture(command_coverage(manifest.entry_table(), "human speed, selected windows"))
    return materialized(SELECTED, manifest, metadata)


@asset_of(REPAIRED, "numpy", "2", specs=check_specs)
def repaired_motions(context: dg.AssetExecutionContext, clip_pool: ClipPoolResource, selected_motions: Manifest):
    """KP2: repaired windows: corrupted frames filled or cut, heading and floor aligned, zero-phase smoothing, foot
    contacts labelled."""
    from pipeline.repair import RepairSettings, prepare, process
    from pipeline.viewing.contact_sheet import worst_clips

    values = PROJECT.read("repair.yaml", RepairSettings)
    stage = stage_of(REPAIRED, partial(process, settings=values), values, prepare=partial(prepare, settings=values))
    manifest = run_stage(stage, selected_motions, PROJECT.store, clip_pool.pool(), context.log)
    metadata = stage_metadata(manifest, ["filled_frames", "cut_frames", "floor_m", "stance_slip_m_s"])
    metadata["clips that lost most"] = picture(worst_clips(manifest, selected_motions, PROJECT.store, None))
    return materialized(REPAIRED, manifest, metadata)
