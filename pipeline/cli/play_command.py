"""`booster-lab play POLICY`: a policy walks in MuJoCo in the browser, commanded by sliders and keys, or in a film."""

from __future__ import annotations

import contextlib
import webbrowser

from pipeline.cli.policy_arguments import Play
from pipeline.cli.policy_commands import policy_of, robot_folder
from pipeline.cli.project import find_project
from pipeline.validation.deployed import deployed, with_ankle_kd
from pipeline.viewing.film import Walk, record_walk
from pipeline.viewing.play_page import PlayPage


def run(args: Play) -> int:
    """Walk until interrupted, or write the film."""
    folder = robot_folder(find_project(), args.robot)
    one = deployed(folder, policy_of(args.policy, folder))
    if args.ankle_kd is not None:
        one = with_ankle_kd(one, args.ankle_kd)
    if args.record is not None:
        walk = Walk(
            command=args.command, seconds=args.seconds, push=args.push, terrain=args.terrain, friction=args.friction
        )
        print(record_walk(args.record, one, walk))
        return 0
    page = PlayPage(one, args.policy.name, port=args.port)
    try:
        print(f"{page.url} plays {args.policy}; stop with Ctrl-C", flush=True)
        if not args.no_browser:
            webbrowser.open(page.url)
        with contextlib.suppress(KeyboardInterrupt):  # the way to end it
            page.run()
    finally:
        page.stop()
    return 0
