"""What every clip stage does around its pure function: the stage's versions in, the result with its evidence out."""

from collections.abc import Callable, Mapping
from typing import Any

import dagster as dg

from assets.approved import approved_key
from assets.checks import evaluate
from assets.curator_link import curator_link
from assets.groups import group_of
from assets.plan import FAULTS_TAG, FINGERPRINT_TAG, Plan, digest_of_robot
from assets.project import PROJECT
from pipeline.batch import Manifest, Stage
from pipeline.files import settings


def stage_of(
    plan: Plan,
    function: Callable[..., Any],
    values: Any,
    *,
    prepare: Callable[..., Any] | None = None,
    name: str = "",
    robot_files: str | None = None,
) -> Stage:
    """The stage of an asset with its settings `values` (a settings dataclass, or None).

    `name` is for a second question that the asset asks of its clips; `robot_files` is the digest of the robot where it
    is not the one of the robot's folder.
    """
    if plan.robot and robot_files is None:
        robot_files = digest_of_robot(PROJECT, plan.robot)
    return Stage(
        name=name or plan.name,
        version=plan.code_version(),
        function=function,
        prepare=prepare,
        settings=settings.plain(values) if values is not None else {},
        depends={"robot_files": robot_files} if robot_files else {},
    )


def materialized(plan: Plan, manifest: Manifest, metadata: Mapping[str, Any]) -> dg.MaterializeResult:
    """The result Dagster notes: content as data version, what it depended on as a tag, checks; tables come last."""
    link = curator_link(f"?stage={plan.name}") if manifest.judged else {}
    return dg.MaterializeResult(
        asset_key=plan.key,
        value=manifest,
        metadata=dict(
            sorted({**metadata, **link}.items(), key=lambda item: isinstance(item[1], dg.TableMetadataValue))
        ),
        check_results=evaluate(plan, manifest),
        data_version=dg.DataVersion(manifest.digest),
        tags={
            FINGERPRINT_TAG: plan.fingerprint(PROJECT),
            FAULTS_TAG: str(manifest.reason_counts("rejected")["failed"]),
        },
    )


def declared_motions(
    plan: Plan, kind: str, kp: str = "", inputs: dict[str, Any] | None = None, feedback: str = ""
) -> dict[str, Any]:
    """What all motion assets of a robot declare alike.

    `feedback` is the section of the approved feedback that the asset applies.
    """
    return {
        "key": plan.key,
        "ins": inputs or {},
        "deps": [approved_key(feedback, plan.robot)] if feedback else [],
        "group_name": group_of(plan.name, plan.robot),
        "kinds": {kind},
        "tags": {"robot": plan.robot or "", **({"kp": kp} if kp else {})},
        "code_version": plan.code_version(),
    }


def inputs_of(**plans: Plan) -> dict[str, dg.AssetIn]:
    """Inputs by argument name."""
    return {name: dg.AssetIn(plan.key) for name, plan in plans.items()}
