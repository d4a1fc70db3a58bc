"""Arguments of the commands on policies in simulation, as those in `arguments.py`."""

import math
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal

from tyro.conf import OmitArgPrefixes, Positional, UseAppendAction, arg

from pipeline.cli.option_types import (
    AnkleKd,
    File,
    Folder,
    JointFactors,
    Number,
    Outages,
    PolicyFile,
    RobotName,
    Workers,
    integer,
    numbers,
    option,
    positive,
    span,
    within,
)

NOT_NEGATIVE = within(0.0, math.inf)
Factor = Annotated[float, option("FACTOR", positive)]
Waypoint = Annotated[tuple[float, float, float, float], option("T,F,L,Y", numbers(4))]


@dataclass(frozen=True, kw_only=True)
class Validate:
    """Evaluate a policy in MuJoCo; the exit code is the verdict.

    Runs a policy through commands, pushes, terrain and conditions and compares the result with
    robots/<robot>/validation.yaml. Exit code 0: passed, 3: failed, 1: could not run.
    """

    policy: PolicyFile
    robot: RobotName = "t1"
    ankle_kd: AnkleKd = None
    suite: Literal["quick", "full", "held-out"] = "quick"
    """cells and trials to run; held-out: cells of the full suite, trials that no selection used"""
    json: File = None
    """write the verdict and all figures here"""
    failures: Folder = None
    """write the worst trial of each failed cell as a log; replaces earlier logs of the policy for them"""
    workers: Workers = 0
    table: bool = False
    """print every cell"""


@dataclass(frozen=True, kw_only=True)
class CrossEngine:
    """Evaluate a policy in MuJoCo and DART; the exit code is the verdict.

    Runs a policy through the grid of data/cross_engine.yaml in MuJoCo, in MuJoCo with the armature on the links, and in
    DART, and compares it with the robot's validation.yaml. Exit code 0: passed, 3: failed, 1: could not run.
    """

    policy: PolicyFile
    robot: RobotName = "t1"
    ankle_kd: AnkleKd = None
    cells: Annotated[tuple[str, ...], arg(metavar="NAME")] = ()
    """only these cells"""
    seeds: Annotated[int | None, option("N", integer("a number of starts", 1, 10_000))] = None
    """starts per cell, replaces the number in data/cross_engine.yaml"""
    json: File = None
    """write the verdict and all figures here"""
    workers: Workers = 0


@dataclass(frozen=True, kw_only=True)
class WebotsProject:
    """Write a Webots project for a robot, and run it.

    Writes PROTO, world and controller into a folder that Webots opens. With --run the walk of data/webots.yaml is run
    and evaluated. Exit code 0: written, or passed; 3: failed, or not run because the program is missing; 1: the project
    could not be written.
    """

    out: Annotated[Path, arg(metavar="FOLDER")]
    """folder of the project"""
    robot: RobotName = "t1"
    policy: Annotated[Path | None, option("POLICY", Path)] = None
    """npz, or the folder of an exported policy"""
    ankle_kd: AnkleKd = None
    engine: Annotated[
        Literal["webots", "mujoco", "ode"] | None,
        option("{webots,mujoco,ode}", str, ("webots", "mujoco", "ode")),
        arg(name="run"),
    ] = None
    """also run the walk in this program"""
    json: File = None
    """write the result of the walk here"""


@dataclass(frozen=True, kw_only=True)
class Differences:
    """Differences between the robot and its model."""

    weaker: JointFactors = ()
    """remaining share of a joint's torque"""
    hot: JointFactors = ()
    """factor on a motor's heating"""
    gains: Factor = 1.0
    """factor on kp and kd of the motors"""
    command_scale: Factor = 1.0
    """share of the command that reaches the policy"""
    friction: Annotated[float, option("FACTOR", NOT_NEGATIVE)] = 1.0
    """factor on the friction of the ground"""
    delay: Annotated[float, option("S", within(0.0, 1.0))] = 0.0
    """delay from joint targets to motors [s]"""
    trunk: Factor = 1.0
    """factor on the trunk's mass"""
    message_loss: Annotated[float | None, option("SHARE", within(0.0, 0.99))] = None
    """share of messages lost"""
    motor_loss: Annotated[float | None, option("HZ", NOT_NEGATIVE)] = None
    """rate at which a motor loses packets [Hz]"""


@dataclass(frozen=True, kw_only=True)
class Events:
    """Events during the log."""

    push: UseAppendAction[tuple[Annotated[tuple[float, float, float], option("T,X,Y", numbers(3))], ...]] = ()
    """impulse X, Y [N s] over 0.1 s at time T [s]; may be repeated"""
    hold: Annotated[tuple[float, float] | None, option("T,UNTIL", span)] = None
    """a person lifts the robot off its feet, from T to UNTIL [s]"""
    stop: Annotated[float | None, option("T", NOT_NEGATIVE)] = None
    """the operator stops the robot at time T [s], and its joints are damped"""
    motors_off: Outages = ()
    """motors of the joints, or all, give no torque from T to UNTIL [s], or to the `end`; may be repeated"""


@dataclass(frozen=True, kw_only=True)
class SimulateRobot:
    """Write a robot log from a simulation in MuJoCo.

    Runs a policy in MuJoCo on a robot that differs from its model, and writes an MCAP log in the format of the robot's
    recorder, with sensor noise, motor temperatures and lost messages. The log states that it is simulated, and how the
    robot differed from its model.
    """

    out: Annotated[Positional[Path], arg(metavar="OUT.mcap")]
    """log to write"""
    robot: RobotName = "t1"
    policy: Annotated[Path | None, option("POLICY", Path)] = None
    """npz file, or folder of an exported policy; default: the shipped policy"""
    script: Annotated[
        Literal["sway", "topple_left"] | None, option("{sway,topple_left}", str, ("sway", "topple_left"))
    ] = None
    """joint targets over time instead of a policy"""
    command: UseAppendAction[tuple[Waypoint, ...]] = ()
    """command F, L [m/s] and Y [rad/s] from time T [s]; may be repeated (negative: --command=...)"""
    seconds: Annotated[float, option("S", positive)] = 10.0
    """length of the log [s]"""
    seed: Annotated[int, option("N", integer("a seed", 0, 2**32 - 1))] = 0
    """seed of the noise"""
    rate: Annotated[float, option("HZ", within(1.0, 500.0))] = 500.0
    """rate of the states in the log [Hz]; the nearest of 500, 250, 167, 125, …"""
    differences: OmitArgPrefixes[Differences] = Differences()
    events: OmitArgPrefixes[Events] = Events()


@dataclass(frozen=True, kw_only=True)
class Play:
    """Command a policy in MuJoCo, in the browser.

    The policy walks in MuJoCo, shown in the browser. Sliders and keys (W S A D Q E, X to stand) command it, P pushes
    the robot, and R restarts it. Choose terrain and friction on the page. --record writes a walk as MP4 or GIF instead,
    without a display.
    """

    policy: PolicyFile
    robot: RobotName = "t1"
    ankle_kd: AnkleKd = None
    port: Annotated[int, option("PORT", integer("a port", 1, 65535))] = 8080
    """port of the page; if it is in use, the next free port"""
    no_browser: bool = False
    """serve the page but do not open it"""
    record: Annotated[Path | None, option("OUT", Path)] = None
    """write a walk to an .mp4 or .gif"""
    seconds: float = 8.0
    """length of the filmed walk [s]"""
    command: Annotated[tuple[float, float, float], option("F,L,Y", numbers(3))] = (0.6, 0.0, 0.0)
    """command of the filmed walk: forward and left velocity [m/s], yaw rate [rad/s] (negative: --command=...)"""
    push: Number = None
    """push to the left at half time of the filmed walk [N s]"""
    terrain: Annotated[str, arg(metavar="NAME")] = "flat"
    """terrain of the filmed walk, as the page names it"""
    friction: Annotated[float, option("NUMBER", NOT_NEGATIVE)] = 1.0
    """sliding friction of the filmed walk"""
