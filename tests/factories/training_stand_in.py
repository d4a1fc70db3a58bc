"""A stand-in for the training command: the same arguments and files, no training. What it does is told by the seed."""

from __future__ import annotations

from pathlib import Path

PROGRAM = """
import argparse, json, os, shutil, signal, sys, time
from pathlib import Path

signal.signal(signal.SIGINT, signal.SIG_DFL)  # a background job of a shell ignores it, and so would this process
parser = argparse.ArgumentParser()
for name in ("bundle", "out", "preset", "device", "seed"):
    parser.add_argument(f"--{name}", required=True)
parser.add_argument("--set", action="append", default=[])
parser.add_argument("--stages", nargs="+")
given = parser.parse_args()
options = dict(text.split("=") for text in given.set)
iterations, num_envs = int(options["schedule.iterations"]), int(options["simulation.num_envs"])
out = Path(given.out)
states = out / "amp" / "checkpoints"
states.mkdir(parents=True, exist_ok=True)
begun = sorted(states.glob("model_*.pt"))
first = int(begun[-1].stem[-6:]) + 1 if begun else 1
about = json.loads((Path(given.bundle) / "bundle.json").read_text())
made = {"command": "python -m pipeline.training", "commit": "abc"}
config = {**made, "preset": given.preset, "seed": int(given.seed), "num_envs": num_envs, "device": given.device}
(out / "config.json").write_text(json.dumps({**config, "bundle": about, "set": given.set}))
with (out / "starts").open("a") as stream:
    stream.write(f"from {first}\\n")
for iteration in range(first, iterations + 1):
    print(f"iteration {iteration} of {iterations}, 0 s: task 0.5", flush=True)
    (states / f"model_{iteration:06d}.pt").write_bytes(b"state")
    if given.seed == "13":
        print("Traceback: the simulation went to pieces", file=sys.stderr)
        sys.exit(3)
    if given.seed == "99":
        time.sleep(60)
numbers = range(1, iterations + 1)
rows = [f"{i},{float(i)},100.0,{0.1 * i},0.2,{-1.0 * i},0.5,-0.5,{5.0 + i},1.9,1.7" for i in numbers]
head = "iteration,seconds,steps_per_s,task_reward,style_reward,d_rollout,d_expert,d_policy,episode_s"
head += ",top_commanded,top_achieved"
(out / "curves.csv").write_text("\\n".join([head, *rows]) + "\\n")
shutil.copy(Path(given.bundle) / "network.npz", out / "policy.npz")
done = {"iterations": iterations, "seconds": 1.5}
(out / "done.json").write_text(json.dumps(done))
"""


def write_training_stand_in(root: Path) -> None:
    """Put the stand-in where `python -m pipeline.training` finds it when it is run in `root`."""
    folder = root / "pipeline" / "training"
    folder.mkdir(parents=True)
    for package in (root / "pipeline", folder):
        (package / "__init__.py").write_text("")
    (folder / "__main__.py").write_text(PROGRAM)
