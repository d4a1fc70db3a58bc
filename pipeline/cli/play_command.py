"""`booster-lab play POLICY`: a policy walks in MuJoCo in the browser, commanded by sliders and keys."""

from __future__ import annotations

import argparse
import contextlib
import webbrowser
from pathlib import Path

from pipeline.cli.project import find_project


def add_to(commands: argparse._SubParsersAction) -> None:
    """Add the command."""
    parser = commands.add_parser(
        "play",
        help="command a policy in MuJoCo, in the browser",
        description="A policy walks in MuJoCo while you watch: sliders and keys (W S A D Q E) command it, P pushes it, "
        "terrain and friction are chosen. With --record a walk is written as MP4 or GIF instead, without a display.",
    )
    parser.add_argument("policy", metavar="POLICY", type=Path, help="npz of a policy, or the folder of an exported one")
    parser.add_argument("--robot", metavar="NAME", default="t1", help="robot it is for, adapted where it was")
    parser.add_argument(
        "--ankle-kd",
        metavar="KD",
        type=float,
        help="damping of the ankles [N m s/rad], for a policy whose file doesn't say with which it is deployed",
    )
    parser.add_argument("--port", type=int, default=8080, help="port of the page (default: 8080, or the next free)")
    parser.add_argument("--no-browser", action="store_true", help="serve the page but don't open it")
    film = parser.add_argument_group("a film instead of the page")
    film.add_argument("--record", metavar="OUT", type=Path, help="write a walk to an .mp4 or .gif")
    film.add_argument("--seconds", type=float, default=8.0, help="length of the walk (default: 8)")
    film.add_argument(
        "--command",
        metavar=("F", "L", "Y"),
        type=float,
        nargs=3,
        default=(0.6, 0.0, 0.0),
        help="forward and left velocity [m/s], yaw rate [rad/s] (default: 0.6 0 0)",
    )
    film.add_argument("--push", metavar="N_S", type=float, help="push to the left at half time [N s]")
    film.add_argument("--terrain", default="flat", help="as the page names it (default: flat)")
    film.add_argument("--friction", type=float, default=1.0)
    parser.set_defaults(run=run)


def run(parsed: argparse.Namespace) -> int:
    """Walk until interrupted, or write the film."""
    from pipeline.cli.validate_command import policy_of, robot_folder
    from pipeline.validation.deployed import deployed, with_ankle_kd

    project = find_project()
    folder = robot_folder(project, parsed.robot)
    one = deployed(folder, policy_of(parsed.policy, folder))
    if parsed.ankle_kd is not None:
        one = with_ankle_kd(one, parsed.ankle_kd)
    if parsed.record is not None:
        from pipeline.viewing.walk_film import Walk, record_walk

        walk = Walk(
            command=tuple(parsed.command),
            seconds=parsed.seconds,
            push=parsed.push,
            terrain=parsed.terrain,
            friction=parsed.friction,
        )
        print(record_walk(parsed.record, one, walk))
        return 0
    from pipeline.viewing.play_page import PlayPage

    page = PlayPage(one, parsed.policy.name, port=parsed.port)
    try:
        print(f"{page.url} plays {parsed.policy}; stop with Ctrl-C", flush=True)
        if not parsed.no_browser:
            webbrowser.open(page.url)
        with contextlib.suppress(KeyboardInterrupt):  # the way to end it
            page.run()
    finally:
        page.stop()
    return 0
