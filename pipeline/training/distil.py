"""Teach one network by several policies: `python -m pipeline.training.distil --bundle DIR --out DIR --teacher …`.

    --teacher ROLE=FILE  a policy file (npz) for a role: `other`, needed; `ahead`, `fast`, `run`, `sloped`,
                         `standing`, `pushed`
    --start-from FILE    the policy file whose network is begun with; else that of `other`
    --preset NAME        whose commands, pushes and disturbances robots are taught under, as training ends with them
    --set NAME=VALUE     change one option of the preset; may be given often
    --iterations N       of 24 steps of each environment
    --minutes M          end after M minutes, whichever comes first
    --memory N           how many of the newest states are learned from
    --pushed-s T         how long after it began a push is answered by who teaches that [s]
    --unsteady-deg A     who leans more than this counts as pushed just then
    --ahead V            who teaches the walk ahead does so from this speed on [m/s]
    --ahead-turn W       and up to this yaw rate [rad/s]
    --under-way S        and of who goes at this share of what it is told at least; who sets off, or is told to go half
                         as fast again, is `other`'s until then
    --fast V, --run V    the walk ahead is fast, and a run, from this speed on [m/s]
    --walks ROLE=T:W,…   how fast the teacher of a role walks, W, when it is told T [m/s]; it is told what makes it walk
                         as fast as the robot is told to; may be given for each role
    --both-sides ROLE    the teacher of a role answers as it and its mirror image do, on average; may be given often
    --with-error ROLE    the teacher of a role is told what the velocity lacks on top of the command; may be given often
    --beyond ROLE=S      the teacher of a role does more, by this share, of what it does otherwise than who teaches
                         `pushed`: who can't see that it was pushed a second ago learns some of that one's steps at all
                         times; may be given for each role
    --clip-joint PART    joints with this in their name, of the arms, are told by the clips as robots walk ahead; may be
                         given often
    --clip-role ROLE     in this role; may be given often, else as `ahead` and `fast`
    --mirror-role ROLE   half of the states in this role are learned as their mirror images; may be given often
    --passes P           how often each state is learned from while it is new
    --rate R             the learning rate at first; at last it is a twentieth of it

The rest as in `python -m pipeline.training`, as are its files and exit status, but in one process; `curves.csv` has for
each role the mean square of what the network is off by (`loss_other` …). The policy is a network like any: training can
go on from it.
"""

from __future__ import annotations

import argparse
import math
import os
import sys
from collections.abc import Sequence
from pathlib import Path

os.environ.setdefault("OMP_WAIT_POLICY", "PASSIVE")  # else torch's threads spin where MuJoCo's want the processor

from pipeline.learning.arguments import chosen_device, pairs
from pipeline.learning.training_error import TrainingError
from pipeline.training.option_texts import changed_by_texts
from pipeline.training.presets import preset


def main(arguments: Sequence[str]) -> int:
    """Exit status 0, 2 for a wrong request, 130 when interrupted."""
    given = _parser().parse_args(arguments)
    try:
        _distil(given)
    except TrainingError as error:
        print(error, file=sys.stderr)
        return 2
    except KeyboardInterrupt:
        print("interrupted; --resume goes on from the newest checkpoint.", file=sys.stderr)
        return 130
    return 0


def _distil(given: argparse.Namespace) -> None:
    from pipeline.training.bundle import read_bundle
    from pipeline.training.distil_request import DistilRequest
    from pipeline.training.distilled_run import DistilledRun
    from pipeline.training.roles import Borders

    if os.getenv("WORLD_SIZE", "1") != "1":
        raise TrainingError("distil runs in one process, on one device; start it without torchrun.")
    options = changed_by_texts(preset(given.preset), pairs(given.set))
    teachers = {role: Path(path) for role, path in pairs(given.teacher, "--teacher").items()}
    request = DistilRequest(
        out=given.out,
        preset=given.preset,
        options=options,
        teachers=teachers,
        start_from=given.start_from,
        num_envs=given.num_envs,
        device=chosen_device(given.device),
        seed=given.seed,
        iterations=given.iterations,
        minutes=given.minutes,
        resume=given.resume,
        memory=given.memory,
        passes=given.passes,
        rate=given.rate,
        borders=Borders(
            pushed_s=given.pushed_s,
            unsteady_deg=given.unsteady_deg,
            turn_rad_s=given.ahead_turn,
            ahead_m_s=given.ahead,
            under_way=given.under_way,
            fast_m_s=given.fast,
            run_m_s=given.run,
        ),
        clip_roles=tuple(given.clip_role) or ("ahead", "fast"),
        with_error=tuple(given.with_error),
        both_sides=tuple(given.both_sides),
        walks=pairs(given.walks, "--walks"),
        clip_joints=tuple(given.clip_joint),
        mirror_roles=tuple(given.mirror_role),
        beyond={role: _share(role, text) for role, text in pairs(given.beyond, "--beyond").items()},
        physics=given.physics,
    )
    DistilledRun(read_bundle(given.bundle, options.use_augmented), request).train()


def _share(role: str, text: str) -> float:
    try:
        return float(text)
    except ValueError as error:
        raise TrainingError(f"--beyond of '{role}' is '{text}'; it must look like {role}=.05.") from error


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog="python -m pipeline.training.distil", description="See the module's text.")
    parser.add_argument("--bundle", type=Path, required=True)
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--teacher", action="append", required=True, metavar="ROLE=POLICY")
    parser.add_argument("--start-from", type=Path, metavar="POLICY")
    parser.add_argument("--preset", default="refined_steps")
    parser.add_argument("--set", action="append", default=[], metavar="NAME=VALUE")
    parser.add_argument("--device", default="cuda")
    parser.add_argument("--physics", choices=("warp", "plain"))
    parser.add_argument("--num-envs", type=int, default=4096)
    parser.add_argument("--iterations", type=int, default=600)
    parser.add_argument("--minutes", type=float)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--memory", type=int, default=300_000)
    parser.add_argument("--passes", type=float, default=4.0)
    parser.add_argument("--rate", type=float, default=1e-3)
    parser.add_argument("--pushed-s", type=float, default=1.0)
    parser.add_argument("--unsteady-deg", type=float, default=math.inf)
    parser.add_argument("--ahead", type=float, default=0.55)
    parser.add_argument("--under-way", type=float, default=0.0)
    parser.add_argument("--ahead-turn", type=float, default=1.0)
    parser.add_argument("--fast", type=float, default=0.85)
    parser.add_argument("--run", type=float, default=math.inf)
    parser.add_argument("--walks", action="append", default=[], metavar="ROLE=TOLD:WALKED,…")
    parser.add_argument("--both-sides", action="append", default=[], metavar="ROLE")
    parser.add_argument("--clip-role", action="append", default=[], metavar="ROLE")
    parser.add_argument("--with-error", action="append", default=[], metavar="ROLE")
    parser.add_argument("--clip-joint", action="append", default=[], metavar="PART")
    parser.add_argument("--mirror-role", action="append", default=[], metavar="ROLE")
    parser.add_argument("--beyond", action="append", default=[], metavar="ROLE=SHARE")
    parser.add_argument("--resume", action="store_true")
    return parser


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
