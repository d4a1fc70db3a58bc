"""`limit_cycles`: limit cycles of hip pitch and knee of the exported policy in MuJoCo, DART and the robot's logs."""

from collections.abc import Iterator
from typing import Any

import dagster as dg

from assets.freshness import TRIALS_TAG, digest_of_trials
from assets.hardware import trials_of as files_of
from assets.plan import TRIALS, Plan
from assets.policy import VERDICT, EvaluatedPolicyConfig, evaluated_policy, export_facts
from assets.report import check_result, picture, result_of, robot_asset, table_of
from pipeline.batch import Manifest
from pipeline.deployment import digest
from pipeline.hardware_logs.trial import read_trial
from pipeline.project import DEFAULT_ROBOT, PROJECT
from pipeline.validation.limit_cycles import LimitCycleSettings

AGREE = "engines_agree"


@robot_asset(
    "mujoco",
    deps=["adapted_robot", "hardware_trials"],
    checks={AGREE: "The limit cycles in MuJoCo and DART agree at the required speeds."},
)
def limit_cycles(
    context: dg.AssetExecutionContext, config: EvaluatedPolicyConfig, exported_policy: Manifest, plan: Plan
):
    """Limit cycles of the walk at the speeds of data/limit_cycles.yaml, compared between MuJoCo, DART and robot logs.

    Phase planes: hip pitch against knee [rad], and each joint's position against its velocity [rad, rad/s]. Figures:
    shape distance, offset [rad], ratios of period and amplitude.
    """
    from pipeline.validation.limit_cycle_walks import limit_cycles as find
    from pipeline.viewing.validation_plots import limit_cycle_plots

    values = PROJECT.read("limit_cycles.yaml", LimitCycleSettings)
    robot = plan.robot or DEFAULT_ROBOT
    evaluated, rules = evaluated_policy(config, exported_policy, robot)
    policy, facts = digest(evaluated.policy), export_facts(exported_policy)
    names = {policy} | ({facts["files"]["policy.npz"]} if facts["digest"] == policy else set())  # logs name either
    found = find(evaluated, trials_of(robot, names), values, rules.limit_cycles)
    required = [each for each in found if each.required]
    reasons = [reason for each in required for reason in each.reasons] if required else [NONE_REQUIRED]
    optional = [each for each in found if not each.required]
    shown = [text for each in optional for text in (f"{each.speed_m_s:g} m/s: {each.why}", *each.reasons)]
    note = rules.reference.note_on(evaluated.robot.digest)
    passed = not reasons
    verdict = {
        "stage": plan.name,
        "policy": policy,
        "robot": evaluated.robot.digest,
        "robot_of_bars": rules.reference.robot,
        "note": note or None,
        "passed": passed,
        "reasons": reasons,
        "not required": shown,
        "not run": [text for each in found for text in each.missing],
        "speeds": [each.to_dict() for each in found],
    }
    shown_note = {"note": note} if note else {}
    check = check_result(plan, AGREE, passed, "; ".join(reasons) or "within the thresholds", shown_note)
    rows = [row for each in found for row in each.rows()]
    compared = [_row(each.speed_m_s, one) for each in found for one in each.comparisons]
    metadata = {
        "passed": passed,
        **shown_note,
        "not required": "; ".join(shown) or "none",
        "not compared": "; ".join(verdict["not run"]) or "none",
        "pictures": picture(limit_cycle_plots(found)),
        **({"cycles": table_of(rows)} if rows else {}),
        **({"comparisons": table_of(compared)} if compared else {}),
    }
    return result_of(plan, {VERDICT: verdict}, metadata, [check], tags={TRIALS_TAG: digest_of_trials(PROJECT, robot)})


NONE_REQUIRED = "`limit_cycles` of the robot's validation.yaml requires no speed, so that nothing was checked"


def trials_of(robot: str, policies: set[str]) -> Iterator[Any]:
    """Yield the trials of a robot with a policy of one of these digests; none if no log was ingested."""
    if not PROJECT.store.manifest_path(TRIALS.name).is_file():
        return
    for _, path, numbers in files_of(PROJECT.store.load(TRIALS.name)):
        if numbers.get("robot") == robot and numbers.get("policy_digest") in policies:
            yield read_trial(path)


def _row(speed: float, one: Any) -> dict[str, Any]:
    return {
        "speed [m/s]": speed,
        "record": one.name,
        "compared with": one.reference,
        **{f"shape distance, {plane}": value for plane, value in one.shape_distance.items()},
        "offset [rad]": one.offset_rad,
        "period ratio": one.period_ratio,
        "hip amplitude ratio": one.hip_amplitude_ratio,
        "knee amplitude ratio": one.knee_amplitude_ratio,
    }
