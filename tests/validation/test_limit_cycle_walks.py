"""Whose cycles are compared: walks in two engines, spans of logs; what is missing is said."""

import dataclasses
import math
from collections.abc import Callable

import numpy as np
import pytest

from pipeline.deployment import deployment_task, load_policy
from pipeline.errors import UnknownNameError
from pipeline.files import settings as settings_files
from pipeline.hardware_logs import LogSettings, ingest, layouts, read_trial, write_mcap
from pipeline.hardware_logs.robot_log import LogFacts
from pipeline.hardware_logs.trial import Gap, Trial
from pipeline.simulation.torque_envelope import TorqueEnvelope
from pipeline.validation.bars import Bar, CellBars, read_validation
from pipeline.validation.deployed import Deployed, deployed, with_ankle_kd
from pipeline.validation.derived_bars import limit_cycle_bars
from pipeline.validation.limit_cycle_walks import (
    SpeedCycles,
    limit_cycles,
    steady_span,
    trial_series,
    walk_series,
)
from pipeline.validation.limit_cycles import PLANES, LimitCycle, LimitCycleSettings, compare, limit_cycle
from pipeline.viewing.validation_plots import limit_cycle_plots
from pipeline.virtual_robot.trial import VirtualTrial, simulate
from tests.factories.networks import network
from tests.factories.policy_walks import ANKLE_KD

RATE_HZ = 100.0


@pytest.fixture(scope="module")
def settings(root):
    return settings_files.read(root / "data" / "limit_cycles.yaml", LimitCycleSettings)


BARS = CellBars(
    required=True,
    why="",
    bars={
        "shape_distance": Bar(unit="of its size", source="test", at_most=0.35),
        "period_difference": Bar(unit="share", source="test", at_most=0.06),
        "amplitude_difference": Bar(unit="share", source="test", at_most=0.2),
    },
)


def walking_log(robot, *, speed=0.6, period_s=0.8, changed=None):
    """A log of a robot that stands 2 s, then swings its legs at a command; `changed` edits its arrays."""
    count = round(20.0 * RATE_HZ)
    time_s = np.arange(count) / RATE_HZ
    walks = (time_s >= 2.0).astype(float)
    phase = 2.0 * math.pi * time_s / period_s
    joint_pos = np.tile(robot.default_joint_pos, (count, 1))
    joint_vel = np.zeros_like(joint_pos)
    for side, lead in (("Left", 0.0), ("Right", math.pi)):
        for part, size, ahead in (("Hip_Pitch", 0.3, 0.0), ("Knee_Pitch", 0.5, 1.0)):
            column = robot.joint(f"{side}_{part}")
            joint_pos[:, column] += walks * size * np.cos(phase + lead + ahead)
            joint_vel[:, column] = -walks * size * 2.0 * math.pi / period_s * np.sin(phase + lead + ahead)
    command = np.zeros((count, 3))
    command[:, 0] = speed * walks
    nothing = np.zeros((count, len(robot.joint_names)))
    arrays = {
        **dict.fromkeys(("torque_est", "temperature_c", "target_pos", "target_torque", "kp", "kd"), nothing),
        **dict.fromkeys(("rpy", "gyro_b", "acc_b", "odometer"), np.zeros((count, 3))),
        "time_s": time_s,
        "joint_pos": joint_pos,
        "joint_vel": joint_vel,
        "command": command,
        "lost": nothing.astype(int),
        "fall_state": np.zeros(count, dtype=int),
    }
    if changed:
        changed(arrays)
    return Trial(
        name="walk",
        robot=robot.name,
        joint_names=robot.joint_names,
        policy_digest=None,
        command_source="schedule",
        simulated=False,
        integrity="complete",
        rate_hz=RATE_HZ,
        start_ns=0,
        log_digest="0" * 64,
        notes=(),
        events=(),
        gaps=(),
        **arrays,
    )


def test_a_log_gives_the_span_of_its_command_without_the_start(robot, settings):
    span = steady_span(walking_log(robot), 0.6, settings)
    assert span == slice(round((2.0 + settings.settled_s) * RATE_HZ), 2000)


def test_a_leg_of_a_log_has_its_cycle(robot, settings):
    trial = walking_log(robot)
    span = steady_span(trial, 0.6, settings)
    assert span is not None
    for side in ("left", "right"):
        found = limit_cycle(trial_series(trial, span, side, f"log {side}", robot))
        assert found.period_s == pytest.approx(0.8, rel=1e-3)
        assert found.hip_amplitude_rad == pytest.approx(0.6, rel=1e-2)
        assert found.knee_amplitude_rad == pytest.approx(1.0, rel=1e-2)


@pytest.mark.parametrize("speed", [0.5, 2.0])
def test_a_log_of_another_command_gives_nothing(robot, settings, speed):
    assert steady_span(walking_log(robot, speed=speed), 0.6, settings) is None


def test_a_turn_a_fall_and_a_gap_end_a_span(robot, settings):
    def turning(arrays):
        arrays["command"][1200:, 2] = 0.4

    def falling(arrays):
        arrays["fall_state"][1500:] = 1

    assert steady_span(walking_log(robot, changed=turning), 0.6, settings) == slice(600, 1200)
    assert steady_span(walking_log(robot, changed=falling), 0.6, settings) == slice(600, 1500)
    gap = Gap(start_s=13.995, stop_s=14.5, reason="lost")
    assert steady_span(dataclasses.replace(walking_log(robot), gaps=(gap,)), 0.6, settings) == slice(600, 1400)


def test_a_policy_that_falls_is_not_compared_and_never_agrees(robot, settings):
    one = Deployed(
        robot=robot,
        task=deployment_task(robot),
        policy=network(robot, np.random.default_rng(0)),
        envelope=TorqueEnvelope(limit=robot.torque_limit),
    )
    short = dataclasses.replace(settings, speeds_m_s=(0.6,))
    (found,) = limit_cycles(one, [walking_log(robot)], short, {"0.6 m/s": BARS})
    assert found.required
    assert [text.split(":")[0] for text in found.reasons] == ["MuJoCo at 0.6 m/s", "DART at 0.6 m/s"]
    assert set(found.cycles) == {"log walk left", "log walk right"}
    assert found.comparisons == ()
    assert limit_cycle_plots([found]).startswith(b"\x89PNG")


@pytest.mark.shared
def test_the_published_policy_walks_alike_in_both_engines(robot, policies, settings, root):
    """At .6 m/s, its ankles damped as it is deployed; the log of other legs is far from it."""
    plain = Deployed(
        robot=robot,
        task=deployment_task(robot),
        policy=load_policy(policies / "t1_walk.npz"),
        envelope=TorqueEnvelope(limit=robot.torque_limit),
    )
    one = with_ankle_kd(plain, ANKLE_KD)
    bars = read_validation(root / "data/validation.yaml", root / "robots/t1/validation.yaml").limit_cycles
    assert bars["0.6 m/s"].required and not bars["2 m/s"].required
    short = dataclasses.replace(settings, speeds_m_s=(0.6,))
    (found,) = limit_cycles(one, [walking_log(robot)], short, bars)
    assert found.required and found.reasons == ()
    by_name = {each.name: each for each in found.comparisons}
    assert set(by_name) == {"DART left", "DART right", "log walk left", "log walk right"}
    for side in ("left", "right"):
        dart, log = by_name[f"DART {side}"], by_name[f"log walk {side}"]
        assert 0.9 < dart.period_ratio < 1.1
        assert log.shape_distance[PLANES[0]] > 2.0 * dart.shape_distance[PLANES[0]]
    assert 0.7 < found.cycles["MuJoCo left"].period_s < 1.1
    json_types = found.to_dict()
    assert [row["record"] for row in json_types["cycles"]][:2] == ["MuJoCo left", "MuJoCo right"]
    assert limit_cycle_plots([found]) == limit_cycle_plots([found])


@pytest.fixture
def cycle(robot, settings) -> Callable[[str, float], LimitCycle]:
    """The limit cycle of a walk under a name, of one period [s]."""

    def made(name: str, period_s: float) -> LimitCycle:
        trial = walking_log(robot, period_s=period_s)
        span = steady_span(trial, 0.6, settings)
        assert span is not None
        return limit_cycle(trial_series(trial, span, "left", name, robot))

    return made


def test_a_robot_on_half_its_period_gives_reasons(cycle):
    """The bars bite: the same legs at another cadence and stroke."""
    from pipeline.validation.limit_cycle_walks import _reasons

    reasons = _reasons(compare(cycle("MuJoCo left", 0.8), cycle("DART left", 0.4)), BARS)
    assert reasons == ["DART left against MuJoCo left: difference of periods 0.500, asked is at most 0.06 share"]


def test_bars_of_a_speed_are_the_references_worst_and_another_gait_is_not_required(cycle, rules):
    """Legs of made-up walks: one 2 % slower, one at half the period."""

    def bars_of(period_s):
        compared = compare(cycle("MuJoCo left", 0.8), cycle("DART left", period_s))
        return limit_cycle_bars([[SpeedCycles(speed_m_s=0.6, required=False, comparisons=(compared,))]], rules)

    (near,) = bars_of(0.816).values()
    margin = rules.margins["period_difference"].absolute
    assert near.required and near.bars["period_difference"].at_most == pytest.approx(0.02 + margin, abs=0.002)
    far = bars_of(0.4)["0.6 m/s"]
    assert not far.required
    assert far.why == "the reference's period differs by 50 % between MuJoCo and DART"
    fell = SpeedCycles(speed_m_s=2.0, required=False, missing=("DART at 2 m/s: fell after 4.50 s", "no hardware log"))
    assert limit_cycle_bars([[fell]], rules)["2 m/s"].why == "the reference: DART at 2 m/s: fell after 4.50 s"


@pytest.mark.shared
def test_the_log_of_a_virtual_robot_has_the_cycle_of_its_simulation(robot, policies, settings, root, tmp_path):
    """Written as a recorder writes it, read as any log: noise, loss and clock do not change the stride."""
    policy = load_policy(policies / "t1_walk.npz")
    one = with_ankle_kd(deployed(root / "robots" / "t1", policy), 2.0)
    asked = VirtualTrial(command=((0.5, 0.6, 0.0, 0.0),), seconds=12.0)
    facts = LogFacts(robot=robot.name, policy_digest="p" * 64)
    _, log = simulate(robot, one.controller(), asked, np.random.default_rng(0), facts)
    write_mcap(tmp_path / "walk.mcap", log)
    values = settings_files.read(root / "data" / "hardware_logs.yaml", LogSettings)
    made = ingest(tmp_path / "walk.mcap", "walk", tmp_path / "out", layouts=layouts([robot]), settings=values)
    trial = read_trial(made.trials[0].path)
    span = steady_span(trial, 0.6, settings)
    assert span is not None
    for side, simulated in zip(("left", "right"), walk_series(one, "MuJoCo", 0.6, settings), strict=True):
        found = compare(limit_cycle(simulated), limit_cycle(trial_series(trial, span, side, f"log {side}", robot)))
        assert max(found.shape_distance.values()) < 0.12
        assert found.period_ratio == pytest.approx(1.0, abs=0.03)
        assert found.hip_amplitude_ratio == pytest.approx(1.0, abs=0.06)
        assert found.knee_amplitude_ratio == pytest.approx(1.0, abs=0.06)


def test_a_log_without_a_knee_is_refused(robot):
    names = tuple("Left_Knee" if name == "Left_Knee_Pitch" else name for name in robot.joint_names)
    log = dataclasses.replace(walking_log(robot), joint_names=names)
    with pytest.raises(UnknownNameError, match=r"unknown joint 'Left_Knee_Pitch'; there are: .*Left_Knee,"):
        trial_series(log, slice(600, 1200), "left", "log left", robot)
