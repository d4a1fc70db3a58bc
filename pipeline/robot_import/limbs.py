"""Identify the links of legs, arms and head, from the shape of the tree and the ends of the limbs.

Names are not used: the two limbs that mirror each other and end lowest are the legs, the next two the arms.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from pipeline import rotation
from pipeline.errors import FileError
from pipeline.robot_import.maker_model import MakerModel, corner_points

MIDDLE = 0.02
"""Mean distance of a limb's links to the x-z plane below which it is a central limb [m]."""
PARTNER = 0.03
"""Largest distance of a limb's first joint from the mirror image of its partner's [m]."""
BEND = 3
"""Position of the knee and of the elbow in a limb: after three joints of hip or shoulder."""


Limb = tuple[int, ...]
"""Link indices from the body outwards. A hand with fingers is the last link."""


@dataclass(frozen=True, kw_only=True)
class Body:
    """The parts of a humanoid. Pairs are (left, right); left is towards +y."""

    legs: tuple[Limb, Limb]
    arms: tuple[Limb, Limb]
    trunk: int
    """The link that both arms are attached to."""
    pelvis: int
    """The link that both legs are attached to."""
    others: tuple[int, ...]
    """Links of the head, of fingers and of other parts beyond trunk, pelvis, legs and arms."""


def find_body(model: MakerModel) -> Body:
    """Find the parts. Raises FileError if no legs and arms of four joints or more can be distinguished."""
    origins, turns = model.origins()
    middle = _middle_links(model, origins)
    roots = [child for link in middle for child in model.children(link) if child not in middle]
    limbs = [limb for limb in (_limb(model, root) for root in roots) if len(limb) > BEND]
    pairs = []
    for first in limbs:
        for second in limbs:
            image = origins[second[0]] * np.array([1.0, -1.0, 1.0])
            near = np.linalg.norm(origins[first[0]] - image) < PARTNER
            if near and origins[first[0], 1] > 0.0 and len(first) == len(second):
                pairs.append((first, second))
    pairs.sort(key=lambda pair: _lowest(model, pair[0], origins, turns))
    if len(pairs) < 2:
        found = ", ".join(model.links[limb[0]].name for limb in limbs) or "none"
        problem = f"two legs and two arms of at least {BEND + 1} joints are not found; limbs begin at: {found}."
        do = "Left and right must mirror each other in the x-z plane, all joints at zero."
        raise FileError(model.path, problem, do)
    legs, arms = pairs[0], pairs[1]
    used = {link for pair in (legs, arms) for limb in pair for link in limb}
    trunk, pelvis = (_common_parent(model, pair) for pair in (arms, legs))
    between = {*_path(model, trunk), *_path(model, pelvis)}
    others = tuple(index for index in range(len(model.links)) if index not in used | between)
    return Body(legs=legs, arms=arms, trunk=trunk, pelvis=pelvis, others=others)


def _middle_links(model: MakerModel, origins: Float[np.ndarray, "l 3"]) -> set[int]:
    """Links that carry limbs of both sides, and the links between them and the root."""
    sides: list[set[int]] = []
    for index in range(len(model.links)):
        below = [link for link in range(len(model.links)) if index in _path(model, link) and not model.children(link)]
        sides.append({int(np.sign(origins[link, 1])) for link in below if abs(origins[link, 1]) > MIDDLE})
    return {index for index, each in enumerate(sides) if each == {-1, 1}} | {0}


def _path(model: MakerModel, link: int) -> list[int]:
    """The link and its ancestors."""
    path = [link]
    while model.links[path[-1]].parent >= 0:
        path.append(model.links[path[-1]].parent)
    return path


def _limb(model: MakerModel, root: int) -> Limb:
    links = [root]
    while len(children := model.children(links[-1])) == 1:
        links += children
    return tuple(links)


def _common_parent(model: MakerModel, pair: tuple[Limb, Limb]) -> int:
    """The link that both limbs of a pair are attached to: their lowest common ancestor."""
    left, right = (_path(model, model.links[limb[0]].parent) for limb in pair)
    return next(link for link in left if link in right)


def _lowest(model: MakerModel, limb: Limb, origins: Float[np.ndarray, "l 3"], turns: Float[np.ndarray, "l 4"]) -> float:
    """Height of the lowest point of a limb's last link in the root frame [m]."""
    name = model.links[limb[-1]].name
    points = [corner_points(shape) for shape in model.shapes if shape.link == name]
    heights = [float((origins[limb[-1]] + rotation.rotate(turns[limb[-1]], each))[:, 2].min()) for each in points]
    return min(heights, default=float(origins[limb[-1], 2]))
