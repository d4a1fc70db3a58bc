"""`booster-lab simulate-robot OUT.mcap`: simulate a walk in MuJoCo and write it as a robot log."""

from pathlib import Path

import numpy as np

from pipeline.actuators.standing import read_standing_pose
from pipeline.cli.policy_arguments import Differences, SimulateRobot
from pipeline.cli.policy_commands import naming_policy, policy_of
from pipeline.deployment import PolicyController, deployment_task, digest, policy_task
from pipeline.errors import FileError, PipelineError, UnknownNameError
from pipeline.hardware_logs import LogFacts, write_mcap
from pipeline.project import Project, find_project
from pipeline.robot import Robot
from pipeline.simulation.plant import Push
from pipeline.simulation.run import Controller
from pipeline.virtual_robot.deviations import Deviations, Outage
from pipeline.virtual_robot.scripted import SWAY, TOPPLE_LEFT, Hold, ScriptedController
from pipeline.virtual_robot.trial import TIMESTEP_S, VirtualTrial, simulate

SCRIPTS = {"sway": SWAY, "topple_left": TOPPLE_LEFT}
PUSH_S = 0.1


def run(args: SimulateRobot) -> int:
    """Simulate the walk, write the log and print a summary."""
    if args.out.suffix.lower() != ".mcap":
        raise FileError(args.out, "the log is written as MCAP.", "Name a file that ends in .mcap.")
    _refuse_late(args)
    project = find_project()
    robot = project.robot(args.robot)
    controller, policy = _controller(project, robot, args)
    trial = VirtualTrial(
        command=tuple(args.command or [(0.5, 0.0, 0.0, 0.0)]),
        seconds=args.seconds,
        deviations=_deviations(args.differences),
        pushes=tuple(
            Push(start_s=start, duration_s=PUSH_S, force_w=np.array([x, y, 0.0]) / PUSH_S)
            for start, x, y in args.events.push
        ),
        hold=Hold(start_s=args.events.hold[0], stop_s=args.events.hold[1]) if args.events.hold else None,
        stop_s=args.events.stop,
        outages=tuple(
            Outage(start_s=start, stop_s=stop, joints=joints) for start, stop, joints in args.events.motors_off
        ),
    )
    facts = LogFacts(robot=robot.name, policy_digest=policy)
    every = max(round(1.0 / (args.rate * TIMESTEP_S)), 1)
    rollout, log = simulate(robot, controller, trial, np.random.default_rng(args.seed), facts, every=every)
    args.out.parent.mkdir(parents=True, exist_ok=True)
    write_mcap(args.out, log)
    fell = f"fell after {rollout.fell_s:.2f} s" if rollout.fell_s is not None else "did not fall"
    differs = "; ".join(trial.words()) or "nothing"
    print(
        f"{args.out}: {args.seconds:g} s of a simulated {robot.name}, {args.out.stat().st_size / 1e3:.0f} kB. "
        f"It {fell}. Differences from its model: {differs}."
    )
    return 0


def _refuse_late(args: SimulateRobot) -> None:
    """Raise PipelineError for an event that starts after the end of the log."""
    given = args.events
    begins = [("push", start) for start, _, _ in given.push]
    begins += [("hold", given.hold[0])] if given.hold else []
    begins += [("stop", given.stop)] if given.stop is not None else []
    begins += [("motors-off", start) for start, _, _ in given.motors_off]
    for option, start_s in begins:
        if start_s >= args.seconds:
            raise PipelineError(
                f"--{option} starts at {start_s:g} s, but the log ends at {args.seconds:g} s; increase --seconds."
            )


def _controller(project: Project, robot: Robot, args: SimulateRobot) -> tuple[Controller, str]:
    """The controller (policy or script) and its digest."""
    if args.script and args.policy:
        raise PipelineError("--script and --policy exclude each other; name one of them.")
    if args.script:
        pose = read_standing_pose(project.robot_folder(robot.name), robot)
        if pose is None:
            raise PipelineError(f"a script starts in the standing pose; robots/{robot.name}/standing.csv is missing.")
        task = deployment_task(robot, kp=pose.kp, kd=pose.kd, default_joint_pos=pose.joint_pos)
        script = SCRIPTS[args.script]
        unknown = [joint for joint in script.offsets if joint not in robot.joint_names]
        if unknown:
            raise UnknownNameError("joint", unknown[0], robot.joint_names)
        return ScriptedController(task, script), script.digest
    path = args.policy or _shipped(project, robot)
    with naming_policy(path):
        policy = policy_of(path, project.robot_folder(robot.name))
        return PolicyController(policy_task(robot, policy), policy), digest(policy)


def _shipped(project: Project, robot: Robot) -> Path:
    folder = project.shipped_policies(robot.name)
    shipped = sorted(folder.rglob("policy.npz"))
    if not shipped:
        raise FileError(folder, "no policy is shipped with the robot.", "Add --policy POLICY or --script.")
    return shipped[0]


def _deviations(given: Differences) -> Deviations:
    return Deviations(
        torque_scale=dict(given.weaker),
        hot=dict(given.hot),
        gain_scale=given.gains,
        command_scale=given.command_scale,
        friction=given.friction,
        delay_s=given.delay,
        root_mass_factor=given.trunk,
        message_loss=given.message_loss,
        motor_loss_hz=given.motor_loss,
    )
