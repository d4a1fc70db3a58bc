"""Failures of each hardware trial, and its simulated twin if its policy is available; results are cached."""

from pathlib import Path
from typing import Any

import dagster as dg

from assets.hardware import trials_of
from assets.plan import FIELD, Plan, robot_plans
from assets.report import as_failure, asset_of, check_result, result_of, table_of
from pipeline.actuators.adapted_robot import adapt
from pipeline.actuators.calibrate import Calibration
from pipeline.actuators.settings import ActuatorSettings
from pipeline.batch import Manifest
from pipeline.deployment import find_policy, load_policy
from pipeline.errors import PipelineError
from pipeline.failures.failure import NOT_OF_POLICY
from pipeline.failures.find import find_failures
from pipeline.failures.settings import FailureSettings
from pipeline.failures.trial_report import NOTED, TrialReport
from pipeline.feedback.sim_to_real import twin_of, with_cycle_failures
from pipeline.files import digest, settings
from pipeline.files.shown_text import markdown_list
from pipeline.hardware_logs import read_trial
from pipeline.project import PROJECT

FAILURES = FIELD[0]
EVALUATED = "every_trial_looked_at"
KEPT = ("report", "twin", "unread")
"""Keys of a trial's result that the manifest stores."""


def _calibrations() -> dict[str, Plan]:
    """Each robot's motor calibration from bench measurements; feedback from logs does not change it."""
    return {robot: robot_plans(robot)["actuator_calibration"] for robot in PROJECT.robots}


@asset_of(
    FAILURES,
    "numpy",
    deps=[plan.key for plan in _calibrations().values()],
    checks={EVALUATED: "Every trial was evaluated: its robot is in robots/ and its file is readable."},
)
def failure_modes(context: dg.AssetExecutionContext, hardware_trials: Manifest):
    """Failures in each hardware trial: kind, time, command, evidence, confidence, and whether the policy caused it."""
    found = {name: _findings(name, path, numbers) for name, path, numbers in trials_of(hardware_trials)}
    unread = [f"{name}: {each['unread']}" for name, each in found.items() if "unread" in each]
    manifest = Manifest(
        stage=FAILURES.name,
        entries=(),
        judged=(),
        settings={name: {key: each[key] for key in KEPT if key in each} for name, each in found.items()},
        recomputed=sum(each.get("new", False) for each in found.values()),
    )
    context.log.info(f"{len(found)} trials, {manifest.recomputed} evaluated again")
    check = check_result(FAILURES, EVALUATED, not unread, "; ".join(unread) or f"{len(found)} trials")
    faults = sum(each.get("fault", False) for each in found.values())
    return result_of(FAILURES, manifest, _failure_metadata(manifest), [check], faults=faults)


def _findings(name: str, path: Path, numbers: dict[str, Any]) -> dict[str, Any]:
    """Findings on a trial. A fault of one trial does not stop the others.

    Unreadable settings or robots, and a store that can't be read or written, stop the run: the log is not at fault.
    """
    try:
        return _cached_findings(name, path, numbers)
    except dg.DagsterUserCodeExecutionError:
        raise
    except PipelineError as error:
        return {"unread": str(error)}
    except Exception as error:  # a fault of the program; the next run tries again
        return {"unread": f"its evaluation failed with {type(error).__name__}: {error}", "fault": True}


def _cached_findings(name: str, path: Path, numbers: dict[str, Any]) -> dict[str, Any]:
    """Report of a trial, and its simulated twin if its policy is available, cached by the digest of all inputs."""
    robot = str(numbers["robot"])
    if robot not in PROJECT.robots:
        return {"unread": f"there is no folder robots/{robot}"}
    with as_failure():
        values = PROJECT.read("failures.yaml", FailureSettings)
        limits = PROJECT.read("actuators.yaml", ActuatorSettings)
        calibration = PROJECT.store.load(_calibrations()[robot].key.to_user_string())
        nominal = PROJECT.robot(robot)
    policy = find_policy(PROJECT.policy_files(robot), numbers.get("policy_digest") or "")
    inputs = [
        *("looked at", FAILURES.code_version(), settings.plain(values), calibration.digest, nominal.digest),
        *(name, digest.of_file(path), digest.of_file(policy) if policy else ""),
    ]
    key = digest.of_json(inputs)
    with as_failure():
        known = PROJECT.store.recall(key, FAILURES.name)
    if known is None:
        calibrations = [Calibration.from_dict(each) for each in calibration.settings.values()]
        known = {
            "pieces": [],
            **_evaluate(path, numbers, nominal, adapt(nominal, calibrations, limits), policy, values),
        }
        with as_failure():
            PROJECT.store.remember(key, known, FAILURES.name)
        return {**known, "new": True}
    return known


def _evaluate(
    path: Path, numbers: dict[str, Any], robot: Any, actuators: Any, policy: Path | None, values: Any
) -> dict:
    trial = read_trial(path)
    report = find_failures(trial, robot, actuators, values, file=str(numbers.get("log", trial.name)))
    ends = [each.time_s for each in report.failures if each.kind in ("fall", *NOT_OF_POLICY)]
    twin = None
    if policy is not None:
        twin = twin_of(trial, robot, actuators, load_policy(policy), values, min(ends, default=trial.seconds))
    report = with_cycle_failures(report, twin, values)
    return {"report": settings.plain(report), "twin": settings.plain(twin)}


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
                    "cause, if not the policy": each.excuse,
                    "simulated": report.simulated,
                    "missed threshold": each.evidence.get("bar", ""),
                    "text": each.text(),
                }
            )
    noted = [(report, each.removeprefix(f"{NOTED}: ")) for report in reports for each in report.notes if NOTED in each]
    return {
        "trials": len(reports),
        "trials evaluated again": manifest.recomputed,
        "failures": len(rows),
        "failures of the policy": sum(each.of_policy for report in reports for each in report.failures),
        **{f"failures: {kind}": count for kind, count in sorted(kinds.items())},
        "dagster/row_count": len(rows),
        "failures of all trials": table_of(rows),
        NOTED: dg.MetadataValue.md(markdown_list(f"{report.trial}: {note}" for report, note in noted)),
    }


def reports_of(manifest: Manifest) -> list[Any]:
    """The reports in the result of `failure_modes`."""
    return [TrialReport.from_dict(each["report"]) for _, each in sorted(manifest.settings.items()) if "report" in each]
