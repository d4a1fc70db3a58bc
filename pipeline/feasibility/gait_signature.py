"""What a motion looks like whatever its side, its speed and its phase: near-duplicates have nearly the same numbers.

Of each pair of joints, left and right: the mean angle and the spread about it over the clip, of both sides together
and how far the sides differ. A mirror exchanges the sides and playing faster changes no angle, so neither changes
the signature; a copy, a repeat and another stretch of the same steady gait change it little.

A clip carries it as one text, `gait_signature`: JSON, a list of angles [rad].
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
    """The text of a motion."""
    return json.dumps(np.round(gait_signature(clip, robot), 4).tolist())


def gait_signature(clip: RobotClip, robot: Robot) -> Float[np.ndarray, " k"]:
    """Mean and spread of the controlled joints [rad], both sides together and how far they differ."""
    one_side = [joint for joint in robot.controlled_index if joint <= robot.mirror_index[joint]]
    here = clip.joint_pos[:, one_side]
    there = (clip.joint_pos[:, robot.mirror_index] * robot.mirror_sign)[:, one_side]
    pairs = ((here.mean(axis=0), there.mean(axis=0)), (here.std(axis=0), there.std(axis=0)))
    return np.concatenate([part for a, b in pairs for part in (0.5 * (a + b), 0.5 * np.abs(a - b))])


def families(rows: pd.DataFrame, parent: pd.Series, same_gait: float) -> pd.Series:
    """The family of each clip: its parent's, and that of all parents which are the same gait; named after the first.

    Args:
        rows: a row a clip, with `gait_signature` where it is known
        parent: the motion each row is a variant or a piece of
        same_gait: root mean square [rad] by which the signatures of two parents, each the mean over its clips, may
            differ; parents are of one family, too, through others between them
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
    """Mean signature of each parent that has one, by the number of joints: places of the parents, their signatures."""
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
