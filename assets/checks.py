"""Asset checks of the stages. Blocking where the data would be wrong, a warning where it would be poor."""

from collections.abc import Callable
from dataclasses import dataclass

import dagster as dg

from assets.plan import Plan
from assets.report import check_result
from pipeline.batch import Manifest
from pipeline.batch.shard import MISSING

Verdict = tuple[bool, str]


@dataclass(frozen=True, kw_only=True)
class StageCheck:
    """A check on a stage's manifest."""

    name: str
    says: str
    look: Callable[[Manifest], Verdict]
    """Whether it holds, and what was found."""
    blocking: bool


def check_specs(plan: Plan) -> list[dg.AssetCheckSpec]:
    """The checks that an asset declares."""
    return [
        dg.AssetCheckSpec(check.name, asset=plan.key, blocking=check.blocking, description=check.says)
        for check in checks_of(plan)
    ]


def checks_of(plan: Plan) -> tuple["StageCheck", ...]:
    """The checks of an asset; frames must be whole from KP2 on, before it samples may be missing."""
    return STAGE_CHECKS if plan.name in ("motion_catalog", "selected_motions") else (*STAGE_CHECKS, SOUND_FRAMES)


def evaluate(plan: Plan, manifest: Manifest) -> list[dg.AssetCheckResult]:
    """The results of the checks on an asset's manifest."""
    results = []
    for check in checks_of(plan):
        passed, found = check.look(manifest)
        results.append(check_result(plan, check.name, passed, found, warn=not check.blocking))
    return results


def _accounted(manifest: Manifest) -> Verdict:
    rows = manifest.findings("clip", "pieces", "reasons")
    silent = [clip for clip, pieces, reasons in rows if not pieces and not reasons]
    return not silent, f"without a reason: {', '.join(silent)}" if silent else f"{len(manifest.judged)} clips"


def _finite(manifest: Manifest) -> Verdict:
    try:
        shards = manifest.entry_shards
    except ValueError as error:  # a shard takes no other numbers
        return False, str(error)
    bad: list[str] = []
    for shard in shards:
        columns = shard.columns(["clip", "seconds"])
        seconds = columns.get("seconds", [0.0] * shard.count)
        bad += [clip for clip, own in zip(columns["clip"], seconds, strict=True) if own is MISSING or not own > 0.0]
    return not bad, ", ".join(bad) if bad else f"{len(manifest.entries)} clips"


def _left(manifest: Manifest) -> Verdict:
    return bool(manifest.entries), f"{len(manifest.entries)} clips go on"


def _no_fault(manifest: Manifest) -> Verdict:
    found = manifest.findings("clip", "reasons")
    failed = [clip for clip, reasons in found for reason in reasons if reason["code"] == "failed"]
    return not failed, ", ".join(failed) or "none"


def _sound(manifest: Manifest) -> Verdict:
    there = {entry.clip for entry in manifest.entries} if manifest.unsound else set()
    faults = [f"{clip}: {fault}" for clip, fault in manifest.unsound if clip in there]
    return not faults, "; ".join(faults[:20]) if faults else f"{len(manifest.entries)} clips"


STAGE_CHECKS = (
    StageCheck(
        name="every_clip_accounted_for",
        says="Counts conserve: a clip that came in went on or has a reason.",
        look=_accounted,
        blocking=True,
    ),
    StageCheck(
        name="finite_numbers",
        says="All numbers of the clips that go on are finite, and each clip has a length.",
        look=_finite,
        blocking=True,
    ),
    StageCheck(name="something_left", says="At least one clip goes on.", look=_left, blocking=False),
    StageCheck(
        name="no_stage_fault",
        says="No clip was lost to a fault of the stage itself (an unexpected error).",
        look=_no_fault,
        blocking=False,
    ),
)

SOUND_FRAMES = StageCheck(
    name="sound_frames",
    says="Every stored frame is finite, every quaternion unit; contacts of human clips are labelled.",
    look=_sound,
    blocking=True,
)
