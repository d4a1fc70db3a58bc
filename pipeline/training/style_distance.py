"""Style distance between a policy's walk and the expert frames at the same command, without a discriminator.

    python -m pipeline.training.style_distance --bundle DIR POLICY.npz ... [--seeds N]

Windows of four frames, 0.06 s apart, of motion features (`amp/features.py`) are compared, each feature divided by its
standard deviation over all expert frames. The distance of two sets of windows is the energy distance (Székely and
Rizzo 2013), sqrt(2 E|x - y| - E|x - x'| - E|y - y'|), with norms divided by the root of the number of features: 0 for
equal distributions, sqrt(2 d) for two points that differ by d standard deviations in every feature. The row `expert` is
the distance between two halves of the clips.
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
"""Compared forward commands [m/s]."""
NEAR = (0.2, 0.15, 0.3)
"""Largest difference between an expert window's command and the policy's [m/s, m/s, rad/s]."""
WINDOW, STRIDE = 4, 3
MAX_WINDOWS = 1500
"""Windows per set; larger sets are subsampled."""


def energy_distance(first: np.ndarray, second: np.ndarray) -> float:
    """Energy distance of two samples (n, f) and (m, f), norms divided by sqrt(f); NaN if either is empty."""
    if not (len(first) and len(second)):
        return math.nan
    between, within = cdist(first, second).mean(), [_within(each) for each in (first, second)]
    return float(np.sqrt(max(0.0, (2.0 * between - sum(within)) / np.sqrt(first.shape[1]))))


def _within(sample: np.ndarray) -> float:
    count = len(sample)
    return cdist(sample, sample).sum() / max(count * (count - 1), 1)


def expert_sets(expert: ExpertFrames, command: Sequence[float], rng: np.random.Generator) -> tuple[np.ndarray, ...]:
    """First frames of windows near a command: of all clips, and of two disjoint halves of the clips.

    With a single clip the second half is empty. Raises TrainingError if no window is near the command.
    """
    starts = window_starts(expert, (WINDOW - 1) * STRIDE + 1)
    starts = starts[(np.abs(expert.command[starts] - np.array(command)) <= np.array(NEAR)).all(axis=1)]
    if not len(starts):
        raise TrainingError(f"the expert database has no frame near the command {tuple(command)}.")
    clip = np.searchsorted(expert.clip_start, starts, side="right") - 1
    half = np.isin(clip, np.unique(clip)[::2])
    return tuple(_subsample(each, rng) for each in (starts, starts[half], starts[~half]))


def _subsample(values: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    return values if len(values) <= MAX_WINDOWS else rng.choice(values, MAX_WINDOWS, replace=False)


def walk_features(bundle: Path, policy: Path, walk: Walk) -> np.ndarray:
    """Features (t - 2, f) of the last MEASURE_S of a walk, t control steps.

    Raises TrainingError for a fall, FileError for a policy that can't be read or belongs to another robot.
    """
    world = World(bundle, policy, walk)
    index = np.array([world.facts["joint_names"].index(name) for name in world.facts["controlled"]])
    ends = [world.model.site(name).id for name in (*world.facts["hands"], *world.facts["feet"])]
    steps, rows = round(walk.seconds / STEP_S), []
    first = steps - round(MEASURE_S / STEP_S)
    for step in range(steps):
        if step % CONTROL_EVERY == 0:
            world.update_targets()
        world.step()
        if world.fell:
            raise TrainingError(f"{policy}: falls at the command {walk.command} after {world.data.time:.1f} s.")
        if step % CONTROL_EVERY == CONTROL_EVERY - 1 and step >= first:
            data, rotation = world.data, world.data.xmat[world.root].reshape(3, 3)
            rows.append([data.xpos[world.root].copy(), rotation.copy(), data.qpos[7:][index], data.site_xpos[ends]])
    states = positions(*(torch.from_numpy(np.array(column)) for column in zip(*rows, strict=True)))
    return state_features(states.unfold(0, 3, 1).mT).numpy()


def windows_of(features: np.ndarray, starts: np.ndarray, normalize: FeatureNormalizer) -> np.ndarray:
    """Normalized windows (n, h f) that begin at the rows `starts` of the features."""
    rows = features[starts[:, None] + STRIDE * np.arange(WINDOW)]
    return normalize(torch.from_numpy(rows).to(normalize.mean)).numpy()


def style_distances(
    bundle: Path, policies: Sequence[Path], seeds: Sequence[int]
) -> dict[str, dict[float, list[float]]]:
    """Style distance of each policy at each speed and seed; `expert`: between halves of the clips, NaN for one clip.

    NaN, with a line on stderr, if the policy falls or no clip has the speed.
    """
    whole, rng = read_bundle(bundle), np.random.default_rng(0)
    expert, features = whole.expert, frame_features(torch.from_numpy(whole.expert.frames))
    normalize = FeatureNormalizer(features, floors(len(whole.robot.controlled)))
    distances: dict[str, dict[float, list[float]]] = {name: {} for name in ("expert", *map(str, policies))}
    for speed in SPEEDS:
        try:
            starts = expert_sets(expert, (speed, 0.0, 0.0), rng)
        except TrainingError as error:
            print(error, file=sys.stderr)
            for each in distances.values():
                each[speed] = [math.nan]
            continue
        sets = [windows_of(features.numpy(), each, normalize) for each in starts]
        distances["expert"][speed] = [energy_distance(sets[1], sets[2])]
        for policy in policies:
            distances[str(policy)][speed] = []
            for seed in seeds:
                walk, distance = Walk(command=(speed, 0.0, 0.0), seed=seed), math.nan
                try:
                    walked = walk_features(bundle, policy, walk)
                    first = np.arange(len(walked) - (WINDOW - 1) * STRIDE)
                    distance = energy_distance(windows_of(walked, first, normalize), sets[0])
                except TrainingError as error:
                    print(error, file=sys.stderr)
                distances[str(policy)][speed].append(distance)
    return distances


def main(arguments: Sequence[str]) -> int:
    """Print one row per policy, `nan` for a fall; exit status 2 for an unreadable policy or one of another robot."""
    prog, form = "python -m pipeline.training.style_distance", argparse.RawDescriptionHelpFormatter
    parser = argparse.ArgumentParser(prog=prog, description=__doc__, formatter_class=form)
    parser.add_argument("policies", type=Path, nargs="+")
    parser.add_argument("--bundle", type=Path, required=True)
    parser.add_argument("--seeds", type=int, default=3)
    args = parser.parse_args(arguments)
    try:
        distances = style_distances(args.bundle, args.policies, range(args.seeds))
    except (FileError, TrainingError) as error:
        print(error, file=sys.stderr)
        return 2
    for name, speeds in distances.items():
        cells = [f"{speed}: {np.mean(each):.3f} ± {np.std(each):.3f}" for speed, each in speeds.items()]
        print(f"{name}: {', '.join(cells)}")
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
