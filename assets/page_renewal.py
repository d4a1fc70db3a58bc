"""The page of curation_feedback is made again when the approved changes differ from those it shows."""

import dagster as dg

from assets.approved import PAGE_TAG, PROPOSAL, approvals_of, shown_state
from assets.freshness import last_tags
from assets.project import Project
from assets.run_tries import MAX_TRIES, tries

renew_feedback_page = dg.define_asset_job(
    "renew_feedback_page",
    selection=dg.AssetSelection.assets(PROPOSAL),
    description="The page of curation_feedback with what is approved now.",
)


def page_request(instance: dg.DagsterInstance, project: Project) -> dg.RunRequest | None:
    """The run that makes the page again; None where it is as it should be, was never made, or can't be made."""
    tags, state = last_tags(instance, PROPOSAL), shown_state(approvals_of(project), project.feedback.declined_changes())
    if tags is None or tags.get(PAGE_TAG) == state:
        return None
    runs = dg.RunsFilter(job_name=renew_feedback_page.name)
    found = tries(instance, project, runs, lambda run: run.tags.get(PAGE_TAG) == state)
    if found.at_work or found.cancelled or found.in_vain >= MAX_TRIES:
        return None
    return dg.RunRequest(job_name=renew_feedback_page.name, tags={PAGE_TAG: state})
