"""Asset checks of the stages. Blocking where the data would be wrong, a warning where it would be poor.

A check is a function of a stage's manifest: whether it holds, and what was found. It is named by its function.
"""

from inspect import getdoc

import dagster as dg

from assets.plan import Plan
from assets.report import check_result
from pipeline.batch import Manifest

Verdict = tuple[bool, str]


def every_clip_accounted_for(manifest: Manifest) -> Verdict:
    """Counts conserve: a clip that came in went on or has a reason."""
    rows = manifest.findings("clip", "pieces", "reasons")
    silent = [clip for clip, pieces, reasons in rows if not pieces and not reasons]
    return not silent, f"without a reason: {', '.join(silent)}" if silent else f"{len(manifest.judged)} clips"


def finite_numbers(manifest: Manifest) -> Verdict:
    """All numbers of the clips that go on are finite, and each clip has a length."""
    try:
        shards = manifest.entry_shards
    except ValueError as error:  # a shard takes no other numbers
        return False, str(error)
    bad: list[str] = []
    for shard in shards:
        columns = shard.columns(["clip", "seconds"])
        seconds = columns.get("seconds", [0.0] * shard.count)
        bad += [
            clip
            for clip, own in zip(columns["clip"], seconds, strict=True)
            if not isinstance(own, float | int) or not own > 0.0
        ]
    return not bad, ", ".join(bad) if bad else f"{len(manifest.entries)} clips"


def something_left(manifest: Manifest) -> Verdict:
    """At least one clip goes on."""
    return bool(manifest.entries), f"{len(manifest.entries)} clips go on"


def no_stage_fault(manifest: Manifest) -> Verdict:
    """No clip was lost to a fault of the stage itself (an unexpected error)."""
    found = manifest.findings("clip", "reasons")
    failed = [clip for clip, reasons in found for reason in reasons if reason["code"] == "failed"]
    return not failed, ", ".join(failed) or "none"


def sound_frames(manifest: Manifest) -> Verdict:
    """Every stored frame is finite, every quaternion unit; contacts of human clips are labelled."""
    there = {entry.clip for entry in manifest.entries} if manifest.unsound else set()
    faults = [f"{clip}: {fault}" for clip, fault in manifest.unsound if clip in there]
    return not faults, "; ".join(faults[:20]) if faults else f"{len(manifest.entries)} clips"


WARNING = (something_left, no_stage_fault)
OF_EVERY_STAGE = (every_clip_accounted_for, finite_numbers, *WARNING)
BEFORE_REPAIR = ("motion_catalog", "selected_motions")
"""Stages whose clips may lack samples."""


def checks_of(plan: Plan):
    """The checks of an asset; frames must be whole from KP2 on."""
    return OF_EVERY_STAGE if plan.name in BEFORE_REPAIR else (*OF_EVERY_STAGE, sound_frames)


def check_specs(plan: Plan) -> list[dg.AssetCheckSpec]:
    """The checks that an asset declares."""
    return [
        dg.AssetCheckSpec(check.__name__, asset=plan.key, blocking=check not in WARNING, description=getdoc(check))
        for check in checks_of(plan)
    ]


def evaluate(plan: Plan, manifest: Manifest) -> list[dg.AssetCheckResult]:
    """The results of the checks on an asset's manifest."""
    return [check_result(plan, each.__name__, *each(manifest), warn=each in WARNING) for each in checks_of(plan)]
