"""Failure analysis of robot logs: planted failures detected, false alarms, and a weak knee transferred to the model.

    python benchmarks/failures.py [--json] [--of-each 8] [--sound 100] [--draw 0] [POLICIES]

A virtual T1 walks with a published policy (POLICIES holds `t1_walk.npz`; by default `../shared/policies` beside the
checkout). Each trial is written as MCAP and read like a robot's log. One process.
"""

from __future__ import annotations

import argparse
import dataclasses
import math
import sys
from collections import defaultdict
from pathlib import Path

import numpy as np

ROOT = Path(__file__).resolve().parent.parent
sys.path.insert(0, str(ROOT))

from benchmarks.report import Bar, machine, report  # noqa: E402
from pipeline import rotation  # noqa: E402
from pipeline.failures.failure import NOT_OF_POLICY  # noqa: E402
from pipeline.failures.find import find_failures  # noqa: E402
from pipeline.failures.trial_report import TrialReport  # noqa: E402
from pipeline.feedback.cell_weights import with_lowered_limits  # noqa: E402
from pipeline.feedback.propose import propose  # noqa: E402
from pipeline.feedback.sim_to_real import simulated  # noqa: E402
from pipeline.simulation.record import Rollout  # noqa: E402
from tests.factories.log_trials import FAILURES, nominal_actuators, trial_of  # noqa: E402
from tests.factories.trial_reports import COMMANDS, CURATION, RULES  # noqa: E402
from tests.factories.virtual_trials import Planted, fallen_knee, planted_trials, walk, walker  # noqa: E402

FOUND, FALSE = 95.0, 2.0
"""Least share of planted failures found with the right kind, and largest share of sound trials with an alarm [%]."""
KNEE_WITHIN = 5.0
"""Largest error relative to the planted limit [%]."""


def main() -> int:
    arguments = _arguments()
    if not (arguments.policies / "t1_walk.npz").is_file():
        print(
            f"{arguments.policies}: holds no 't1_walk.npz'. Logs are made by a virtual robot with a published walking "
            "policy, which is not part of the project. Name its folder: python benchmarks/failures.py FOLDER",
            file=sys.stderr,
        )
        return 2
    one = walker(arguments.policies)
    actuators = nominal_actuators(one.robot)
    right: dict[str, list[bool]] = defaultdict(list)
    knees: list[float] = []
    by_side: list[bool] = []
    for planted in planted_trials(arguments.of_each, arguments.sound, arguments.draw):
        rollout, log = walk(one, planted)
        trial = trial_of(log, one.robot, f"{planted.name} {planted.seed}".replace(" ", "_"))
        found = find_failures(trial, one.robot, actuators, FAILURES)
        right[planted.name].append(judged(planted, found))
        if planted.direction:
            by_side.append(judged(dataclasses.replace(planted, direction=true_direction(rollout)), found))
        knees += knee_errors(planted, found, one.robot.torque_limit[one.robot.joint(planted.joint or "Waist")])
        if not right[planted.name][-1] and not arguments.json:
            said = "; ".join(each.text() for each in found.failures) or "nothing"
            print(f"{planted.name} {planted.seed}, {planted.trial.command[0][1:]}: {said}", file=sys.stderr)
    sound = right.pop("sound")
    every = [each for values in right.values() for each in values]
    bars = [
        Bar(name=f"found: {name}, of {len(values)}", value=_percent(values), unit="%") for name, values in right.items()
    ]
    bars.append(
        Bar(name=f"falls of {len(by_side)} told to the side of the simulation", value=_percent(by_side), unit="%")
    )
    bars.append(Bar(name="found with the right kind, all", value=_percent(every), unit="%", sense=">=", bound=FOUND))
    false = 100.0 - _percent(sound)
    bars.append(Bar(name=f"false alarms, {len(sound)} sound", value=false, unit="%", sense="<=", bound=FALSE))
    worst = max(knees, default=math.nan)
    bars.append(Bar(name="knee limit, worst error", value=worst, unit="%", sense="<=", bound=KNEE_WITHIN))
    return 0 if report([*bars, *model_bars(one, actuators)], machine=machine(), json=arguments.json) else 1


def true_direction(rollout: Rollout) -> str:
    """Direction in which the simulated trunk fell, in its heading one second before; empty without a fall."""
    if rollout.fell_s is None:
        return ""
    fallen = min(round((rollout.fell_s - rollout.start_s) / rollout.timestep_s), len(rollout.qpos) - 1)
    before = max(fallen - round(1.0 / rollout.timestep_s), 0)
    up_w = rotation.rotate(rollout.qpos[fallen, 3:7], np.array([0.0, 0.0, 1.0]))
    heading = float(rotation.yaw_of(rollout.qpos[before, 3:7]))
    ahead = up_w[0] * np.cos(heading) + up_w[1] * np.sin(heading)
    aside = up_w[1] * np.cos(heading) - up_w[0] * np.sin(heading)
    if abs(ahead) >= abs(aside):
        return "forward" if ahead > 0.0 else "backward"
    return "left" if aside > 0.0 else "right"


def judged(planted: Planted, found: TrialReport) -> bool:
    """Whether the planted failure was found and attributed to the policy; for a sound trial, whether none was found."""
    if planted.kind == "sound":
        return not found.failures
    alike = [
        each
        for each in found.failures
        if each.kind == planted.kind and planted.joint in ("", each.joint) and planted.direction in ("", each.direction)
    ]
    if planted.kind in NOT_OF_POLICY:
        return bool(alike) and not any(each.kind == "fall" and each.of_policy for each in found.failures)
    return any(each.of_policy for each in alike)


def knee_errors(planted: Planted, found: TrialReport, limit: float) -> list[float]:
    """Error of the estimated limit of a weak knee [%]."""
    given = [
        float(each.evidence["given_n_m"])
        for each in found.failures
        if planted.kind == each.kind == "torque_saturation" and each.joint == planted.joint
    ]
    return [100.0 * abs(value / (planted.value * limit) - 1.0) for value in given]


def model_bars(one, actuators) -> list[Bar]:
    """A knee so weak that the robot falls: found in two logs, proposed, and the adapted model falls too."""
    plants = [fallen_knee(forward) for forward in (1.5, 1.9)]
    trials = [trial_of(walk(one, each)[1], one.robot, f"knee_{each.seed}") for each in plants]
    reports = [find_failures(trial, one.robot, actuators, FAILURES) for trial in trials]
    changes = propose(reports, RULES, COMMANDS, CURATION.windows.bounds).changes
    motors = [change for change in changes if change.section == "motors"]
    planted = plants[0].value * one.robot.torque_limit[one.robot.joint(plants[0].joint)]
    proposed = [change.value for change in motors if change.what == plants[0].joint]
    error = 100.0 * abs(proposed[0] / planted - 1.0) if proposed else float("nan")
    adapted = with_lowered_limits(actuators, motors)
    fell = [simulated(trial, one.robot, adapted, one.policy, trial.seconds).fell for trial in trials]
    stood = [not simulated(trial, one.robot, actuators, one.policy, trial.seconds).fell for trial in trials]
    return [
        Bar(name="weak knee proposed, error", value=error, unit="%", sense="<=", bound=KNEE_WITHIN),
        Bar(name="adapted model falls as the robot did", value=_percent(fell), unit="%", sense=">=", bound=100.0),
        Bar(name="nominal model does not", value=_percent(stood), unit="%", sense=">=", bound=100.0),
    ]


def _percent(values: list[bool]) -> float:
    return 100.0 * float(np.mean(values)) if values else float("nan")


def _arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("policies", nargs="?", type=Path, default=ROOT.parent / "shared" / "policies")
    parser.add_argument("--of-each", type=int, default=8, help="trials of each planted kind")
    parser.add_argument("--sound", type=int, default=100, help="sound trials")
    parser.add_argument("--draw", type=int, default=0, help="another number draws other trials")
    parser.add_argument("--json", action="store_true")
    return parser.parse_args()


if __name__ == "__main__":
    sys.exit(main())
