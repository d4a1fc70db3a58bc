"""`booster-lab simulate-robot OUT.mcap`: a walk in MuJoCo as the log that the robot would have recorded."""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np

from pipeline.actuators import read_standing_pose
from pipeline.cli.project import Project, find_project
from pipeline.deployment import PolicyController, deployment_task, digest, load_policy, policy_task
from pipeline.errors import FileError, PipelineError, UnknownNameError
from pipeline.hardware_logs import LogFacts, write_mcap
from pipeline.robot import Robot
from pipeline.simulation.events import Push
from pipeline.simulation.run import Controller
from pipeline.virtual_robot.deviations import Deviations
from pipeline.virtual_robot.failing_motors import Outage
from pipeline.virtual_robot.holding_hand import Hold
from pipeline.virtual_robot.scripted import SWAY, TOPPLE_LEFT, ScriptedController
from pipeline.virtual_robot.trial import TIMESTEP_S, VirtualTrial, simulate

SCRIPTS = {"sway": SWAY, "topple_left": TOPPLE_LEFT}
PUSH_S = 0.1


def add_to(commands: argparse._SubParsersAction) -> None:
    """Add the command."""
    parser = commands.add_parser(
        "simulate-robot",
        help="write a log as a robot would, from MuJoCo with a policy and a robot that differs from its model",
        description="Walk in MuJoCo and write what the robot's recorder would have written, as MCAP: sensor noise, "
        "motor temperatures, losses. The file says that it is simulated and in what the robot differed from its model.",
    )
    parser.add_argument("out", metavar="OUT.mcap", type=Path)
    parser.add_argument("--robot", default="t1")
    parser.add_argument("--policy", metavar="NPZ", type=Path, help="the policy; the one that ships where not given")
    parser.add_argument("--script", choices=sorted(SCRIPTS), help="joint targets by the clock instead of a policy")
    parser.add_argument(
        "--command",
        metavar="T,F,L,Y",
        type=_numbers(4),
        action="append",
        help="from T [s] on walk with F, L [m/s] and Y [rad/s]; may be given again (negative: --command=...)",
    )
    parser.add_argument("--seconds", type=float, default=10.0)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--rate", metavar="HZ", type=float, default=500.0, help="of the states in the log")
    differs = parser.add_argument_group("what differs from the model")
    differs.add_argument("--weaker", metavar="JOINT=SHARE", type=_of_joint, action="append", default=[])
    differs.add_argument("--hot", metavar="JOINT=FACTOR", type=_of_joint, action="append", default=[])
    differs.add_argument("--gains", metavar="FACTOR", type=float, default=1.0, help="of kp and kd the motors follow")
    differs.add_argument(
        "--command-scale", metavar="SHARE", type=float, default=1.0, help="of the command, reaches the policy"
    )
    differs.add_argument("--friction", type=float, default=1.0)
    differs.add_argument("--delay", metavar="S", type=float, default=0.0, help="from targets to motors")
    differs.add_argument("--trunk", metavar="FACTOR", type=float, default=1.0, help="of the trunk's mass")
    differs.add_argument("--message-loss", metavar="SHARE", type=float)
    differs.add_argument("--motor-loss", metavar="HZ", type=float, help="packets that a motor loses")
    happens = parser.add_argument_group("what happens to it")
    happens.add_argument(
        "--push", metavar="T,X,Y", type=_numbers(3), action="append", default=[], help="impulse X, Y [N s] over 0.1 s"
    )
    happens.add_argument("--hold", metavar="T,UNTIL", type=_numbers(2), help="a person lifts it off its feet")
    happens.add_argument("--stop", metavar="T", type=float, help="the operator stops it: joints are damped")
    happens.add_argument(
        "--motors-off",
        metavar="T,UNTIL[,JOINT...]",
        type=_outage,
        action="append",
        default=[],
        help="motors of the joints, or all, give no torque from T to UNTIL [s], or to the `end`; may be given again",
    )
    parser.set_defaults(run=run)


def run(parsed: argparse.Namespace) -> int:
    """Write the log."""
    project = find_project()
    robot = project.robot(parsed.robot)
    controller, policy = _controller(project, robot, parsed)
    trial = VirtualTrial(
        command=tuple(parsed.command or [(0.5, 0.0, 0.0, 0.0)]),
        seconds=parsed.seconds,
        deviations=_deviations(parsed),
        pushes=tuple(
            Push(start_s=start, duration_s=PUSH_S, force_w=np.array([x, y, 0.0]) / PUSH_S)
            for start, x, y in parsed.push
        ),
        hold=Hold(start_s=parsed.hold[0], stop_s=parsed.hold[1]) if parsed.hold else None,
        stop_s=parsed.stop,
        outages=tuple(parsed.motors_off),
    )
    facts = LogFacts(robot=robot.name, policy_digest=policy)
    every = max(round(1.0 / (parsed.rate * TIMESTEP_S)), 1)
    rollout, log = simulate(robot, controller, trial, np.random.default_rng(parsed.seed), facts, every=every)
    parsed.out.parent.mkdir(parents=True, exist_ok=True)
    write_mcap(parsed.out, log)
    fell = f"fell after {rollout.fell_s:.2f} s" if rollout.fell_s is not None else "did not fall"
    differs = "; ".join(trial.words()) or "nothing"
    print(
        f"{parsed.out}: {parsed.seconds:g} s of a simulated {robot.name}, {parsed.out.stat().st_size / 1e3:.0f} kB. "
        f"It {fell}. Different from its model: {differs}."
    )
    return 0


def _controller(project: Project, robot: Robot, parsed: argparse.Namespace) -> tuple[Controller, str]:
    """What walks, and its digest."""
    if parsed.script:
        pose = read_standing_pose(project.root / "robots" / robot.name, robot)
        if pose is None:
            raise PipelineError(f"scripts stand in the standing pose, which robots/{robot.name}/standing.csv lacks.")
        task = deployment_task(robot, kp=pose.kp, kd=pose.kd, default_joint_pos=pose.joint_pos)
        script = SCRIPTS[parsed.script]
        unknown = [joint for joint in script.offsets if joint not in robot.joint_names]
        if unknown:
            raise UnknownNameError("joint", unknown[0], robot.joint_names)
        return ScriptedController(task, script), script.digest
    path = parsed.policy or _shipped(project, robot)
    policy = load_policy(path)
    return PolicyController(policy_task(robot, policy), policy), digest(policy)


def _shipped(project: Project, robot: Robot) -> Path:
    folder = project.root / "robots" / robot.name / "policies"
    shipped = sorted(folder.rglob("policy.npz"))
    if not shipped:
        raise FileError(folder, "no policy ships with the robot.", "Name one: --policy NPZ, or take a --script.")
    return shipped[0]


def _deviations(parsed: argparse.Namespace) -> Deviations:
    return Deviations(
        torque_scale=dict(parsed.weaker),
        hot=dict(parsed.hot),
        gain_scale=parsed.gains,
        command_scale=parsed.command_scale,
        friction=parsed.friction,
        delay_s=parsed.delay,
        root_mass_factor=parsed.trunk,
        message_loss=parsed.message_loss,
        motor_loss_hz=parsed.motor_loss,
    )


def _numbers(count: int):
    """A reader of so many numbers with commas between."""

    def read(text: str) -> tuple[float, ...]:
        values = tuple(float(part) for part in text.split(","))
        if len(values) != count or not np.isfinite(values).all():
            raise argparse.ArgumentTypeError(f"'{text}' is not {count} numbers with commas between")
        return values

    read.__name__ = f"{count} numbers"
    return read


def _outage(text: str) -> Outage:
    """An outage `T,UNTIL[,JOINT...]`, for argparse."""
    start, _, rest = text.partition(",")
    until, *joints = rest.split(",")
    try:
        start_s, stop_s = float(start), np.inf if until == "end" else float(until)
    except ValueError:
        start_s = stop_s = np.nan
    if not 0.0 <= start_s < stop_s:
        raise argparse.ArgumentTypeError(
            f"'{text}' is not T,UNTIL with 0 <= T < UNTIL [s] (or the word `end`), and joints after another comma"
        )
    return Outage(start_s=start_s, stop_s=stop_s, joints=tuple(joints))


def _of_joint(text: str) -> tuple[str, float]:
    joint, sign, number = text.partition("=")
    try:
        value = float(number)
    except ValueError:
        value = float("nan")
    if not sign or not value > 0.0:
        raise argparse.ArgumentTypeError(f"'{text}' is not JOINT=NUMBER with a number above 0")
    return joint, value
