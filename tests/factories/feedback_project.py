"""A project that has rules, a robot and a proposal in its store, and nothing else."""

from pathlib import Path

import dagster as dg

from assets.approved import approved_versions
from assets.freshness import INPUT_VERSION_PREFIX
from assets.plan import FIELD
from pipeline.batch import Manifest
from pipeline.failures.trial_report import TrialReport
from pipeline.feedback.change import proposal_digest
from pipeline.files import settings
from pipeline.project import Project
from tests.factories.trial_reports import failure, proposal, report, saturated

HEEDING = ("selected_motions", "motion_variants", "feasible_motions", "adapted_robot")
"""Assets that heed a section of what is approved."""
MADE = (*HEEDING, "expert_db")


def feedback_project(root: Path, folder: Path) -> Project:
    """The project in a folder of its own."""
    (folder / "data").mkdir()
    (folder / "data/feedback_rules.yaml").write_text((root / "data/feedback_rules.yaml").read_text())
    (folder / "robots/t1").mkdir(parents=True)
    (folder / "robots/t1/robot.toml").write_text("")
    return Project(folder)


def two_falls() -> tuple[TrialReport, ...]:
    """Two logs that propose something for every section."""
    return tuple(report(number, failure(), saturated(36.0)) for number in range(2))


def propose_into(project: Project, *reports: TrialReport) -> str:
    """Store what the rules make of reports as the asset does; the proposal's digest."""
    changes = proposal(*reports).changes
    stored = {f"{place:04d}": settings.plain(change) for place, change in enumerate(changes)}
    manifest = Manifest(stage=FIELD[1].name, entries=(), judged=(), settings=stored)
    project.store.save("curation_feedback", manifest)
    return proposal_digest(changes)


def note_materialized(instance: dg.DagsterInstance, project: Project, *names: str) -> None:
    """Note stages, and the database, as made from what is approved now."""
    versions = {key.to_user_string(): version for key, (version, _) in approved_versions(project).items()}
    tags = {f"{INPUT_VERSION_PREFIX}{key}": version for key, version in versions.items()}
    for name in names or MADE:
        instance.report_runless_asset_event(dg.AssetMaterialization(dg.AssetKey([name]), tags=tags))
