"""From a proposal to a new database: the job that approves, and what re-curates when something was approved.

A sensor looks every half minute for approved changes that a database has not heard of, a schedule once a night, for
what was approved while nobody watched. Neither trains.
"""

import dagster as dg

from assets.approved import PARTS, SHARED_PARTS, approved_key, approved_versions
from assets.external import note_external
from assets.freshness import INPUT_VERSION_PREFIX, last_tags
from assets.plainly import told_plainly
from assets.plan import FIELD, SHARED, robot_plans
from assets.project import PROJECT, Project
from pipeline.errors import PipelineError
from pipeline.files import digest, settings

EVERY_S = 30
HEEDED_BY = {"augmentation": "augmented_motions", "weights": "feasible_motions", "motors": "adapted_robot"}
"""Section of a robot's feedback -> its asset that heeds it. Training does too, but nothing here starts it."""

DATABASES = tuple(robot_plans(robot)[-1].key for robot in PROJECT.robots)

recurate = dg.define_asset_job(
    "recurate",
    selection=dg.AssetSelection.assets(*DATABASES),
    description="The expert databases of all robots with what is approved; what is not touched is not worked on.",
)


class Approval(dg.Config):
    """Who approves which proposal."""

    proposal: str
    """Digest of the proposal, from the page of curation_feedback: what was looked at is what is approved."""
    by: str
    """Who approves it."""
    policies: list[str] = []  # noqa: RUF012, pydantic copies it
    """Digests of policies: only changes that rest on logs of these alone are approved. Empty: all."""
    sections: list[str] = []  # noqa: RUF012
    """Parts of the proposal that are approved, as `weights`. Empty: all."""


class ApprovalError(PipelineError):
    """An approval of something that is not proposed."""


@dg.op(out={}, description="Write data/feedback/approved.yaml from the proposal of that digest.")
def approve(context: dg.OpExecutionContext, config: Approval):
    """Let the changes of a proposal take effect."""
    with told_plainly():
        policies, sections = tuple(config.policies), tuple(config.sections)
        count = approve_proposal(PROJECT, config.proposal, config.by, policies=policies, sections=sections)
        context.log.info(f"proposal '{config.proposal}': {count} changes approved by {config.by}")
        note_external(context.instance, PROJECT)


@dg.job(
    name="approve_feedback",
    description="Approve the pending proposal of curation_feedback by its digest; the databases are re-curated then.",
)
def approve_feedback() -> None:
    approve()


def approve_proposal(
    project: Project, proposal: str, by: str, *, policies: tuple[str, ...] = (), sections: tuple[str, ...] = ()
) -> int:
    """Write the approved changes; their number. What was approved before and is not among them is taken back.

    Raises ApprovalError where another proposal, or none, is pending.
    """
    from pipeline.feedback.approved import write_changes
    from pipeline.feedback.change import Change, Witness, check_bounds, proposal_digest
    from pipeline.feedback.rules import FeedbackRules

    stored = project.store.load(FIELD[1].key.to_user_string()).settings
    changes = tuple(
        Change(**{**each, "witnesses": tuple(Witness(**witness) for witness in each["witnesses"])})
        for _, each in sorted(stored.items())
    )
    pending = proposal_digest(changes)
    if not pending or proposal != pending:
        raise ApprovalError(
            f"proposal '{proposal}' is not pending; the page of curation_feedback shows '{pending or 'none'}'."
        )
    if not by.strip():
        raise ApprovalError("an approval needs a name: state who approves it in 'by'.")
    kept = [each for each in changes if not policies or all(one.policy in policies for one in each.witnesses)]
    kept = [each for each in kept if not sections or each.section in sections]
    if not kept:
        asked = ", ".join((*policies, *sections))
        raise ApprovalError(f"no change of proposal '{proposal}' is of {asked} alone; nothing was approved.")
    check_bounds(kept, settings.read(project.settings("feedback_rules.yaml"), FeedbackRules))
    write_changes(project.approved_feedback, kept, by=by)
    return len(kept)


def behind(instance: dg.DagsterInstance, project: Project) -> dict[dg.AssetKey, str]:
    """Databases whose stages have not heard of what is approved now, with the reason.

    A stage that was never materialized is not behind: its first run heeds what is approved then.
    """
    versions = {key: version for key, (version, _) in approved_versions(project).items()}
    late: dict[dg.AssetKey, str] = {}
    for robot in project.robots:
        plans = {plan.name: plan for plan in (*SHARED, *robot_plans(robot))}
        for section in PARTS:
            name = "selected_motions" if section in SHARED_PARTS else HEEDED_BY.get(section)
            if name is None:
                continue
            key = approved_key(section, robot)
            tags = last_tags(instance, plans[name].key)
            if (
                tags is not None
                and tags.get(INPUT_VERSION_PREFIX + key.to_user_string(), versions[key]) != versions[key]
            ):
                late[plans["expert_db"].key] = f"{key.to_user_string()} changed"
    return late


@dg.sensor(
    job=recurate,
    minimum_interval_seconds=EVERY_S,
    default_status=dg.DefaultSensorStatus.RUNNING,
    description="Re-curates the databases that have not heard of what is approved.",
)
def approved_feedback_sensor(context: dg.SensorEvaluationContext) -> dg.SensorResult | dg.SkipReason:
    """One run for each new state of what is approved."""
    try:
        state = digest.of_json({key.to_user_string(): each[0] for key, each in approved_versions(PROJECT).items()})
        late = behind(context.instance, PROJECT)
    except PipelineError as error:
        return dg.SkipReason(str(error))
    if not late:
        return dg.SkipReason("no database is behind what is approved")
    if state == context.cursor:
        return dg.SkipReason("a run was started for what is approved now")
    return dg.SensorResult(run_requests=[dg.RunRequest(asset_selection=sorted(late))], cursor=state)


@dg.schedule(
    job=recurate,
    cron_schedule="0 3 * * *",
    default_status=dg.DefaultScheduleStatus.RUNNING,
    description="Every night, if what is approved changed since a database was made.",
)
def nightly_recuration(context: dg.ScheduleEvaluationContext) -> dg.RunRequest | dg.SkipReason:
    """Skips where nothing changed."""
    try:
        late = behind(context.instance, PROJECT)
    except PipelineError as error:
        return dg.SkipReason(str(error))
    if not late:
        return dg.SkipReason("what is approved did not change since the databases were made")
    return dg.RunRequest(asset_selection=sorted(late))
