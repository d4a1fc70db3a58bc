"""`webots_validation`: a Webots project of the robot and its policy, in Webots and in its stand-ins."""

from typing import Any

import dagster as dg

from assets.plan import Plan
from assets.policy import VERDICT, EvaluatedPolicyConfig, evaluated_policy
from assets.project import DEFAULT_ROBOT, PROJECT
from assets.report import asset_of, check_result, result_of, table_of
from pipeline.batch import Manifest
from pipeline.deployment import digest
from pipeline.files import settings
from pipeline.robot.load import read_description
from pipeline.webots.project import write_project
from pipeline.webots.result import WebotsSettings
from pipeline.webots.validate import WEBOTS, project_faults, validate

IS_THE_ROBOT = "project_is_the_robot"
WALKS = "walks_in_webots"


def webots_validation(plan: Plan, exported: Plan, adapted: Plan) -> Any:
    """The asset `webots_validation` of a robot."""

    @asset_of(
        plan,
        "webots",
        inputs={"exported_policy": exported},
        deps=[adapted.key],
        checks={WALKS: "The walk of data/webots.yaml in Webots itself."},
        blocking={IS_THE_ROBOT: "PROTO and world have the robot's numbers."},
    )
    def webots_validation(context: dg.AssetExecutionContext, config: EvaluatedPolicyConfig, exported_policy: Manifest):
        """PROTO, world and controller of the robot; their walk in Webots, where it is there, and in stand-ins."""
        from pipeline.validation.derived_bars import allowed_of

        values = settings.read(PROJECT.settings("webots.yaml"), WebotsSettings)
        robot = plan.robot or DEFAULT_ROBOT
        judged, rules = evaluated_policy(config, exported_policy, robot)
        folder, source = PROJECT.data / "webots" / robot, read_description(PROJECT.adapted_robot(robot))
        project = write_project(folder, source, judged.task, judged.envelope, judged.policy, values)
        faults = project_faults(project.world, judged.robot)
        verdicts = validate(project, values, allowed_of(rules.webots))
        note = rules.reference.note_on(judged.robot.digest)
        stored = {**stored_verdict(plan.name, digest(judged.policy), verdicts, WEBOTS), "note": note or None}
        statuses = {each.engine: each.status for each in verdicts.values()}
        for engine, status in statuses.items():
            context.log.info(f"{engine}: {status}")
        metadata = {
            **statuses,
            **({"note": note} if note else {}),
            "dagster/uri": dg.MetadataValue.path(str(project.folder)),
            "segments": table_of(_rows(verdicts)),
        }
        return result_of(plan, {VERDICT: stored}, metadata, _checks(plan, faults, verdicts[WEBOTS]))

    return webots_validation


def stored_verdict(stage: str, policy: str, verdicts: dict[str, Any], webots: str) -> dict[str, Any]:
    """What the manifest keeps: passed, failed, or null and why there is no verdict: the program is missing or failed to
    run. A stand-in has its own name; one that failed to run is listed too."""
    own = verdicts[webots]
    others = {name: each.to_dict() for name, each in verdicts.items() if name != webots}
    return {
        "stage": stage,
        "policy": policy,
        "passed": own.status == "passed" if own.judged else None,
        "reasons": list(own.reasons),
        "not_run": [] if own.judged or own.failed_to_run else [own.status],
        "failed_to_run": [
            each.status if name == webots else f"{name}: {each.status}"
            for name, each in verdicts.items()
            if each.failed_to_run
        ],
        "webots": own.to_dict(),
        **{name: each["status"] for name, each in others.items()},
        "stand_ins": others,
    }


def _checks(plan: Plan, faults: tuple[str, ...], webots: Any) -> list[dg.AssetCheckResult]:
    found = "; ".join(webots.reasons) or webots.status
    compared = "; ".join(faults) or "motors, limits, masses, inertias, poses, sensors, contacts"
    return [
        check_result(plan, IS_THE_ROBOT, not faults, compared, warn=False),
        check_result(plan, WALKS, webots.status == "passed", found, warn=not webots.failed_to_run),
    ]


def _rows(verdicts: dict[str, Any]) -> list[dict[str, Any]]:
    return [
        {"engine": each["engine"], "status": each["status"], **segment}
        for each in (verdict.to_dict() for verdict in verdicts.values())
        for segment in ((each["result"] or {}).get("segments") or [{}])
    ]
