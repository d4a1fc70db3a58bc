"""Compare two models of one robot joint by joint. Joints are matched by position, so that renamed ones are found."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from pipeline import rotation
from pipeline.robot.build import build_tree
from pipeline.robot.description import Description
from pipeline.robot_import.maker_model import MakerJoint, MakerLink, MakerModel

PLACE = 0.05
"""Largest distance of matched joints' origins, all joints at zero [m]."""
AXIS = 0.9
"""Least cosine between matched axes."""
JOINT = "joint"
"""Figure of a joint that only one model has."""
RELATIVE, ABSOLUTE = 1e-4, 1e-7
"""Numbers that differ by less are equal."""


@dataclass(frozen=True, kw_only=True)
class Difference:
    """One value that differs. None: not stated by the model."""

    name: str
    """Joint or link of the first model."""
    figure: str
    unit: str
    first: object
    second: object

    @property
    def of_both(self) -> bool:
        """Whether both models state the figure."""
        return self.first is not None and self.second is not None

    def __str__(self) -> str:
        return f"{self.name}: {self.figure} {_text(self.first)}, there {_text(self.second)} {self.unit}".rstrip() + "."


def model_of(description: Description, rendered: bool = False) -> MakerModel:
    """The tables of a robot folder as a model: with the maker's speed limits, or with those that are rendered."""
    tree = build_tree(description)
    rows = description.joint_rows
    links = []
    for place, row in enumerate(description.links):
        joint = None
        if row.joint:
            values = rows[row.joint]
            speed = values.speed if rendered else values.urdf_speed
            stated = {name: getattr(values, name) for name in ("lower", "upper", "torque", "armature")}
            joint = MakerJoint(name=row.joint, axis=tree.axis[place], speed=speed, **stated)
        links.append(
            MakerLink(
                name=row.link,
                parent=int(tree.parent[place]),
                joint=joint,
                pos=tree.pos[place],
                quat=tree.quat[place],
                mass=row.mass,
                com=np.array(row.numbers("com_x", "com_y", "com_z")),
                inertia=row.inertia,
            )
        )
    return MakerModel(path=description.folder, links=tuple(links), shapes=(), sites=(), notes=())


def match(first: MakerModel, second: MakerModel) -> dict[int, int]:
    """Links of `first` -> links of `second` at the same position below matched parents."""
    (places, turns), (other_places, other_turns) = first.origins(), second.origins()
    pairs = {0: 0}
    taken = {0}
    for index, link in enumerate(first.links[1:], start=1):
        if link.parent not in pairs or link.joint is None:
            continue
        candidates = []
        for other in second.children(pairs[link.parent]):
            joint = second.links[other].joint
            if other in taken or joint is None:
                continue
            axis = rotation.rotate(turns[index], link.joint.axis)
            other_axis = rotation.rotate(other_turns[other], joint.axis)
            away = float(np.linalg.norm(places[index] - other_places[other]))
            if away < PLACE and abs(float(axis @ other_axis)) > AXIS:
                candidates.append((joint.name != link.joint.name, away, other))
        if candidates:
            pairs[index] = min(candidates)[2]
            taken.add(pairs[index])
    return pairs


def compare(first: MakerModel, second: MakerModel) -> list[Difference]:
    """Differences in the order of the first model's links; joints that exist in only one model come last."""
    pairs = match(first, second)
    found: list[Difference] = []
    for index, other in pairs.items():
        found += _link(first.links[index], second.links[other])
    for index, link in enumerate(first.links):
        if index not in pairs and link.joint:
            found.append(Difference(name=link.joint.name, figure=JOINT, unit="", first="stated", second=None))
    for index, link in enumerate(second.links):
        if index not in pairs.values() and link.joint:
            found.append(Difference(name=link.joint.name, figure=JOINT, unit="", first=None, second="stated"))
    return found


def _link(first: MakerLink, second: MakerLink) -> list[Difference]:
    figures: list[tuple[str, str, str, object, object]] = []
    a, b = first.joint, second.joint
    if a is not None and b is not None:
        figures += [
            (a.name, "name", "", a.name, b.name),
            (a.name, "axis", "", a.axis, b.axis),
            (a.name, "origin", "m", first.pos, second.pos),
            (a.name, "orientation (wxyz)", "", first.quat, second.quat),
            *((a.name, name, unit, getattr(a, name), getattr(b, name)) for name, unit in _JOINT),
        ]
    figures += [
        (first.name, "link's name", "", first.name, second.name),
        (first.name, "mass", "kg", first.mass, second.mass),
        (first.name, "centre of mass", "m", first.com, second.com),
        (first.name, "inertia", "kg m^2", first.inertia, second.inertia),
    ]
    return [
        Difference(name=name, figure=figure, unit=unit, first=one, second=other)
        for name, figure, unit, one, other in figures
        if not _equal(one, other)
    ]


_JOINT = (("lower", "rad"), ("upper", "rad"), ("torque", "N m"), ("speed", "rad/s"), ("armature", "kg m^2"))


def _equal(first: Any, second: Any) -> bool:
    if first is None or second is None or isinstance(first, str):
        return first == second
    one, other = np.asarray(first, dtype=float), np.asarray(second, dtype=float)
    if one.shape != other.shape:
        return False
    scale = float(max(np.abs(one).max(), np.abs(other).max())) if one.size > 1 else 0.0
    return bool(np.allclose(one, other, rtol=RELATIVE, atol=max(ABSOLUTE, RELATIVE * scale)))


def _text(value: object) -> str:
    if value is None:
        return "not stated"
    if isinstance(value, str):
        return value
    numbers = np.asarray(value, dtype=float)
    if numbers.shape == (3, 3):
        numbers = numbers[np.triu_indices(3)]
    return " ".join(f"{number + 0.0:.5g}" for number in np.atleast_1d(numbers))
