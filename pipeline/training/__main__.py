"""Train a policy: `python -m pipeline.training --bundle DIR --out DIR --preset NAME`.

    --bundle DIR        what is trained on, as plain files: robot and expert frames (`pipeline.expert.training_bundle`)
    --out DIR           where the run goes; a folder of its own
    --preset NAME       `paper`, `paper_flat`, `long_steps` … (`--list` prints them and what each changes)
    --set NAME=VALUE    change one option of the preset; may be given often
    --device cuda|cpu   or `cuda:1`; `cuda` without a GPU is an error, never a silent change
    --physics plain|warp  MuJoCo in threads (a processor's default), or MuJoCo Warp (a GPU's)
    --start-from FILE   begin with the network of a policy file (npz); its critic learns anew
    --num-envs N        environments (each GPU)
    --iterations N      of 24 steps each; with `--resume` counted from the beginning of the run
    --minutes M         end after M minutes of training (those before a resume counted in), whichever comes first
    --seed S            of everything random
    --resume            go on from the newest checkpoint in `--out/checkpoints`; without one, start
    --list              print presets and options as JSON, and end

Files that it writes below `--out`:

    config.json         preset, every option, seed, environments, device, digests of bundle and database, versions
    curves.csv          a row an iteration: see `pipeline/training/curves.py` for its columns; goes on when resumed
    checkpoints/model_000100.pt …   every 100 iterations and the last; read with `weights_only=True`
    policy.npz          the newest checkpoint's network with its gains, as `pipeline.deployment.load_policy` reads it
    done.json           written last, when the run ended by itself: iterations, seconds, steps, steps_per_s, reason

On stdout a line an iteration: `iteration 12 of 300, 5 s: …`. Exit status 0 when done, 2 for wrong arguments or files
(the message on stderr is whole), 130 when interrupted; a run that was killed is taken up by `--resume`.

Several GPUs: `torchrun --nproc-per-node 4 -m pipeline.training …`, as rsl-rl does it; `--num-envs` is per GPU.
A checkpoint becomes a policy by `python -m pipeline.training.export_policy --checkpoint FILE --bundle DIR --out FILE`.
"""

from __future__ import annotations

import os
import sys

os.environ.setdefault("OMP_WAIT_POLICY", "PASSIVE")  # else torch's threads spin where MuJoCo's want the processor

from pipeline.training.command import main

if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
