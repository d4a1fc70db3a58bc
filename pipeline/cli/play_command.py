"""`booster-lab play POLICY`: a policy walks in MuJoCo in the browser, commanded by sliders and keys, or in a film."""

from pipeline.cli.policy_arguments import Play
from pipeline.cli.policy_commands import deployed_policy, robot_folder
from pipeline.cli.project import find_project
from pipeline.viewing.film import Walk, record_walk
from pipeline.viewing.play_page import PlayPage


def run(args: Play) -> int:
    """Walk until interrupted, or write the film."""
    one = deployed_policy(robot_folder(find_project(), args.robot), args.policy, args.ankle_kd)
    if args.record is not None:
        walk = Walk(
            command=args.command, seconds=args.seconds, push=args.push, terrain=args.terrain, friction=args.friction
        )
        print(record_walk(args.record, one, walk))
        return 0
    PlayPage(one, args.policy.name, port=args.port).serve(str(args.policy), browser=not args.no_browser)
    return 0
