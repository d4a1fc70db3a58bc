"""How far a policy's walk is from the expert's of the same command, without a discriminator.

    python -m pipeline.training.style_distance --bundle DIR POLICY.npz ... [--seeds N]

Walk and expert are compared by windows of four frames, 0.06 s apart, of motion features (`amp/features.py`), each in
standard deviations of all expert frames. The distance of two sets of windows is their energy distance (Székely and
Rizzo 2013), sqrt(2 E|x - y| - E|x - x'| - E|y - y'|), with lengths divided by the root of the number of features: 0 for
equal distributions, sqrt(2 d) for two points d standard deviations apart in every feature. The row `expert` is the
distance between two halves of the clips.
"""

import argparse
import math
import sys
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import torch
from scipy.spatial.distance import cdist

from pipeline.errors import FileError
from pipeline.learning.training_error import TrainingError
from pipeline.training.amp.expert import window_starts
from pipeline.training.amp.features import FeatureNormalizer, floors, frame_features, positions, state_features
from pipeline.training.bundle import ExpertFrames, read_bundle
from pipeline.training.plain_walk import CONTROL_EVERY, MEASURE_S, STEP_S, Walk, World

SPEEDS = (0.6, 1.0, 1.5)
"""Forward commands that are compared [m/s]."""
NEAR = (0.2, 0.15, 0.3)
"""Largest difference between an expert window's command and the policy's [m/s, m/s, rad/s]."""
WINDOW, STRIDE = 4, 3
MOST = 1500
"""Windows of a set; of more, as many are drawn."""


def energy_distance(one: np.ndarray, other: np.ndarray) -> float:
    """Energy distance of two samples (n, f) and (m, f), lengths divided by sqrt(f); NaN where one is empty."""
    if not (len(one) and len(other)):
        return math.nan
    between, within = cdist(one, other).mean(), [_within(each) for each in (one, other)]
    return float(np.sqrt(max(0.0, (2.0 * between - sum(within)) / np.sqrt(one.shape[1]))))


def _within(sample: np.ndarray) -> float:
    count = len(sample)
    return cdist(sample, sample).sum() / max(count * (count - 1), 1)


def expert_sets(expert: ExpertFrames, command: Sequence[float], rng: np.random.Generator) -> tuple[np.ndarray, ...]:
    """First frames of windows near a command: of all clips, and of every other clip and the rest of them.

    The halves are of different clips; of a single clip the second one is empty. Raises TrainingError without a window.
    """
    starts = window_starts(expert, (WINDOW - 1) * STRIDE + 1)
    starts = starts[(np.abs(expert.command[starts] - np.array(command)) <= np.array(NEAR)).all(axis=1)]
    if not len(starts):
        raise TrainingError(f"the expert database has no frame near the command {tuple(command)}.")
    clip = np.searchsorted(expert.clip_start, starts, side="right") - 1
    odd = np.isin(clip, np.unique(clip)[::2])
    return tuple(_some(each, rng) for each in (starts, starts[odd], starts[~odd]))


def _some(values: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    return values if len(values) <= MOST else rng.choice(values, MOST, replace=False)


def walked_features(bundle: Path, policy: Path, walk: Walk) -> np.ndarray:
    """Features (t - 2, f) of the last MEASURE_S of a walk, t control steps.

    Raises TrainingError for a fall, FileError for a policy that can't be read or is of another robot.
    """
    world = World(bundle, policy, walk)
    index = np.array([world.facts["joint_names"].index(name) for name in world.facts["controlled"]])
    ends = [world.model.site(name).id for name in (*world.facts["hands"], *world.facts["feet"])]
    steps, rows = round(walk.seconds / STEP_S), []
    first = steps - round(MEASURE_S / STEP_S)
    for step in range(steps):
        if step % CONTROL_EVERY == 0:
            world.decide()
        world.step()
        if world.fell:
            raise TrainingError(f"{policy}: falls at the command {walk.command} after {world.data.time:.1f} s.")
        if step % CONTROL_EVERY == CONTROL_EVERY - 1 and step >= first:
            data, rotation = world.data, world.data.xmat[world.root].reshape(3, 3)
            rows.append([data.xpos[world.root].copy(), rotation.copy(), data.qpos[7:][index], data.site_xpos[ends]])
    states = positions(*(torch.from_numpy(np.array(column)) for column in zip(*rows, strict=True)))
    return state_features(states.unfold(0, 3, 1).mT).numpy()


def windows_of(features: np.ndarray, starts: np.ndarray, normalize: FeatureNormalizer) -> np.ndarray:
    """Normalized windows (n, h f) from the rows of features at `starts`."""
    rows = features[starts[:, None] + STRIDE * np.arange(WINDOW)]
    return normalize(torch.from_numpy(rows).to(normalize.mean)).numpy()


def style_distances(
    bundle: Path, policies: Sequence[Path], seeds: Sequence[int]
) -> dict[str, dict[float, list[float]]]:
    """Of each policy at each speed, one a seed; `expert` is that between halves of the clips, NaN for a single clip.

    NaN, with a line on stderr, where the policy falls or no clip has the speed.
    """
    whole, rng = read_bundle(bundle), np.random.default_rng(0)
    expert, features = whole.expert, frame_features(torch.from_numpy(whole.expert.frames))
    normalize = FeatureNormalizer(features, floors(len(whole.robot.controlled)))
    found: dict[str, dict[float, list[float]]] = {name: {} for name in ("expert", *map(str, policies))}
    for speed in SPEEDS:
        try:
            starts = expert_sets(expert, (speed, 0.0, 0.0), rng)
        except TrainingError as error:
            print(error, file=sys.stderr)
            for each in found.values():
                each[speed] = [math.nan]
            continue
        sets = [windows_of(features.numpy(), each, normalize) for each in starts]
        found["expert"][speed] = [energy_distance(sets[1], sets[2])]
        for policy in policies:
            found[str(policy)][speed] = []
            for seed in seeds:
                walk, distance = Walk(command=(speed, 0.0, 0.0), seed=seed), math.nan
                try:
                    walked = walked_features(bundle, policy, walk)
                    first = np.arange(len(walked) - (WINDOW - 1) * STRIDE)
                    distance = energy_distance(windows_of(walked, first, normalize), sets[0])
                except TrainingError as error:
                    print(error, file=sys.stderr)
                found[str(policy)][speed].append(distance)
    return found


def main(arguments: Sequence[str]) -> int:
    """Print a row a policy, `nan` where it falls; exit status 2 for what can't be read or is of another robot."""
    prog, form = "python -m pipeline.training.style_distance", argparse.RawDescriptionHelpFormatter
    parser = argparse.ArgumentParser(prog=prog, description=__doc__, formatter_class=form)
    parser.add_argument("policies", type=Path, nargs="+")
    parser.add_argument("--bundle", type=Path, required=True)
    parser.add_argument("--seeds", type=int, default=3)
    given = parser.parse_args(arguments)
    try:
        found = style_distances(given.bundle, given.policies, range(given.seeds))
    except (FileError, TrainingError) as error:
        print(error, file=sys.stderr)
        return 2
    for name, speeds in found.items():
        cells = [f"{speed}: {np.mean(each):.3f} ± {np.std(each):.3f}" for speed, each in speeds.items()]
        print(f"{name}: {', '.join(cells)}")
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
