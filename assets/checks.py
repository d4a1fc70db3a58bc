"""Asset checks of the stages: blocking if the data would be wrong, a warning if it would be of low quality.

A check is a function of the stage's manifest that returns whether it passed and its findings. The name of the function
is the name of the check, its docstring the description.
"""

from inspect import getdoc

import dagster as dg

from assets.plan import Plan
from assets.report import check_result
from pipeline.batch import Manifest

Verdict = tuple[bool, str]


def every_clip_accounted_for(manifest: Manifest) -> Verdict:
    """Every input clip is kept, or has a reason for its rejection."""
    rows = manifest.findings("clip", "pieces", "reasons")
    silent = [clip for clip, pieces, reasons in rows if not pieces and not reasons]
    return not silent, f"without a reason: {', '.join(silent)}" if silent else f"{len(manifest.judged)} clips"


def finite_numbers(manifest: Manifest) -> Verdict:
    """All numbers of the kept clips are finite, and each clip has a positive duration."""
    try:
        shards = manifest.entry_shards
    except ValueError as error:  # a shard refuses numbers that are not finite
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
    """At least one clip is kept."""
    return bool(manifest.entries), f"{len(manifest.entries)} clips are kept"


def no_stage_fault(manifest: Manifest) -> Verdict:
    """No clip was rejected because of an unexpected error in the stage itself."""
    found = manifest.findings("clip", "reasons")
    failed = [clip for clip, reasons in found for reason in reasons if reason["code"] == "failed"]
    return not failed, ", ".join(failed) or "none"


def sound_frames(manifest: Manifest) -> Verdict:
    """Every stored frame is finite, quaternions have unit length, contacts of human clips are labelled."""
    kept = {entry.clip for entry in manifest.entries} if manifest.unsound else set()
    faults = [f"{clip}: {fault}" for clip, fault in manifest.unsound if clip in kept]
    return not faults, "; ".join(faults[:20]) if faults else f"{len(manifest.entries)} clips"


WARNING = (something_left, no_stage_fault)
OF_EVERY_STAGE = (every_clip_accounted_for, finite_numbers, *WARNING)
BEFORE_REPAIR = ("motion_catalog", "selected_motions")
"""Stages before repair, whose clips may have missing samples."""


def checks_of(plan: Plan):
    """The checks of an asset; frames are checked from KP2 on."""
    return OF_EVERY_STAGE if plan.name in BEFORE_REPAIR else (*OF_EVERY_STAGE, sound_frames)


def check_specs(plan: Plan) -> list[dg.AssetCheckSpec]:
    """Specifications of the checks that an asset declares."""
    return [
        dg.AssetCheckSpec(check.__name__, asset=plan.key, blocking=check not in WARNING, description=getdoc(check))
        for check in checks_of(plan)
    ]


def evaluate(plan: Plan, manifest: Manifest) -> list[dg.AssetCheckResult]:
    """Evaluate the checks of an asset on its manifest."""
    return [check_result(plan, each.__name__, *each(manifest), warn=each in WARNING) for each in checks_of(plan)]
