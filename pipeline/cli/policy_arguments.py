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
    """how many cells and trials; held-out: the full suite's cells with trials that chose nothing"""
    json: File = None
    """write the verdict and all figures here"""
    failures: Folder = None
    """write a log of each failed cell's worst trial here; earlier logs of this policy in its cells are removed"""
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
    """starts per cell, instead of the file's"""
    json: File = None
    """write the verdict and all figures here"""
    workers: Workers = 0


@dataclass(frozen=True, kw_only=True)
class WebotsProject:
    """Write a Webots project of a robot, and run it.

    Writes PROTO, world and controller into a folder that Webots opens. With --run the walk of data/webots.yaml is run
    and evaluated. Exit code 0: written, or passed; 3: failed, or not run because the program is missing; 1: could not
    be done.
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
    """run the walk there as well"""
    json: File = None
    """write the result of the walk here"""


@dataclass(frozen=True, kw_only=True)
class Differences:
    """What differs from the model."""

    weaker: JointFactors = ()
    """share of a joint's torque that is left"""
    hot: JointFactors = ()
    """factor on a motor's heating"""
    gains: Factor = 1.0
    """factor on kp and kd that the motors follow"""
    command_scale: Factor = 1.0
    """share of the command that reaches the policy"""
    friction: Annotated[float, option("FACTOR", NOT_NEGATIVE)] = 1.0
    """factor on the friction of the ground"""
    delay: Annotated[float, option("S", within(0.0, 1.0))] = 0.0
    """from joint targets to motors [s]"""
    trunk: Factor = 1.0
    """factor on the trunk's mass"""
    message_loss: Annotated[float | None, option("SHARE", within(0.0, 0.99))] = None
    """share of messages lost"""
    motor_loss: Annotated[float | None, option("HZ", NOT_NEGATIVE)] = None
    """packets per second that a motor loses [Hz]"""


@dataclass(frozen=True, kw_only=True)
class Events:
    """What happens to the robot."""

    push: UseAppendAction[tuple[Annotated[tuple[float, float, float], option("T,X,Y", numbers(3))], ...]] = ()
    """at T [s] an impulse X, Y [N s] over 0.1 s; may be repeated"""
    hold: Annotated[tuple[float, float] | None, option("T,UNTIL", span)] = None
    """a person lifts it off its feet [s]"""
    stop: Annotated[float | None, option("T", NOT_NEGATIVE)] = None
    """the operator stops it at this time [s]: joints are damped"""
    motors_off: Outages = ()
    """motors of the joints, or all, give no torque from T to UNTIL [s], or to the `end`; may be repeated"""


@dataclass(frozen=True, kw_only=True)
class SimulateRobot:
    """Write a log as the robot would, from MuJoCo.

    Runs a policy in MuJoCo on a robot that differs from its model and writes what the robot's recorder would have
    written, as MCAP: sensor noise, motor temperatures, losses. The file states that it is simulated and in what the
    robot differed from its model.
    """

    out: Annotated[Positional[Path], arg(metavar="OUT.mcap")]
    """log to write"""
    robot: RobotName = "t1"
    policy: Annotated[Path | None, option("POLICY", Path)] = None
    """npz, or the folder of an exported policy; the policy that ships where not given"""
    script: Annotated[
        Literal["sway", "topple_left"] | None, option("{sway,topple_left}", str, ("sway", "topple_left"))
    ] = None
    """joint targets over time instead of a policy"""
    command: UseAppendAction[tuple[Waypoint, ...]] = ()
    """from T [s] on the command is F, L [m/s] and Y [rad/s]; may be repeated (negative: --command=...)"""
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

    A policy walks in MuJoCo while you watch: sliders and keys (W S A D Q E, X to stand) command it, P pushes it, R
    restarts it; terrain and friction are chosen on the page. With --record a walk is written as MP4 or GIF instead,
    without a display.
    """

    policy: PolicyFile
    robot: RobotName = "t1"
    ankle_kd: AnkleKd = None
    port: Annotated[int, option("PORT", integer("a port", 1, 65535))] = 8080
    """port of the page; the next free one where it is taken"""
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
