"""Gait signature: numbers that are nearly equal for near-duplicates, invariant to side, speed and phase.

For each left-right pair of joints: mean angle and standard deviation over the clip, as the average of both sides and
the difference between them. Mirroring exchanges the sides and time scaling changes no angle, so neither changes the
signature; copies, repetitions and other parts of the same steady gait change it little.

It is stored with a clip as the text `gait_signature`: JSON, a list of angles [rad].
"""

import json
from collections import defaultdict

import msgspec
import numpy as np
import pandas as pd
from jaxtyping import Float, Int
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from pipeline.clips.robot_clip import RobotClip
from pipeline.robot import Robot

COLUMN = "gait_signature"


def gait_signature_text(clip: RobotClip, robot: Robot) -> str:
    """The gait signature of a motion as JSON."""
    return json.dumps(np.round(gait_signature(clip, robot), 4).tolist())


def gait_signature(clip: RobotClip, robot: Robot) -> Float[np.ndarray, " k"]:
    """Mean and standard deviation of the controlled joints [rad]: average of both sides, then their difference."""
    one_side = [joint for joint in robot.controlled_index if joint <= robot.mirror_index[joint]]
    here = clip.joint_pos[:, one_side]
    there = (clip.joint_pos[:, robot.mirror_index] * robot.mirror_sign)[:, one_side]
    pairs = ((here.mean(axis=0), there.mean(axis=0)), (here.std(axis=0), there.std(axis=0)))
    return np.concatenate([part for a, b in pairs for part in (0.5 * (a + b), 0.5 * np.abs(a - b))])


def families(rows: pd.DataFrame, parent: pd.Series, same_gait: float) -> pd.Series:
    """Family of each clip: clips of one parent, and of all parents with the same gait; named after the first parent.

    Args:
        rows: one row per clip, with `gait_signature` where it is known
        parent: the motion that each row is a variant or a piece of
        same_gait: largest RMS difference [rad] between the signatures of two parents (each the mean over its clips) of
            one family; families are closed under this relation (single linkage)
    """
    names, place = np.unique(parent.to_numpy(dtype=str), return_inverse=True)
    first, second = [], []
    for members, signatures in _signatures_of(rows, place):
        radius = same_gait * np.sqrt(signatures.shape[1])
        near = cKDTree(signatures).query_pairs(radius, output_type="ndarray")
        first.append(members[near[:, 0]])
        second.append(members[near[:, 1]])
    one, other = (np.concatenate([np.zeros(0, dtype=int), *ends]) for ends in (first, second))
    graph = coo_array((np.ones(len(one)), (one, other)), shape=(len(names), len(names)))
    _, label = connected_components(graph, directed=False)
    named = {int(group): name for group, name in zip(label[::-1], names[::-1], strict=True)}
    return pd.Series([named[int(label[index])] for index in place], index=rows.index, dtype=object)


def _signatures_of(
    rows: pd.DataFrame, place: Int[np.ndarray, " n"]
) -> list[tuple[Int[np.ndarray, " p"], Float[np.ndarray, "p k"]]]:
    """Mean signatures of parents, grouped by signature length: indices of the parents, and their signatures."""
    if COLUMN not in rows:
        return []
    of_parent: defaultdict[tuple[int, int], list[np.ndarray]] = defaultdict(list)
    for index, text in zip(place, rows[COLUMN], strict=True):
        if isinstance(text, str):
            signature = np.array(msgspec.json.decode(text), dtype=float)
            of_parent[len(signature), int(index)].append(signature)
    found = []
    for length in sorted({length for length, _ in of_parent}):
        means = {index: np.mean(each, axis=0) for (size, index), each in of_parent.items() if size == length}
        found.append((np.array(list(means)), np.array(list(means.values()))))
    return found
