"""KP4: rollouts of the tracking policy in simulation, for each reference."""

import dataclasses
import math
from collections.abc import Callable, Sequence
from functools import partial
from statistics import fmean
from typing import Any

import dagster as dg
import pandas as pd

from assets.checks import check_specs
from assets.plan import Plan
from assets.report import picture, robot_asset, stage_metadata, table_of
from assets.resources import ClipPoolResource
from assets.stage import materialized, stage_of
from assets.tracker_choice import no_tracker, tracker_file
from pipeline.actuators.adapted_robot import read_actuators, torque_envelope
from pipeline.batch import Entry, Manifest, run_stage
from pipeline.clips.outcome import Outcome
from pipeline.project import DEFAULT_ROBOT, PROJECT
from pipeline.robot import load_robot
from pipeline.tracking.before_after import by_skill
from pipeline.tracking.neighbours import compared_with_neighbours
from pipeline.tracking.process import Setup, motion_to_failure, process
from pipeline.tracking.settings import TrackingSettings
from pipeline.tracking.tracker import load_tracker

BEFORE_AND_AFTER = (
    *("speed_before_m_s", "speed_after_m_s", "drift_m"),
    *("slip_before_m_s", "slip_after_m_s", "penetration_before_m", "penetration_after_m"),
    *("jerk_before_rad_s3", "jerk_after_rad_s3", "saturated_after", "contact_changed", "touchdown_shift_s"),
)
"""Columns of the table that compares references with rollouts (pipeline/tracking/before_after.py)."""


@robot_asset("mujoco", "4", specs=check_specs)
def augmented_motions(
    context: dg.AssetExecutionContext,
    clip_pool: ClipPoolResource,
    reference_motions: Manifest,
    tracking_policy: Manifest,
    adapted_robot: Manifest,
    plan: Plan,
):
    """KP4: rollouts of the tracking policy in MuJoCo, for each reference: one undisturbed and several disturbed."""
    from pipeline.viewing.tracking_plots import before_and_after, tracking_errors, worst_tracked

    folder = PROJECT.adapted_robot(plan.robot or DEFAULT_ROBOT)
    robot, envelope = load_robot(folder), torque_envelope(read_actuators(folder))
    values = PROJECT.read("tracking.yaml", TrackingSettings)
    found = tracker_file(PROJECT, tracking_policy)
    if found is None:
        why = no_tracker(plan.robot or DEFAULT_ROBOT)
        context.log.warning(why)
        empty = Manifest(stage=plan.name, entries=(), judged=(), settings=reference_motions.settings)
        return materialized(plan, empty, {"references tracked": f"0: {why}"})
    tracker, content = found
    setup = Setup(settings=values, robot=robot, envelope=envelope, tracker=tracker)
    load_tracker(tracker, robot)  # raises once if it does not fit the robot, instead of rejecting each reference

    def run(function: Callable[..., Outcome], name: str = "", entries: Sequence[Entry] = ()) -> Manifest:
        """Run `function` on the references; known results come from the store."""
        stage = stage_of(plan, partial(function, setup=setup), values, name=name, robot_files=robot.digest)
        stage = dataclasses.replace(stage, depends={**stage.depends, "tracker": content})
        return run_stage(stage, reference_motions, PROJECT.store, clip_pool.pool(), context.log, entries)

    manifest = compared_with_neighbours(run(process), reference_motions)
    metadata = stage_metadata(manifest, ["rollout", "body_error_m", "joint_error_rad", "action_noise", "survived"])
    tracked = tracked_references(manifest, reference_motions)
    metadata |= tracking_metadata(manifest, tracked)
    if manifest.entries:
        metadata["tracking errors"] = picture(tracking_errors(manifest.entry_table()))
        metadata["before and after simulation"] = picture(before_and_after(tracked))
        to_failure = partial(run, motion_to_failure, "motion to failure")
        metadata["worst tracked references, at their failure"] = picture(
            worst_tracked(manifest, reference_motions, to_failure, PROJECT.store, robot)
        )
    return materialized(plan, manifest, metadata)


def tracking_metadata(manifest: Manifest, worst: pd.DataFrame) -> dict[str, Any]:
    """Tracking errors of the undisturbed rollouts, and the number of disturbed ones that reach the last frame.

    `worst` has one row per undisturbed rollout, the worst first.
    """
    if worst.empty:
        return {"references tracked": 0}
    rows, speeds = worst.to_dict("records"), by_skill(worst)
    disturbed = [entry.numbers for entry in manifest.entries if entry.numbers["rollout"] > 0]
    attempted = sum(int(row["rollouts"]) - 1 for row in rows)
    complete = sum(bool(numbers["survived"]) for numbers in disturbed)
    columns = ["clip", "survived", "followed_s", "body_error_m", "worst_body_error_m", "joint_error_rad"]
    return {
        "references tracked": f"{sum(bool(row['survived']) for row in rows)} of {len(rows)} reach the last frame",
        "mean body error [cm]": 100.0 * fmean(row["body_error_m"] for row in rows),
        "mean joint error [deg]": math.degrees(fmean(row["joint_error_rad"] for row in rows)),
        "disturbed rollouts": f"{complete} of {attempted} reach the last frame",
        "references, worst first": table_of(worst, columns),
        "speed of references and rollouts": table_of(speeds),
        "before and after simulation, per reference": table_of(worst, ["clip", *BEFORE_AND_AFTER]),
    }


def tracked_references(manifest: Manifest, references: Manifest) -> pd.DataFrame:
    """One row per reference that was rolled out, with its skill, the worst tracked first."""
    skills = {entry.clip: str(entry.numbers.get("skill", "")) for entry in references.entries}
    rows = [
        {"clip": row.clip, **row.numbers, "skill": skills.get(row.clip, "")}
        for row in manifest.judged
        if "survived" in row.numbers
    ]
    return pd.DataFrame(sorted(rows, key=lambda row: (-row["worst_body_error_m"], row["clip"])))
