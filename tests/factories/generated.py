"""The shipped motions, generated once a test run, and a reader of BVH that shares no code with the project's."""

from __future__ import annotations

import functools
from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from pipeline.generator import RECIPES, Generated, generate
from pipeline.generator.command import Level, Recipe
from pipeline.generator.recipes import DEFECTS, make_defect


@functools.cache
def shipped(name: str) -> Generated:
    """A sound motion that ships with the project."""
    return generate(RECIPES[name])


@functools.cache
def spoilt(name: str) -> str:
    """Text of a shipped file with a planted defect."""
    return make_defect(DEFECTS[name])[1]


@functools.cache
def steady(gait: str, forward: float) -> Generated:
    """Three seconds at one speed."""
    levels = (Level(hold_s=3.0, forward=forward),)
    return generate(Recipe(name="steady", what="", levels=levels, seed=0, gait=gait))


@dataclass(frozen=True, kw_only=True)
class Bvh:
    """A parsed file; vectors in the file's axes (y up) [m]."""

    fps: float
    positions: dict[str, np.ndarray]
    """Joint -> (t, 3) [m]."""
    angles_deg: dict[str, np.ndarray]
    """Joint -> (t, 3), in the order of its channels."""


def parse_bvh(text: str) -> Bvh:
    """Joint positions by recursion over the hierarchy, rotations by scipy."""
    head, _, motion = text.partition("MOTION\n")
    lines = motion.splitlines()
    assert lines[0] == f"Frames: {len(lines) - 2}"
    rows = np.array([line.split() for line in lines[2:]], dtype=float)
    words, column, stack = iter(head.split()), 0, []
    positions, angles, turns = {}, {}, {}
    for word in words:
        if word in ("ROOT", "JOINT", "End"):
            stack.append(next(words))
        elif word == "}":
            stack.pop()
        elif word == "OFFSET":
            offset = np.array([float(next(words)) for _ in range(3)]) / 100.0
        elif word == "CHANNELS":
            names = [next(words) for _ in range(int(next(words)))]
            values = rows[:, column : column + len(names)]
            column += len(names)
            order = "".join(name[0] for name in names if name.endswith("rotation"))
            joint, angles[stack[-1]] = stack[-1], values[:, -3:]
            local = Rotation.from_euler(order, values[:, -3:], degrees=True)
            if len(stack) == 1:
                positions[joint], turns[joint] = values[:, :3] / 100.0, local
            else:
                parent = stack[-2]
                positions[joint] = positions[parent] + turns[parent].apply(offset)
                turns[joint] = turns[parent] * local
    assert column == rows.shape[1]
    return Bvh(fps=1.0 / float(lines[1].removeprefix("Frame Time: ")), positions=positions, angles_deg=angles)
