"""`limit_cycles`: hip pitch and knee of the exported policy's walk in MuJoCo, in DART and in the logs of a robot."""

from collections.abc import Iterator
from typing import Any

import dagster as dg

from assets.hardware import trials_of as files_of
from assets.plan import TRIALS, WALKS_TAG, Plan, digest_of_walks
from assets.policy import VERDICT, EvaluatedPolicyConfig, evaluated_policy, served
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
    checks={AGREE: "MuJoCo and DART walk alike at the required speeds."},
)
def limit_cycles(
    context: dg.AssetExecutionContext, config: EvaluatedPolicyConfig, exported_policy: Manifest, plan: Plan
):
    """Hip pitch against knee, and each against its speed, at .6 and 2.0 m/s: shape distance, period, amplitude."""
    from pipeline.validation.limit_cycle_walks import limit_cycles as find
    from pipeline.viewing.validation_plots import limit_cycle_plots

    values = PROJECT.read("limit_cycles.yaml", LimitCycleSettings)
    robot = plan.robot or DEFAULT_ROBOT
    judged, rules = evaluated_policy(config, exported_policy, robot)
    policy, facts = digest(judged.policy), served(exported_policy)
    names = {policy} | ({facts["files"]["policy.npz"]} if facts["digest"] == policy else set())  # logs name either
    found = find(judged, trials_of(robot, names), values, rules.limit_cycles)
    required = [each for each in found if each.required]
    reasons = [reason for each in required for reason in each.reasons] if required else [NONE_REQUIRED]
    spared = [each for each in found if not each.required]
    shown = [text for each in spared for text in (f"{each.speed_m_s:g} m/s: {each.why}", *each.reasons)]
    note = rules.reference.note_on(judged.robot.digest)
    passed = not reasons
    verdict = {
        "stage": plan.name,
        "policy": policy,
        "robot": judged.robot.digest,
        "robot_of_bars": rules.reference.robot,
        "note": note or None,
        "passed": passed,
        "reasons": reasons,
        "not required": shown,
        "not run": [text for each in found for text in each.missing],
        "speeds": [each.to_dict() for each in found],
    }
    shown_note = {"note": note} if note else {}
    check = check_result(plan, AGREE, passed, "; ".join(reasons) or "within the bars", shown_note)
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
    return result_of(plan, {VERDICT: verdict}, metadata, [check], tags={WALKS_TAG: digest_of_walks(PROJECT, robot)})


NONE_REQUIRED = "no speed is required by `limit_cycles` of the robot's validation.yaml: nothing was shown"


def trials_of(robot: str, policies: set[str]) -> Iterator[Any]:
    """The trials of a robot that a policy of these digests walked; none where no log was read."""
    if not PROJECT.store.manifest_path(TRIALS.name).is_file():
        return
    for _, path, numbers in files_of(PROJECT.store.load(TRIALS.name)):
        if numbers.get("robot") == robot and numbers.get("policy_digest") in policies:
            yield read_trial(path)


def _row(speed: float, one: Any) -> dict[str, Any]:
    return {
        "speed [m/s]": speed,
        "record": one.name,
        "against": one.reference,
        **{f"shape distance, {plane}": value for plane, value in one.shape_distance.items()},
        "offset [rad]": one.offset_rad,
        "period, times": one.period_ratio,
        "hip amplitude, times": one.hip_amplitude_ratio,
        "knee amplitude, times": one.knee_amplitude_ratio,
    }
