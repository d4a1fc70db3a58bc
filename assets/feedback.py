"""What hardware teaches: the changes that failures ask for, and each trial beside its simulation.

hardware_trials → failure_modes → curation_feedback ⇢ a person approves ⇢ approved_* → KP1, KP4, KP5, motors, training
                       └→ sim_to_real_report
"""

from typing import Any

import dagster as dg
import pandas as pd

from assets.approved import PROPOSAL, approved_changes
from assets.failure_modes import declared, reports_of, result_of
from assets.plainly import plainly
from assets.plan import FIELD
from assets.project import PROJECT
from assets.report import table_of
from pipeline.batch import Manifest
from pipeline.files import settings

FAILURES, FEEDBACK, REPORT = FIELD
NOTHING_PENDING = "nothing_pending"


@dg.asset(
    **declared(FEEDBACK, "python"),
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
    return result_of(FEEDBACK, manifest, metadata, [check])


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


@dg.asset(**declared(REPORT, "mujoco"), ins={"failure_modes": dg.AssetIn(FAILURES.key)})
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
    return result_of(REPORT, manifest, metadata, [])


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
