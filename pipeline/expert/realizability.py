"""Realizability: held-out accuracy of a small network that classifies motions and simulated rollouts.

0.5 means indistinguishable. 1.0 means that no physically simulated motion resembles the motions, so an adversarial
discriminator gives no useful signal (classifier two-sample test, Lopez-Paz and Oquab, ICLR 2017).
"""

import itertools
import logging
from collections.abc import Iterable, Mapping, Sequence

import numpy as np
from jaxtyping import Float

from pipeline import rotation, time_series
from pipeline.batch import ClipPool, Entry, Manifest, Stage, Store, run_stage
from pipeline.batch.code_version import code_version
from pipeline.clips.robot_clip import RobotClip
from pipeline.errors import PipelineError
from pipeline.files import digest
from pipeline.robot import Robot

NAME, ACCURACY = "realizability", "accuracy"
"""Names of the memo's stage and of its number."""
WINDOW = 10
"""Length of a window [frames at 50 Hz]."""
STEP = 5
"""Distance between the starts of windows [frames]."""
HIDDEN = (256, 128)
STEPS, BATCH, LEARNING_RATE = 400, 512, 1e-3
TESTED_SHARE = 0.3
"""Share of the families in the test set."""
REFERENCES = 60
"""Number of references that are rolled out with another seed."""
SECONDS = 6.0
"""Longest such rollout [s]."""


class TooFewMotionsError(PipelineError):
    """Raised if there are too few families for a held-out test set."""


def accuracy_against_rollouts(
    clips: Manifest,
    references: Manifest,
    stage: Stage,
    robot: Robot,
    store: Store,
    pool: ClipPool,
    log: logging.Logger,
    seed: int = 0,
) -> float:
    """Held-out accuracy between clips and rollouts of their references with another seed.

    Rollouts and accuracies are cached.

    Args:
        clips: clips whose numbers name the `reference`, or references themselves
        references: tracked motions
        stage: stage that makes the rollouts with the other seed
        robot: robot of the clips
        store: store with the motions of both manifests
        pool: processes for the rollouts
        log: log function of the stage
        seed: seed of the choice of references, the split, the network and the batches

    Raises TooFewMotionsError.
    """
    known = {_reference(entry) for entry in clips.entries}
    taken = _chosen([entry for entry in references.entries if entry.clip in known], seed)
    if not taken:
        raise TooFewMotionsError("No motion was rolled out.")
    rolled = run_stage(stage, references, store, pool, log, taken).entries
    names = {entry.clip for entry in taken}
    motions = [entry for entry in clips.entries if _reference(entry) in names]
    named = [[(entry.clip, entry.blob) for entry in entries] for entries in (motions, rolled)]
    question = digest.of_json([NAME, code_version("expert"), robot.digest, seed, named])
    asker = f"{robot.name}/{NAME}"
    known = store.recall(question, asker)
    if known is not None:
        return float(known[ACCURACY])
    accuracy = held_out_accuracy(_by_family(motions, store), _by_family(rolled, store), robot, seed)
    store.remember(question, {ACCURACY: accuracy, "pieces": []}, asker)
    return accuracy


def _by_family(entries: Iterable[Entry], store: Store) -> dict[str, list[RobotClip]]:
    found: dict[str, list[RobotClip]] = {}
    for entry in entries:
        found.setdefault(_family(entry.clip), []).append(_clip(entry, store))
    return found


def _chosen(references: Sequence[Entry], seed: int) -> list[Entry]:
    """Select `REFERENCES` references by digests of their names, so that a new one replaces at most one other."""
    return sorted(references, key=lambda entry: digest.of_json([seed, entry.clip]))[:REFERENCES]


def _clip(entry: Entry, store: Store) -> RobotClip:
    clip = store.get_clip(entry.blob, entry.clip)
    assert isinstance(clip, RobotClip)
    return clip


def _reference(entry: Entry) -> str:
    """Name of the reference that a clip tracked, or the clip's own name."""
    return str(entry.numbers.get("reference") or entry.clip)


def _family(clip: str) -> str:
    """The source window of a clip: its name before the first variant suffix."""
    return clip.split("~")[0]


def held_out_accuracy(
    motions: Mapping[str, Sequence[RobotClip]],
    rollouts: Mapping[str, Sequence[RobotClip]],
    robot: Robot,
    seed: int,
) -> float:
    """Balanced accuracy of a window classifier on held-out families.

    Args:
        motions: clips by family; clips of one source motion are one family
        rollouts: simulated rollouts by the same families
        robot: robot of the clips
        seed: seed of the split, the network and the batches

    Raises TooFewMotionsError with fewer than four common families.
    """
    families = sorted(set(motions) & set(rollouts))
    if len(families) < 4:
        raise TooFewMotionsError(f"{len(families)} families have motions and rollouts; at least 4 are needed.")
    rng = np.random.default_rng(seed)
    order = rng.permutation(len(families))
    count = max(round(TESTED_SHARE * len(families)), 1)
    tested = [families[index] for index in order[:count]]
    trained = [families[index] for index in order[count:]]
    sets = [
        [
            np.concatenate([windows(clip, robot) for name in names for clip in source[name]])
            for source in (motions, rollouts)
        ]
        for names in (trained, tested)
    ]
    return _accuracy(sets[0], sets[1], seed)


def windows(clip: RobotClip, robot: Robot) -> Float[np.ndarray, "w f"]:
    """Windows of a 50 Hz clip: joint angles and velocities, root height, and gravity and velocities in the root
    frame."""
    moved = robot.controlled_index
    features = np.concatenate(
        [
            clip.joint_pos[:, moved],
            clip.joint_vel()[:, moved],
            clip.root_pos_w[:, 2:],
            rotation.rotate_inverse(clip.root_quat_w, np.array([0.0, 0.0, -1.0])),
            rotation.rotate_inverse(clip.root_quat_w, time_series.derivative(clip.root_pos_w, clip.fps)),
            rotation.rotate_inverse(clip.root_quat_w, clip.root_ang_vel_w()),
        ],
        axis=1,
    )
    starts = np.arange(0, len(features) - WINDOW + 1, STEP)
    return (
        np.stack([features[start : start + WINDOW].ravel() for start in starts])
        if len(starts)
        else np.zeros((0, WINDOW * features.shape[1]))
    )


def _accuracy(train: Sequence[np.ndarray], test: Sequence[np.ndarray], seed: int) -> float:
    """Accuracy of a network trained on windows of both kinds; on one thread, which is as fast as several for such a
    small network and independent of the machine's load."""
    import torch

    threads = torch.get_num_threads()
    torch.set_num_threads(1)
    try:
        with torch.random.fork_rng():
            torch.manual_seed(seed)
            return _trained_accuracy(train, test)
    finally:
        torch.set_num_threads(threads)


def _trained_accuracy(train: Sequence[np.ndarray], test: Sequence[np.ndarray]) -> float:
    import torch

    mean, scale = train[0].mean(axis=0), train[0].std(axis=0) + 1e-3
    known, held = (
        [torch.from_numpy(((part - mean) / scale).astype(np.float32)) for part in parts] for parts in (train, test)
    )
    sizes = (known[0].shape[1], *HIDDEN)
    layers: list[torch.nn.Module] = []
    for inputs, outputs in itertools.pairwise(sizes):
        layers += [torch.nn.Linear(inputs, outputs), torch.nn.ReLU()]
    network = torch.nn.Sequential(*layers, torch.nn.Linear(HIDDEN[-1], 1))
    optimizer = torch.optim.Adam(network.parameters(), lr=LEARNING_RATE)
    labels = torch.cat([torch.ones(BATCH // 2), torch.zeros(BATCH // 2)])
    for _ in range(STEPS):
        batch = torch.cat([part[torch.randint(len(part), (BATCH // 2,))] for part in known])
        loss = torch.nn.functional.binary_cross_entropy_with_logits(network(batch)[:, 0], labels)
        optimizer.zero_grad()
        loss.backward()
        optimizer.step()
    with torch.no_grad():
        right = [float((network(part)[:, 0] > 0.0).float().mean()) for part in held]
    return 0.5 * (right[0] + 1.0 - right[1])
