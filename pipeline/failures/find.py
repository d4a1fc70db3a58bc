"""Find all failures in a trial, in temporal order."""

import dataclasses
from collections.abc import Sequence

import numpy as np

from pipeline import time_series
from pipeline.actuators.adapted_robot import JointActuator
from pipeline.failures.authority import OF_LEGS, damped_after, motor_outages, outage_excuses
from pipeline.failures.failure import DAMPED, HELD, Failure
from pipeline.failures.falls import falls, slips, stumbles
from pipeline.failures.held import excuse_at, excuse_failures, excuses
from pipeline.failures.motors import hot_motors, lost_packets, speed_saturations, torque_saturations
from pipeline.failures.settings import FailureSettings
from pipeline.failures.signals import Signals, fingerprint_of, signals_of
from pipeline.failures.tracking import delay_and_gain, steady_stretches, tracking_divergences
from pipeline.failures.trial_report import UNVERIFIED, VERIFIED, TrialReport, missed_bars, without_kind
from pipeline.hardware_logs.trial import Trial
from pipeline.robot import Robot
from pipeline.robot.size import scaled

SOON_S = 1.0
"""A robot held within this time of the trial's start is being put down; the evaluation starts after that [s]."""


def find_failures(
    trial: Trial, robot: Robot, actuators: Sequence[JointActuator], settings: FailureSettings, *, file: str = ""
) -> TrialReport:
    """Find the failures of a trial. `actuators` are the joints' calibrated motors in the robot's order.

    After the first fall only falls, hot motors and lost packets are detected. Speeds and torques in the settings are
    scaled to the robot. Raises RobotMismatchError if the trial is of another robot.
    """
    settings = scaled(settings, robot)
    signals = signals_of(trial, robot)
    outages = motor_outages(signals, actuators, settings.authority)
    lost = [each for each in outages if each.kind == "authority_loss" and each.evidence[OF_LEGS] is True]
    by_hand = excuses(signals, settings.excuse)
    excused = (*by_hand, *outage_excuses(outages))
    down = falls(signals, settings.fall, excused, settings.excuse)
    damped = damped_after(signals, down, settings.authority)
    down = [_in_damping(each, damped) for each in down]
    ends = [float(trial.time_s[-1]) + 1.0, *(each.time_s for each in (*down, *lost))]
    put_down = [each for each in by_hand if each.why == HELD and each.start_s <= SOON_S]
    until_s = min(ends + [each.start_s - settings.excuse.before_s for each in by_hand if each not in put_down])
    alone = _from(signals, max((each.stop_s + settings.excuse.after_s for each in put_down), default=0.0))
    known = bool(np.isfinite(np.asarray(trial.command, dtype=float)).any())
    found = [
        *down,
        *excuse_failures(signals, by_hand),
        *outages,
        *damped,
        *stumbles(alone, settings.stumble, until_s - 0.5 if down else until_s),
        *slips(alone, settings.slip, until_s),
        *torque_saturations(signals, actuators, settings.torque, until_s),
        *speed_saturations(signals, actuators, settings.speed, until_s),
        *(tracking_divergences(alone, settings.tracking, until_s) if known else ()),
        *hot_motors(signals, settings.heat),
        *lost_packets(signals, settings.packets),
    ]
    found = [_explained(each, signals, found, settings) for each in found]
    found = [_excused(each, excused, settings) for each in (*found, *missed_bars(signals, found, until_s))]
    found = [
        dataclasses.replace(each, command_known=bool(signals.commanded[signals.at(each.time_s)])) for each in found
    ]
    return TrialReport(
        trial=trial.name,
        file=file or trial.name,
        sha256=trial.log_digest,
        robot=trial.robot,
        policy=trial.policy_digest or "",
        simulated=trial.simulated,
        integrity=UNVERIFIED if trial.integrity == "unverified" else VERIFIED,
        seconds=trial.seconds,
        commands=_commands(alone, settings, until_s) if known else (),
        command_known=known,
        start_ns=trial.start_ns,
        whole=trial.integrity == "complete",
        fingerprint=fingerprint_of(trial),
        failures=tuple(sorted(found, key=lambda each: (each.time_s, each.kind, each.joint))),
        notes=_notes(signals, known),
    )


def _in_damping(fall: Failure, damped: Sequence[Failure]) -> Failure:
    """Mark a fall that occurs while the joints are only damped as no failure of the policy."""
    inside = any(each.time_s < fall.time_s <= each.until_s for each in damped)
    return dataclasses.replace(fall, excuse=DAMPED) if inside and not fall.excuse else fall


def _from(signals: Signals, time_s: float) -> Signals:
    """The signals with all samples before a time marked as unknown."""
    later = signals.time_s >= time_s
    return dataclasses.replace(signals, known=signals.known & later, commanded=signals.commanded & later)


def _explained(failure: Failure, signals: Signals, found: Sequence[Failure], settings: FailureSettings) -> Failure:
    """Add a weak motor or delayed targets as the probable cause of a fall without a push."""
    if failure.kind != "fall" or "cause" in failure.evidence:
        return failure
    weak = [each.joint for each in found if each.evidence.get("weaker than calibrated") is True]
    if weak:
        return dataclasses.replace(failure, evidence={**failure.evidence, "cause": "weak motor", "motor": weak[0]})
    slipped = [each for each in found if each.kind == "slip" and failure.time_s - each.until_s < settings.fall.cause_s]
    if slipped:
        return dataclasses.replace(failure, evidence={**failure.evidence, "cause": "slip"})
    start, stop = signals.at(0.5), signals.at(failure.time_s)
    if stop - start < signals.fps:
        return failure
    delay, _ = delay_and_gain(signals, settings.tracking, start, stop)
    evidence = {**failure.evidence, "delay [s]": delay}
    if delay > settings.tracking.delay_s:
        evidence["cause"] = "delay"
    return dataclasses.replace(failure, evidence=evidence)


def _excused(failure: Failure, excused: tuple, settings: FailureSettings) -> Failure:
    """Excuse failures of the gait while the robot is held or stopped."""
    if failure.excuse or failure.kind not in ("stumble", "slip", "tracking", "torque_saturation", "speed_saturation"):
        return failure
    return dataclasses.replace(failure, excuse=excuse_at(failure.time_s, excused, settings.excuse))


def _commands(
    signals: Signals, settings: FailureSettings, until_s: float
) -> tuple[tuple[float, float, float, float], ...]:
    """Steady commands and the duration of each [s]."""
    found = []
    for start, stop in steady_stretches(signals, settings.tracking, until_s):
        forward, lateral, yaw = np.round(signals.command[start], 3).tolist()
        found.append((forward, lateral, yaw, round((stop - start) / signals.fps, 3)))
    return tuple(found)


def _notes(signals: Signals, command_known: bool) -> tuple[str, ...]:
    trial = signals.trial
    notes = [*trial.notes, *without_kind(signals)]
    if not np.isfinite(np.asarray(trial.kp)).any():
        notes.append("no /joint_ctrl: what the motors were asked for is not known, saturation is not looked for")
    if not command_known:
        notes.append("the command is not known: tracking is not looked at, and failures belong to no command cell")
    unknown = sum(stop - start for start, stop in time_series.runs(~signals.known)) / signals.fps
    if unknown > 0.0:
        notes.append(f"{unknown:.2f} s are not known")
    return tuple(notes)
