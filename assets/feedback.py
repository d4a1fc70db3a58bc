"""What hardware teaches: failures of trials, the changes they ask for, and each trial beside its simulation.

hardware_trials → failure_modes → curation_feedback ⇢ a person approves ⇢ approved_* → KP1, KP4, KP5, motors, training
                       └→ sim_to_real_report
"""

from pathlib import Path
from typing import Any

import dagster as dg
import pandas as pd

from assets.approved import PROPOSAL, approved_changes
from assets.hardware import trials_of
from assets.plainly import plainly
from assets.plan import FAULTS_TAG, FIELD, FINGERPRINT_TAG, TRIALS, Plan, robot_plans
from assets.project import PROJECT
from assets.report import table_of
from pipeline.batch import Manifest
from pipeline.files import digest, settings

FAILURES, FEEDBACK, REPORT = FIELD
LOOKED = "every_trial_looked_at"
NOTHING_PENDING = "nothing_pending"


def _declared(plan: Plan, kind: str, **others: Any) -> dict[str, Any]:
    return {
        "key": plan.key,
        "group_name": "field",
        "kinds": {kind},
        "code_version": plan.code_version(),
        **others,
    }


def _calibrations() -> dict[str, Plan]:
    """Each robot's calibration: what its motors can do by measurement, before any log."""
    return {robot: robot_plans(robot)[1] for robot in PROJECT.robots}


@dg.asset(
    **_declared(FAILURES, "numpy", deps=[plan.key for plan in _calibrations().values()]),
    ins={"hardware_trials": dg.AssetIn(TRIALS.key)},
    check_specs=[
        dg.AssetCheckSpec(
            LOOKED, asset=FAILURES.key, description="Every trial is of a robot that is here, and was read."
        )
    ],
)
@plainly
def failure_modes(context: dg.AssetExecutionContext, hardware_trials: Manifest):
    """What went wrong in each trial: kind, time, command, evidence, confidence, and whether the policy is to blame."""
    found = {name: _looked_at(name, path, numbers) for name, path, numbers in trials_of(hardware_trials)}
    unread = [f"{name}: {each['unread']}" for name, each in found.items() if "unread" in each]
    manifest = Manifest(
        stage=FAILURES.name,
        entries=(),
        judged=(),
        settings={name: {key: value for key, value in each.items() if key != "new"} for name, each in found.items()},
        recomputed=sum(each.get("new", False) for each in found.values()),
    )
    context.log.info(f"{len(found)} trials, {manifest.recomputed} looked at anew")
    check = dg.AssetCheckResult(
        asset_key=FAILURES.key,
        check_name=LOOKED,
        passed=not unread,
        severity=dg.AssetCheckSeverity.WARN,
        metadata={"found": "; ".join(unread) or f"{len(found)} trials"},
    )
    return _result(FAILURES, manifest, _failure_metadata(manifest), [check])


def _looked_at(name: str, path: Path, numbers: dict[str, Any]) -> dict[str, Any]:
    """The report of a trial, and its twin where its policy is at hand; remembered by all that they depend on."""
    from pipeline.actuators import ActuatorSettings, Calibration, adapt
    from pipeline.failures.settings import FailureSettings
    from pipeline.robot import load_robot

    robot = str(numbers["robot"])
    if robot not in PROJECT.robots:
        return {"unread": f"there is no folder robots/{robot}"}
    values = settings.read(PROJECT.settings("failures.yaml"), FailureSettings)
    calibration = PROJECT.store.load(_calibrations()[robot].key.to_user_string())
    policy = policy_path(robot, numbers.get("policy_digest") or "")
    nominal = load_robot(PROJECT.robot_folder(robot))
    question = [
        *("looked at", FAILURES.code_version(), settings.plain(values), calibration.digest, nominal.digest),
        *(name, digest.of_file(path), digest.of_file(policy) if policy else ""),
    ]
    key = digest.of_json(question)
    known = PROJECT.store.recall(key)
    if known is None:
        limits = settings.read(PROJECT.settings("actuators.yaml"), ActuatorSettings)
        calibrations = [Calibration.from_dict(each) for each in calibration.settings.values()]
        known = {"pieces": [], **_look(path, numbers, nominal, adapt(nominal, calibrations, limits), policy, values)}
        PROJECT.store.remember(key, known)
        return {**known, "new": True}
    return known


def _look(path: Path, numbers: dict[str, Any], robot: Any, actuators: Any, policy: Path | None, values: Any) -> dict:
    from pipeline.deployment import load_policy
    from pipeline.failures.find import find_failures
    from pipeline.feedback.sim_to_real import twin_of, with_cycle_failures
    from pipeline.hardware_logs import read_trial

    trial = read_trial(path)
    report = find_failures(trial, robot, actuators, values, file=str(numbers.get("log", trial.name)))
    ends = [each.time_s for each in report.failures if each.kind in ("fall", "held", "stopped")]
    twin = None
    if policy is not None:
        twin = twin_of(trial, robot, actuators, load_policy(policy), values, min(ends, default=trial.seconds))
    report = with_cycle_failures(report, twin, values)
    return {"report": report.to_dict(), "twin": twin.to_dict() if twin else None}


def policy_path(robot: str, wanted: str) -> Path | None:
    """The policy of a digest among those at hand: the digest of the file, or of the network and gains in it."""
    from pipeline.deployment import digest as policy_digest
    from pipeline.deployment import load_policy

    for path in PROJECT.policy_files(robot) if wanted else ():
        if wanted in (digest.of_file(path), policy_digest(load_policy(path))):
            return path
    return None


def _failure_metadata(manifest: Manifest) -> dict[str, Any]:
    rows, kinds = [], {}
    reports = reports_of(manifest)
    for report in reports:
        for each in report.failures:
            kinds[each.kind] = kinds.get(each.kind, 0) + 1
            rows.append(
                {
                    "trial": report.trial,
                    "kind": each.kind,
                    "at [s]": round(each.time_s, 2),
                    "command": " ".join(f"{value:.2f}" for value in each.command),
                    "what": " ".join(part for part in (each.direction, each.joint) if part),
                    "confidence": each.confidence,
                    "not the policy's": each.excuse,
                    "simulated": report.simulated,
                    "said": each.text(),
                }
            )
    table = pd.DataFrame(rows, columns=None if rows else ["trial"])
    return {
        "trials": len(reports),
        "trials looked at anew": manifest.recomputed,
        "failures": len(rows),
        "failures of the policy": sum(each.of_policy for report in reports for each in report.failures),
        **{f"{kind} ": count for kind, count in sorted(kinds.items())},
        "dagster/row_count": len(rows),
        "what went wrong": table_of(table, list(table)),
    }


def reports_of(manifest: Manifest) -> list[Any]:
    """The reports in the result of `failure_modes`."""
    from pipeline.failures.trial_report import TrialReport

    return [TrialReport.from_dict(each["report"]) for _, each in sorted(manifest.settings.items()) if "report" in each]


@dg.asset(
    **_declared(FEEDBACK, "python"),
    ins={"failure_modes": dg.AssetIn(FAILURES.key)},
    check_specs=[
        dg.AssetCheckSpec(
            NOTHING_PENDING, asset=PROPOSAL, description="What the rules propose is what a person approved."
        )
    ],
)
@plainly
def curation_feedback(context: dg.AssetExecutionContext, failure_modes: Manifest):
    """Changes that the failures ask for, by data/feedback_rules.yaml: each bounded, with the logs that it rests on.

    They take effect when they are approved: by the job approve_feedback with this page's proposal, or by copying
    data/feedback/proposed.yaml to approved.yaml.
    """
    from pipeline.feasibility import FeasibilitySettings
    from pipeline.feedback.approved import write_changes
    from pipeline.feedback.propose import propose
    from pipeline.feedback.rules import FeedbackRules
    from pipeline.selection import Curation

    rules = settings.read(PROJECT.settings("feedback_rules.yaml"), FeedbackRules)
    commands = settings.read(PROJECT.settings("feasibility.yaml"), FeasibilitySettings).balance.commands
    bounds = settings.read(PROJECT.settings("curation.yaml"), Curation).windows.bounds
    proposal = propose(reports_of(failure_modes), rules, commands, bounds)
    found = write_changes(PROJECT.proposed_feedback, proposal.changes)
    if proposal.changes and not rules.approval.required:
        write_changes(PROJECT.approved_feedback, proposal.changes, by="the rules, which ask for no approval")
    manifest = Manifest(
        stage=FEEDBACK.name,
        entries=(),
        judged=(),
        settings={f"{place:04d}": each.to_dict() for place, each in enumerate(proposal.changes)},
    )
    approved = approved_changes(PROJECT)
    pending = [each for each in proposal.changes if each not in approved]
    check = dg.AssetCheckResult(
        asset_key=PROPOSAL,
        check_name=NOTHING_PENDING,
        passed=not pending,
        severity=dg.AssetCheckSeverity.WARN,
        metadata={"found": f"{len(pending)} changes wait for approval" if pending else "nothing waits"},
    )
    metadata = _proposal_metadata(found, proposal, approved, pending)
    context.log.info(f"proposal '{found or 'none'}': {len(proposal.changes)} changes, {len(pending)} pending")
    return _result(FEEDBACK, manifest, metadata, [check])


def _proposal_metadata(found: str, proposal: Any, approved: Any, pending: Any) -> dict[str, Any]:
    rows = [
        {
            "part": each.section,
            "robot": each.robot,
            "what": each.what,
            "from": each.before,
            "to": each.value,
            "bound": each.bound,
            "approved": each in approved,
            "logs": ", ".join(sorted({witness.log for witness in each.witnesses})),
            "simulated": all(witness.simulated for witness in each.witnesses),
            "because": "; ".join(witness.said for witness in each.witnesses),
        }
        for each in proposal.changes
    ]
    table = pd.DataFrame(rows, columns=None if rows else ["part"])
    silent = "\n".join(f"- {sentence}" for sentence in proposal.silent) or "nothing"
    how = f'{{"ops": {{"approve": {{"config": {{"proposal": "{found}", "by": "YOUR NAME"}}}}}}}}'
    return {
        "proposal": found or "none",
        "changes": len(rows),
        "changes pending": len(pending),
        "changes approved": len(approved),
        "how to approve": dg.MetadataValue.md(
            f"Launch the job `approve_feedback` with\n\n    {how}\n\nor copy data/feedback/proposed.yaml to "
            "data/feedback/approved.yaml."
            if pending
            else "nothing waits"
        ),
        "proposes nothing": dg.MetadataValue.md(silent),
        "what is proposed": table_of(table, list(table)),
    }


@dg.asset(**_declared(REPORT, "mujoco"), ins={"failure_modes": dg.AssetIn(FAILURES.key)})
@plainly
def sim_to_real_report(failure_modes: Manifest):
    """Each trial beside MuJoCo with the same policy, gains and command: tracking, and the limit cycles of the legs."""
    rows, notes = [], []
    for name, each in sorted(failure_modes.settings.items()):
        twin = each.get("twin")
        if twin is None:
            notes.append(f"{name}: its policy is not at hand, or nothing in it is steady")
            continue
        rows.append(_twin_row(name, twin))
        notes += [f"{name}: {note}" for note in twin["notes"]]
    table = pd.DataFrame(rows, columns=None if rows else ["trial"])
    manifest = Manifest(
        stage=REPORT.name,
        entries=(),
        judged=(),
        settings={row["trial"]: {**row, "trial": row["trial"]} for row in rows},
    )
    metadata = {
        "trials compared": len(rows),
        "not compared": dg.MetadataValue.md("\n".join(f"- {note}" for note in notes) or "nothing"),
        "dagster/row_count": len(rows),
        "trials against their simulation": table_of(table, list(table)),
    }
    return _result(REPORT, manifest, metadata, [])


def _twin_row(name: str, twin: dict[str, Any]) -> dict[str, Any]:
    row: dict[str, Any] = {"trial": name, "from [s]": twin["start_s"], "to [s]": twin["stop_s"]}
    for place, axis in enumerate(("forward", "lateral", "yaw")):
        row |= {
            f"{axis} commanded": twin["command"][place],
            f"{axis} achieved": twin["achieved"][place],
            f"{axis} simulated": twin["simulated"][place],
        }
    row["simulation fell"] = twin["simulation_fell"]
    for each in twin["cycles"]:
        side = each["name"].split()[-1]
        row |= {f"{side} shape distance, {plane}": value for plane, value in each["shape_distance"].items()}
        row |= {
            f"{side} period ratio": each["period_ratio"],
            f"{side} knee amplitude ratio": each["knee_amplitude_ratio"],
        }
    return row


def _result(plan: Plan, manifest: Manifest, metadata: dict, checks: list[dg.AssetCheckResult]) -> dg.MaterializeResult:
    return dg.MaterializeResult(
        asset_key=plan.key,
        value=manifest,
        metadata=metadata,
        check_results=checks,
        data_version=dg.DataVersion(manifest.digest),
        tags={FINGERPRINT_TAG: plan.fingerprint(PROJECT), FAULTS_TAG: "0"},
    )
