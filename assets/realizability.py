"""Whether a classifier can tell the database from what the robot does in simulation, with its asset check."""

import dataclasses
from functools import partial
from typing import Any

import dagster as dg
import numpy as np

from assets.plan import Plan, named_plans
from assets.project import DEFAULT_ROBOT, PROJECT
from pipeline.batch import Manifest
from pipeline.files import settings

REALIZABLE = "realizability"
WARN_ABOVE = 0.75
"""Held-out accuracy from which an adversarial discriminator has little to learn from."""
OTHER_SEED = 1000
"""Added to the seed of `data/tracking.yaml`: the same disturbances drawn anew."""
REFERENCES = 60
"""References of which a rollout under another seed is made ..."""
SECONDS = 6.0
"""... of this length at most [s]."""


def realizability_spec(plan: Plan) -> dg.AssetCheckSpec:
    """The check that `expert_db` declares."""
    return dg.AssetCheckSpec(
        REALIZABLE,
        asset=plan.key,
        description=f"A classifier tells windows of the database from rollouts under other seeds in at most "
        f"{100 * WARN_ABOVE:.0f} of 100 held-out windows; 50 is chance.",
    )


def realizability_check(plan: Plan, feasible: Manifest, pool: Any) -> tuple[dg.AssetCheckResult, float | None]:
    """The check's result, and the accuracy; None where the database has too few motions to hold some out."""
    from pipeline.errors import FileError
    from pipeline.expert.realizability import TooFewMotionsError

    try:
        accuracy = measured(plan.robot or DEFAULT_ROBOT, feasible, pool)
    except (TooFewMotionsError, FileError) as error:
        return _result(plan, True, f"not measured: {error}"), None
    found = f"held-out accuracy {accuracy:.2f}; 0.5 is chance, a warning above {WARN_ABOVE:g}"
    return _result(plan, accuracy <= WARN_ABOVE, found), accuracy


def measured(robot_name: str, feasible: Manifest, pool: Any, seed: int = 0) -> float:
    """Held-out accuracy between clips of KP5 and rollouts of their references under another seed."""
    from pipeline.actuators import read_actuators, torque_envelope
    from pipeline.expert.realizability import held_out_accuracy
    from pipeline.robot import load_robot
    from pipeline.tracking.settings import TrackingSettings

    plans, folder = named_plans(robot_name), PROJECT.adapted_robot(robot_name)
    robot, envelope = load_robot(folder), torque_envelope(read_actuators(folder))
    references = PROJECT.store.load(plans["reference_motions"].key.to_user_string())
    (facts,) = PROJECT.store.load(plans["tracking_policy"].key.to_user_string()).settings.values()
    values = settings.read(PROJECT.settings("tracking.yaml"), TrackingSettings)
    other = dataclasses.replace(values, seed=values.seed + OTHER_SEED + seed, disturbed=1, disturbed_variants=1)
    known = {str(entry.numbers.get("reference") or entry.clip) for entry in feasible.entries}
    entries = [entry for entry in references.entries if entry.clip in known]
    chosen = np.random.default_rng(seed).permutation(len(entries))[:REFERENCES]
    taken = [entries[index] for index in sorted(chosen)]
    work = partial(
        _disturbed,
        settings=other,
        robot=robot,
        envelope=envelope,
        tracker=PROJECT.root / facts["folder"] / "tracker.npz",
        store=PROJECT.store,
    )
    rollouts: dict[str, list[Any]] = {}
    for entry, clips in zip(taken, pool.map(work, [(entry,) for entry in taken]), strict=True):
        rollouts.setdefault(_family(entry.clip), []).extend(clips)
    names = {entry.clip for entry in taken}
    motions: dict[str, list[Any]] = {}
    for entry in feasible.entries:
        if str(entry.numbers.get("reference") or entry.clip) in names:
            motions.setdefault(_family(entry.clip), []).append(PROJECT.store.get_clip(entry.blob, entry.clip))
    return held_out_accuracy(motions, {name: clips for name, clips in rollouts.items() if clips}, robot, seed)


def _disturbed(entry: Any, *, settings: Any, robot: Any, envelope: Any, tracker: Any, store: Any) -> list[Any]:
    """The disturbed rollout of the first seconds of a reference, under the settings' seed."""
    from pipeline.tracking.process import process

    clip = store.get_clip(entry.blob, entry.clip)
    part = clip.cut(0, min(clip.frame_count, round(SECONDS * clip.fps)), clip.name)
    outcome = process(part, entry.numbers, settings=settings, robot=robot, envelope=envelope, tracker=tracker)
    return [piece.clip for piece in outcome.pieces if piece.numbers["rollout"] == 1]


def _family(clip: str) -> str:
    """The source window that a clip comes from: its name before the first mark of a variant."""
    return clip.split("~")[0]


def _result(plan: Plan, passed: bool, found: str) -> dg.AssetCheckResult:
    return dg.AssetCheckResult(
        asset_key=plan.key,
        check_name=REALIZABLE,
        passed=passed,
        severity=dg.AssetCheckSeverity.WARN,
        metadata={"found": found},
    )
