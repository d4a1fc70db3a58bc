"""Unresponsive motors, and joints that are only damped after a fall; neither is a failure of the policy.

A motor is responsive if it produces a large share of the torque that its controller commands, kp (target - position) -
kd velocity, and unresponsive if it produces almost none. An outage between two responses is a flicker of the motor's
enable signal if it is short, and a loss of authority if it is longer and the joint is far from its target.
"""

from collections.abc import Sequence

import numpy as np

from pipeline import time_series
from pipeline.actuators.adapted_robot import JointActuator
from pipeline.failures.failure import DAMPED, MOTORS_OFF, Failure
from pipeline.failures.held import Excuse
from pipeline.failures.motors import asked_torque
from pipeline.failures.settings import AuthoritySettings
from pipeline.failures.signals import Signals
from pipeline.robot import Robot

DEAD_OF_FLICKER = 0.4
"""Share of the shortest outage in which torque must be commanded and none produced."""
FAR_S = 0.1
"""Least time that a joint is far from its target in a loss of authority [s]."""
USUAL_PERCENTILE = 95.0
"""Percentile of the stiffness torque before the fall that is its usual value; a standing robot needs little torque."""
OF_LEGS = "of the legs"
"""Key of the evidence: whether a leg joint is affected."""
TOGETHER_S = 0.1
"""Time within which outages of several joints must begin to be merged [s]."""


def motor_outages(signals: Signals, actuators: Sequence[JointActuator], settings: AuthoritySettings) -> list[Failure]:
    """Stretches with almost no motor torque, as `motor_flicker` or `authority_loss`; simultaneous outages are merged.
    Empty if the log has no joint commands."""
    trial = signals.trial
    asked = asked_torque(signals)
    error = np.abs(np.asarray(trial.target_pos, dtype=float) - trial.joint_pos)
    given = np.abs(np.asarray(trial.torque_est, dtype=float))
    found: list[tuple[int, int, int, bool]] = []
    for joint, actuator in enumerate(actuators):
        limit = actuator.box_effort_limit
        wanted = np.where(trial.measured, np.nan_to_num(np.abs(asked[:, joint])), 0.0)
        has_to_answer = wanted > max(settings.asked_over * limit, settings.least_torque)
        dead = has_to_answer & (given[:, joint] < settings.dead_share * np.minimum(wanted, limit))
        alive = has_to_answer & (given[:, joint] > settings.alive_share * np.minimum(wanted, limit))
        for start, stop in _between(dead, alive):
            seconds = (stop - start) / trial.rate_hz
            dead_s = float(dead[start:stop].sum() / trial.rate_hz)
            far = (error[start:stop, joint] > settings.error_rad) & dead[start:stop]
            if min(seconds, dead_s / DEAD_OF_FLICKER) < settings.flicker_s[0]:
                continue
            if seconds <= settings.flicker_s[1] and alive[stop:].any():
                found.append((start, stop, joint, False))
            elif far.sum() > FAR_S * trial.rate_hz:  # for long, or until the command ended
                found.append((start, stop, joint, True))
    return [_failure(signals, group, asked, error) for group in _together(found, trial.rate_hz)]


def outage_excuses(outages: Sequence[Failure]) -> list[Excuse]:
    """Excuses for the time of outages of leg motors and just after; outages of arm motors are no excuse."""
    return [
        Excuse(start_s=each.time_s, stop_s=each.until_s, why=MOTORS_OFF, evidence={})
        for each in outages
        if each.evidence[OF_LEGS] is True
    ]


def leg_joints(robot: Robot) -> frozenset[int]:
    """Indices of the joints between the root and the feet."""
    feet = (int(robot.tree.site_link[robot.site(foot)]) for foot in robot.feet)
    return frozenset(int(robot.tree.joint[link]) for foot in feet for link in robot.tree.chain(foot))


def damped_after(signals: Signals, falls: Sequence[Failure], settings: AuthoritySettings) -> list[Failure]:
    """The interval after each fall in which joints are only damped, i.e. the stiffness torque is about zero."""
    trial = signals.trial
    stiff = np.abs(trial.kp * (np.asarray(trial.target_pos, dtype=float) - trial.joint_pos)).sum(axis=1)
    known = np.isfinite(stiff)
    if not known.any() or not falls:
        return []
    down = int(np.searchsorted(trial.time_s, falls[0].until_s))
    before = stiff[:down][known[:down]]
    usual = float(np.percentile(before if len(before) else stiff[known], USUAL_PERCENTILE))
    limp = known & (stiff < settings.damped_share * usual)
    least = settings.damped_s * trial.rate_hz
    long_ones = [(start, stop) for start, stop in time_series.runs(limp) if stop - start >= least]
    found = []
    for fall, until_s in zip(falls, [*(each.time_s for each in falls[1:]), np.inf], strict=True):
        own = [run for run in long_ones if fall.time_s <= trial.time_s[run[0]] < until_s]
        if own:
            inside = np.concatenate([stiff[start:stop] for start, stop in own])
            begins, ends = float(trial.time_s[own[0][0]]), float(trial.time_s[own[-1][1] - 1])
            share = float(inside.mean() / max(usual, 1e-9))
            evidence = {"torque by stiffness over the usual": share, "seconds": ends - begins}
            found.append(signals.failure("damped", begins, ends, confidence=0.95, excuse=DAMPED, evidence=evidence))
    return found


def _between(dead: np.ndarray, alive: np.ndarray) -> list[tuple[int, int]]:
    """Stretches from the first to the last unresponsive sample without a response in between."""
    found = []
    edges = [-1, *np.flatnonzero(alive).tolist(), len(dead)]
    without = np.flatnonzero(dead)
    place = np.searchsorted(edges, without)
    for edge in np.unique(place):
        inside = without[place == edge]
        found.append((int(inside[0]), int(inside[-1]) + 1))
    return found


def _together(found: list[tuple[int, int, int, bool]], rate_hz: float) -> list[list[tuple[int, int, int, bool]]]:
    """Group outages of one kind that begin at about the same time."""
    groups: list[list[tuple[int, int, int, bool]]] = []
    for each in sorted(found, key=lambda one: (one[3], one[0])):
        last = groups[-1] if groups else None
        if last and last[0][3] == each[3] and each[0] - last[-1][0] <= TOGETHER_S * rate_hz:
            last.append(each)
        else:
            groups.append([each])
    return groups


def _failure(
    signals: Signals, group: list[tuple[int, int, int, bool]], asked: np.ndarray, error: np.ndarray
) -> Failure:
    trial = signals.trial
    start, stop = min(each[0] for each in group), max(each[1] for each in group)
    joints = [each[2] for each in group]
    inside = (slice(start, stop), joints)
    return signals.failure(
        "authority_loss" if group[0][3] else "motor_flicker",
        trial.time_s[start],
        trial.time_s[stop - 1],
        joint=trial.joint_names[joints[0]] if len(joints) == 1 else "",
        confidence=0.9,
        excuse=MOTORS_OFF,
        evidence={
            "seconds": (stop - start) / trial.rate_hz,
            "joints": len(joints),
            OF_LEGS: any(joint in leg_joints(signals.robot) for joint in joints),
            "asked [N m]": float(np.nanmax(np.abs(asked[inside]))),
            "given [N m]": float(np.nanmedian(np.abs(np.asarray(trial.torque_est, dtype=float)[inside]))),
            "from the target [rad]": float(np.nanmax(error[inside])),
        },
    )
