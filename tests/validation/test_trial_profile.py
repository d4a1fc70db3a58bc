"""Commands over time, and the cells of the protocol by number."""

import numpy as np
import pytest

from pipeline.errors import UnknownNameError
from pipeline.robot import Robot
from pipeline.simulation.mujoco_plant import BALL_DISTANCE
from pipeline.simulation.plant import Kick, Push, Throw
from pipeline.validation.suites import BALL, FULL, HELD_OUT, QUICK, ball_speed, cells_of, full, named, push_cells, quick
from pipeline.validation.sweep import sweep_cells
from pipeline.validation.trial import CommandProfile, Trial, VelocityCommand


def test_a_command_is_slewed_at_one_unit_a_second_from_zero():
    values = CommandProfile(commands=(VelocityCommand(forward=2.0, yaw_rate=-0.5),)).sampled(50.0, 3.0)
    times_s = np.arange(150) / 50.0
    np.testing.assert_allclose(values[:, 0], np.minimum(times_s, 2.0), atol=1e-9)
    np.testing.assert_allclose(values[:, 2], -np.minimum(times_s, 0.5), atol=1e-9)
    np.testing.assert_array_equal(values[:, 1], 0.0)


def test_a_command_without_slew_is_there_at_once():
    values = CommandProfile(commands=(VelocityCommand(forward=2.0), VelocityCommand(start_s=1.0)), slew=None).sampled(
        50.0, 2.0
    )
    np.testing.assert_array_equal(values[:50, 0], 2.0)
    np.testing.assert_array_equal(values[50:, 0], 0.0)


def test_a_switch_is_slewed_from_where_the_command_is():
    values = CommandProfile(commands=(VelocityCommand(forward=1.0), VelocityCommand(start_s=2.0, lateral=0.5))).sampled(
        50.0, 4.0
    )
    assert values[99, 0] == pytest.approx(1.0)
    assert values[125, 0] == pytest.approx(1.0 - 26 / 50)
    assert values[125, 1] == pytest.approx(0.5)
    assert values[-1].tolist() == pytest.approx([0.0, 0.5, 0.0])


def test_the_full_suite_has_the_sixteen_commands_by_five_seeds(robot: Robot):
    commands = [cell for cell in full(robot) if cell.group == "commands"]
    assert len(commands) == 16
    assert all([trial.seed for trial in cell.trials] == [1, 2, 3, 4, 5] for cell in commands)
    assert all(cell.trials[0].seconds == 10.0 and cell.trials[0].measure_s == 4.0 for cell in commands)
    assert {cell.name for cell in commands} > {"stand", "vx +2.0", "vy -0.3", "yaw +1.5"}


@pytest.mark.parametrize(("model", "kind"), [("force", Push), ("kick", Kick), ("ball", Throw)])
def test_each_push_model_has_768_trials(robot: Robot, model: str, kind: type):
    cells = push_cells(robot, (model,))
    trials = [trial for cell in cells for trial in cell.trials]
    assert len(trials) == 768
    assert {type(event) for trial in trials for event in trial.events} == {kind}
    assert all(cell.name.startswith(f"push {model} ") for cell in cells)


def test_all_push_models_bring_the_impulse_of_their_name(robot: Robot):
    def first(model: str, name: str) -> Trial:
        return next(cell for cell in push_cells(robot, (model,)) if name in cell.name).trials[0]

    push, kick = first("force", "40 Ns").events[0], first("kick", "40 Ns").events[0]
    assert isinstance(push, Push) and isinstance(kick, Kick)
    np.testing.assert_allclose(push.force_w * push.duration_s, [40.0, 0.0, 0.0])
    np.testing.assert_allclose(kick.delta_v_w * robot.total_mass, [40.0, 0.0, 0.0])
    # the paper: 10 kg from 1.3 m, about 50 N s
    assert BALL.mass * ball_speed(1.3) == pytest.approx(50.5, abs=0.1)


def test_a_ball_catches_up_with_a_robot_that_walks_away_from_it(robot: Robot):
    for cell in push_cells(robot, ("ball",)):
        for trial in cell.trials:
            (throw,) = trial.events
            assert isinstance(throw, Throw)
            closing = throw.speed - trial.command.last.forward
            assert throw.duration_s * closing >= BALL_DISTANCE - BALL.radius - 1e-9
            assert throw.start_s + throw.duration_s < trial.seconds


def test_pushes_go_in_eight_directions_at_eight_times(robot: Robot):
    trials = push_cells(robot, ("kick",))[0].trials
    events = [event for trial in trials for event in trial.events if isinstance(event, Kick)]
    angles = {round(float(np.degrees(np.arctan2(each.delta_v_w[1], each.delta_v_w[0])))) % 360 for each in events}
    assert angles == set(range(0, 360, 45))
    assert len({each.start_s for each in events}) == 8


def test_the_quick_suite_is_a_part_of_the_full_one(robot: Robot):
    whole = {cell.name: cell for cell in full(robot)}
    assert len(whole) == len(full(robot))
    for cell in quick(robot):
        assert [repr(trial) for trial in cell.trials] == [repr(t) for t in whole[cell.name].trials[: len(cell.trials)]]
    seconds = sum(trial.seconds for cell in quick(robot) for trial in cell.trials)
    assert seconds < 600.0


def test_no_trial_is_judged_that_chose_the_checkpoint_and_none_is_judged_twice(robot: Robot):
    judged, unseen = full(robot), cells_of(HELD_OUT, robot)
    unpushed = [[cell.name for cell in cells if "push" not in cell.name] for cells in (sweep_cells(robot), judged)]
    assert unpushed[0] == unpushed[1]
    assert [(cell.name, len(cell.trials)) for cell in unseen] == [(cell.name, len(cell.trials)) for cell in judged]
    chosen, first, second = (
        [repr(trial) for cell in cells for trial in cell.trials] for cells in (sweep_cells(robot), judged, unseen)
    )
    assert len(set(first)) > 2000
    for one, other in ((chosen, first), (chosen, second), (first, second)):
        assert not set(one) & set(other)


def test_a_suite_or_cell_that_there_is_not_is_refused(robot: Robot):
    assert len(cells_of(FULL, robot)) > len(cells_of(QUICK, robot)) > 20
    with pytest.raises(UnknownNameError, match="unknown suite 'slow'; there are: full, held-out, quick"):
        cells_of("slow", robot)
    with pytest.raises(UnknownNameError, match="unknown cell 'vx 9'"):
        named(robot, {"vx 9": 1})
