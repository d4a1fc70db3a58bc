"""Motor identification of one robot: bench measurements, the calibration of each motor, the adapted robot model."""

import dataclasses
from typing import Any

import dagster as dg

from assets.approved import approval_metadata, approved_part
from assets.plan import Plan, external
from assets.report import check_result, picture, result_of, robot_asset, table_of
from pipeline.actuators.adapted_robot import adapt, torque_envelope, write_adapted_robot
from pipeline.actuators.calibrate import Calibration
from pipeline.actuators.folder import calibrate_folder, read_published
from pipeline.actuators.settings import ActuatorSettings
from pipeline.actuators.standing import read_standing_pose, stand
from pipeline.batch import Manifest
from pipeline.feedback.cell_weights import check_limits, with_lowered_limits
from pipeline.feedback.rules import FeedbackRules
from pipeline.files import digest, settings
from pipeline.project import DEFAULT_ROBOT, PROJECT, Project
from pipeline.robot_check.agreement import models_agree

MEASUREMENTS = "actuator_measurements"
CALIBRATED = "every_motor_calibrated"
AGREE = "adapted_models_agree"
MODELS_AGREE = "MJCF and URDF compile and have the same mass and joints."
STANDS = "adapted_robot_stands"
MAX_TILT_DEG = 1.0
"""Largest tilt of the adapted robot in its standing pose over 10 s."""


def measurements_version(project: Project, robot: str) -> tuple[str, dict[str, Any]]:
    """Digest and number of the robot's measurement files. Without a folder: the digest of no files, and 0."""
    files = sorted(project.actuators(robot).glob("*.csv"))
    return digest.of_files(files, project.actuators(robot)), {"files": len(files)}


def actuator_measurements(robot: str) -> dg.AssetSpec:
    """The folder `data/actuators/<robot>`, versioned by content."""
    what = f"Torque-speed sweeps and the motor table in data/actuators/{robot}, versioned by content."
    return external(MEASUREMENTS, robot, what)


@robot_asset(
    "scipy", deps=[MEASUREMENTS], checks={CALIBRATED: "The calibration of each motor in the motor table is accepted."}
)
def actuator_calibration(context: dg.AssetExecutionContext, plan: Plan):
    """Calibration of each motor, or why it is refused.

    Knee of the torque-speed curve with a 95 % confidence interval, no-load speed [rad/s], stall torque [N m], armature
    [kg m^2].
    """
    values = PROJECT.read("actuators.yaml", ActuatorSettings)
    folder = PROJECT.actuators(plan.robot or DEFAULT_ROBOT)
    found = calibrate_folder(folder, values, plan.code_version(), PROJECT.store)
    context.log.info(f"{len(found.motors)} motors, calibrated again: {', '.join(found.recomputed) or 'none'}")
    by_motor = {each.motor: settings.plain(each) for each in found.calibrations}
    manifest = Manifest(stage=plan.name, entries=(), judged=(), settings=by_motor, recomputed=len(found.recomputed))
    refused = [f"{each.motor} {each.verdict}" for each in found.calibrations if not each.accepted]
    check = check_result(plan, CALIBRATED, not refused, "; ".join(refused) or f"{len(found.calibrations)} motors")
    metadata = {**_calibration_metadata(found, folder), "motors recomputed": ", ".join(found.recomputed) or "none"}
    return result_of(plan, manifest, metadata, [check])


def _calibration_metadata(found: Any, folder: Any) -> dict[str, Any]:
    from pipeline.viewing.plots import calibration_curves

    curves = read_published(folder)
    models = {motor.name: motor.model for motor in found.motors}
    published = {name: curves[model] for name, model in models.items() if model in curves}
    metadata: dict[str, Any] = {
        "motors": len(found.motors),
        "motors refused": sum(not each.accepted for each in found.calibrations),
        "synthetic": any(each.synthetic for each in found.calibrations),
        "files that belong to no motor": ", ".join(found.unused) or "none",
    }
    if found.calibrations:
        metadata["calibration"] = table_of([_row(each, published.get(each.motor)) for each in found.calibrations])
        metadata["curves"] = picture(calibration_curves(found.calibrations, published))
    return metadata


def _row(each: Any, published: Any) -> dict[str, Any]:
    knee = each.knee
    row = {"motor": each.motor, "joints": ", ".join(each.joints), "verdict": each.verdict}
    if knee is not None:
        row |= {
            "knee torque [N m]": _with_interval(knee.torque),
            "knee speed [rad/s]": _with_interval(knee.speed),
            "no-load speed [rad/s]": round(knee.no_load_speed, 3),
            "stall torque [N m]": round(knee.stall_torque, 3),
            "noise": round(knee.noise, 4),
            "outliers": knee.outliers,
        }
        if published is not None:
            row["published peak torque at the knee speed [N m]"] = round(published.torque(knee.speed.value), 2)
            row["exceeds the published peak"] = knee.torque.low > published.torque(knee.speed.value)
    return row | {"armature [kg m^2]": each.armature, "notes": "; ".join(each.notes)}


def _with_interval(interval: Any) -> str:
    return f"{interval.value:.3f} ({interval.low:.3f} to {interval.high:.3f})"


@robot_asset(
    "mujoco",
    deps=["approved_limits"],
    checks={STANDS: f"Under PD control it stands for 10 s and tilts less than {MAX_TILT_DEG:g}°."},
    blocking={AGREE: MODELS_AGREE},
)
def adapted_robot(actuator_calibration: Manifest, robot_model: Manifest, plan: Plan):
    """Robot model with calibrated motors: MJCF, URDF, actuator table, and the changes from the nominal model."""
    name = plan.robot or DEFAULT_ROBOT
    nominal, folder = PROJECT.robot(name), PROJECT.adapted_robot(name)
    values = PROJECT.read("actuators.yaml", ActuatorSettings)
    calibrations = [Calibration.from_dict(each) for each in actuator_calibration.settings.values()]
    feedback = approved_part(PROJECT, "motors", plan.robot)
    calibrated = adapt(nominal, calibrations, values)
    if feedback:
        rules = PROJECT.read("feedback_rules.yaml", FeedbackRules)
        check_limits(calibrated, feedback, rules.motors.lowest)
    actuators = with_lowered_limits(calibrated, feedback)
    robot = write_adapted_robot(folder, PROJECT.robot_folder(name), actuators)
    files = {path.name: digest.of_file(path) for path in sorted(folder.iterdir())}
    facts = {"stage": plan.name, "robot": name, "digest": robot.digest, "files": files}
    facts |= {"feedback": settings.plain(feedback)} if feedback else {}
    check = check_result(plan, AGREE, *models_agree(robot), warn=False)
    metadata, standing = _standing(plan, robot, actuators)
    metadata |= {
        **_difference(actuators),
        **approval_metadata(feedback),
        "dagster/uri": dg.MetadataValue.path(str(folder)),
    }
    return result_of(plan, {robot.digest: facts}, metadata, [check, standing])


def _standing(plan: Plan, robot: Any, actuators: Any) -> tuple[dict[str, Any], dg.AssetCheckResult]:
    """Simulate standing under PD control with each set of armatures: the metadata, and the check's result."""
    pose = read_standing_pose(PROJECT.robot_folder(plan.robot or DEFAULT_ROBOT), robot)
    if pose is None:
        check = check_result(plan, STANDS, True, "not tried: the robot's folder has no standing.csv", warn=False)
        return {"standing": "not tried: the robot's folder has no standing.csv"}, check
    armatures = {
        "adapted": robot.armature,
        "no armature": 0.0 * robot.armature,
        "armature of the manufacturer's MJCF": pose.vendor_armature,
    }
    stood = {name: stand(robot, pose, torque_envelope(actuators), each) for name, each in armatures.items()}
    rows = [{"model": name, **dataclasses.asdict(each)} for name, each in stood.items()]
    ours = stood["adapted"]
    found = f"{'fell after' if ours.fell else 'stood'} {ours.seconds:.1f} s, tilt {ours.tilt_deg:.2f}°"
    check = check_result(plan, STANDS, not ours.fell and ours.tilt_deg < MAX_TILT_DEG, found)
    return {"standing": table_of(rows)}, check


def _difference(actuators: Any) -> dict[str, Any]:
    from pipeline.actuators.adapted_robot import motors_source

    changed = [each.joint for each in actuators if each.changed]
    return {
        "motor limits": motors_source(actuators),
        "actuators": table_of([vars(each) for each in actuators]),
        "joints changed": ", ".join(changed) or "none",
        "verdict": "; ".join(sorted({each.verdict for each in actuators})),
    }
