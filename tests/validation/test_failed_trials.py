"""Failures written as logs, read back by what reads the robot's own."""

import dataclasses
from pathlib import Path

import numpy as np
import pytest

from pipeline.deployment import digest
from pipeline.failures.find import find_failures
from pipeline.files import settings
from pipeline.hardware_logs import LogSettings, ingest, layouts, read_trial
from pipeline.hardware_logs.missed_bars import KNOWN
from pipeline.robot import Robot
from pipeline.simulation.torque_envelope import TorqueEnvelope
from pipeline.validation.bars import Bar, CellBars
from pipeline.validation.cells import STANDING, SURVIVING, TRACKING, Cell
from pipeline.validation.deployed import Deployed
from pipeline.validation.failed_trials import failed_trial, file_name, missed_by, worst_trial, write_failed_trials
from pipeline.validation.figures import FIGURES, measure_trials
from pipeline.validation.suites import push_cells
from pipeline.validation.trial import CommandProfile, Conditions, Trial, VelocityCommand
from pipeline.validation.verdict import CellVerdict, Reason, Verdict
from pipeline.validation.walk import Worlds
from tests.factories.log_trials import FAILURES, nominal_actuators, trial_of
from tests.factories.validation_walks import cell, gliding_rollout, measured


@pytest.fixture
def verdict(still: Deployed) -> Verdict:
    pushed = next(each for each in push_cells(still.robot, ("force",)) if each.name == "push force standing 60 Ns")
    few = dataclasses.replace(pushed, trials=pushed.trials[2:3])
    numbers = measure_trials(still, few.trials)
    assert numbers[0]["fell"] == 1.0
    bars = CellBars(required=True, why="", bars={"survival": Bar(unit="share", source="test", at_least=0.9)})
    reason = Reason(cell=few.name, figure="survival", got=0.0, bar="at least 0.9 share")
    one = CellVerdict(measured=measured(few, *numbers), bars=bars, reasons=(reason,))
    return Verdict(suite="quick", policy="p", robot="r", cells=(one,))


def test_a_failed_cell_is_a_log_that_the_reader_of_logs_takes(
    root: Path, tmp_path: Path, still: Deployed, verdict: Verdict
):
    (path,) = write_failed_trials(still, verdict, tmp_path)
    assert path.name == "push_force_standing_60_ns.mcap"
    rollout, log = failed_trial(Worlds(still), verdict.cells[0])
    assert log.facts.simulated
    assert log.facts.policy_digest == digest(still.policy)
    assert log.facts.notes["validation cell"] == "push force standing 60 Ns"
    assert [(event.kind, event.time_s) for event in log.facts.events] == [("pushed", 1.0)]
    np.testing.assert_allclose(log.low_state.joint_pos[0], rollout.qpos[0, 7:], atol=0.01)
    first = path.read_bytes()
    bounds = settings.read(root / "data" / "hardware_logs.yaml", LogSettings)
    found = ingest(path, "failure", tmp_path / "trials", layouts=layouts([still.robot]), settings=bounds)
    (trial,) = found.trials
    assert found.integrity == "complete"
    again = read_trial(trial.path)
    assert again.simulated
    assert again.policy_digest == digest(still.policy)
    (fell,) = again.missed
    assert (fell.figure, fell.got, fell.asked, fell.cell) == ("survival", 0.0, 0.9, "push force standing 60 Ns")
    assert fell.from_s == verdict.cells[0].measured.trials[0]["fell_s"] > 1.0
    write_failed_trials(still, verdict, tmp_path)
    assert path.read_bytes() == first


@pytest.mark.parametrize("factor", [0.9, 1.2])
def test_the_gains_in_a_log_are_those_that_made_its_torques(still: Deployed, verdict: Verdict, factor: float):
    (one,) = verdict.cells
    (trial,) = one.measured.cell.trials
    gained = dataclasses.replace(trial, seconds=0.4, conditions=Conditions(gain_factor=factor))
    walked = dataclasses.replace(one.measured.cell, trials=(gained,))
    measured_again = dataclasses.replace(one.measured, cell=walked)
    rollout, log = failed_trial(Worlds(still), dataclasses.replace(one, measured=measured_again))
    assert log.joint_ctrl is not None
    np.testing.assert_allclose(log.joint_ctrl.kp[0], factor * still.task.kp, rtol=1e-6)
    np.testing.assert_allclose(log.joint_ctrl.kd[0], factor * still.task.kd, rtol=1e-6)
    asked = (
        log.joint_ctrl.kp[0] * (rollout.target[0] - rollout.qpos[0, 7:]) - log.joint_ctrl.kd[0] * rollout.qvel[0, 6:]
    )
    free = np.abs(asked) < 0.9 * still.robot.torque_limit
    np.testing.assert_allclose(rollout.torque[0, free], asked[free], atol=1e-6)


def test_the_worst_trial_is_the_first_that_fell_or_the_farthest_from_its_bar():
    reason = Reason(cell="a", figure="speed_error", got=0.4, bar="at most 0.1 m/s")
    bars = CellBars(required=True, why="", bars={})

    def worst_of(*trials: dict) -> int:
        found = measured(cell("a", 3), *trials)
        return worst_trial(CellVerdict(measured=found, bars=bars, reasons=(reason,)))[0].seed

    assert worst_of({"speed_error": 0.2}, {"speed_error": 0.4}, {"speed_error": 0.3}) == 2
    assert worst_of({"speed_error": 0.2}, {"speed_error": 0.4}, {"fell": 1.0, "fell_s": 2.0}) == 3


def test_a_walk_off_its_command_is_found_in_its_log(still: Deployed):
    profile = CommandProfile(commands=(VelocityCommand(forward=0.4, lateral=-0.6),), slew=None)
    one = Cell(
        name="vx +0.4",
        group="commands",
        figures=TRACKING,
        trials=(Trial(seed=0, command=profile, seconds=0.8, measure_s=0.3),),
    )
    (numbers,) = measure_trials(still, one.trials)
    bars = CellBars(required=True, why="", bars={"speed_error": Bar(unit="m/s", source="test", at_most=0.2)})
    reason = Reason(cell=one.name, figure="speed_error", got=numbers["speed_error"], bar="at most 0.2 m/s")
    cell = CellVerdict(measured=measured(one, numbers), bars=bars, reasons=(reason,))
    trial = trial_of(failed_trial(Worlds(still), cell)[1], still.robot)
    (missed,) = trial.missed
    assert (missed.figure, missed.axis, missed.commanded) == ("speed_error", "lateral", -0.6)
    assert (missed.got, missed.achieved) == (numbers["speed_error"], numbers["lateral"])
    assert (missed.from_s, missed.until_s) == (0.3, 0.8)
    (found,) = find_failures(trial, still.robot, nominal_actuators(still.robot), FAILURES).failures
    assert (found.kind, found.direction) == ("tracking", "lateral")
    assert found.command == pytest.approx((0.4, -0.6, 0.0))


def test_every_figure_of_a_cell_can_be_said_of_a_log():
    for name in {*TRACKING, *STANDING, "falls", *SURVIVING}:
        figure, known = FIGURES[name], KNOWN[name]
        assert (known.unit, known.lower_is_better) == (figure.unit, figure.lower_is_better)


def test_only_what_the_trial_of_the_log_missed_itself_is_said_of_it(robot: Robot):
    bars = {
        name: Bar(unit=FIGURES[name].unit, source="test", at_most=value)
        for name, value in {"slip": 0.05, "yaw_rate_error": 0.1, "saturation": 3.0, "power": 150.0}.items()
    }
    one, straight, turning = cell("a", 2), {"forward": 1.0, "lateral": 0.0, "yaw_rate": 0.05}, {"yaw_rate_error": 0.5}
    first = {"slip": 0.09, "yaw_rate_error": 0.05, "power": 200.0, "saturation": 5.0, **straight}
    numbers = measured(one, first, {"slip": 0.06, **straight, **turning})
    reasons = tuple(
        Reason(cell="a", figure=name, got=numbers.figure(name) or 0.0, bar=str(bar)) for name, bar in bars.items()
    )
    verdict = CellVerdict(measured=numbers, bars=CellBars(required=True, why="", bars=bars), reasons=reasons)
    rollout = gliding_rollout(robot, (1.0, 0.0, 0.0), seconds=10.0)
    knee = robot.joint_names.index("Right_Knee_Pitch")
    torque = rollout.torque.copy()
    torque[3500:, knee] = robot.torque_limit[knee]
    rollout = dataclasses.replace(rollout, torque=torque)
    missed = missed_by(verdict, rollout, TorqueEnvelope(limit=robot.torque_limit))
    assert [(each.figure, each.got, each.joint) for each in missed] == [
        ("slip", 0.09, ""),
        ("saturation", 5.0, "Right_Knee_Pitch"),
        ("power", 200.0, ""),
    ]


def test_file_names_keep_signs_apart():
    assert file_name("vx +0.6") == "vx_plus_0.6"
    assert file_name("vx -0.6") == "vx_minus_0.6"
    assert file_name("push ball standing 1.3 m") == "push_ball_standing_1.3_m"
