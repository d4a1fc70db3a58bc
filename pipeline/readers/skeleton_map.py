"""Skeleton maps: joints of canonical bodies, and the bodies' axes in the joints' frames.

There is one YAML file per skeleton in `skeletons/`. A map is selected by the joint names of a motion, not by its file
name: all joints in the map must exist. docs/sources.md describes how to write one.
"""

import functools
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from jaxtyping import Float

from pipeline import rotation
from pipeline.clips.human_clip import BODIES
from pipeline.errors import FileError, SettingsError
from pipeline.files import settings
from pipeline.readers.raw_motion import RawMotion

FOLDER = Path(__file__).parent / "skeletons"

AXES = dict(zip(("x", "y", "z", "-x", "-y", "-z"), [*np.eye(3), *-np.eye(3)], strict=True))
PARALLEL = np.cos(np.deg2rad(3.0))
"""Cosine from which two directions of a body are parallel, so that they do not determine its axes."""
CANONICAL = {"ahead": AXES["x"], "left": AXES["y"], "up": AXES["z"], "down": AXES["-z"]}


@dataclass(frozen=True, kw_only=True)
class BodyMap:
    """One canonical body in a skeleton. Two of `ahead`, `left`, `up`, `down` give its axes.

    Each is an axis of the joint's frame (`x`, `-y`, …), a vector in it (`"0 0.87 -0.5"`), or the name of a joint below
    it (the direction to that joint at rest). The direction to a joint is kept exactly, the other one is made
    orthogonal.
    """

    joint: str
    ahead: str | None = None
    left: str | None = None
    up: str | None = None
    down: str | None = None
    pitch_deg: float = 0.0
    """Rotation about the body's left axis that levels the body of an upright person [deg], forward positive."""
    offset: tuple[float, float, float] = (0.0, 0.0, 0.0)
    """For a body that the skeleton lacks: its offset from `joint`, in the body's own frame [m]."""

    def directions(self) -> dict[str, str]:
        """Stated axes: canonical direction -> axis or joint."""
        return {name: value for name in CANONICAL if (value := getattr(self, name)) is not None}


@dataclass(frozen=True, kw_only=True)
class SkeletonMap:
    """Map from one family of skeletons to the canonical one."""

    title: str
    """Description of the skeleton."""
    bodies: dict[str, BodyMap]
    """Canonical body -> its joint and axes; all 19."""
    name: str = ""
    """Name of the map's file."""
    also: tuple[str, ...] = ()
    """Further required joints, to distinguish skeletons with similar names."""

    rest: dict[str, tuple[float, float, float]] = field(default_factory=dict)
    """Joints and their rest offsets in the file's unit, for a skeleton that differs only in its proportions."""

    def fits(self, motion: RawMotion) -> bool:
        """Whether all joints exist and the stated rest offsets agree with the motion's (1 %)."""
        place = dict(zip(motion.joint_names, motion.rest_offset, strict=True))
        return self.joints <= place.keys() and all(
            np.allclose(place[joint], want, atol=0.01 * np.linalg.norm(want)) for joint, want in self.rest.items()
        )

    @functools.cached_property
    def joints(self) -> frozenset[str]:
        """Every joint the map needs."""
        named = {value for body in self.bodies.values() for value in body.directions().values() if _axis(value) is None}
        return frozenset(named | {body.joint for body in self.bodies.values()} | set(self.also) | set(self.rest))

    def rest_frames(self, motion: RawMotion, names: Sequence[str] = BODIES) -> Float[np.ndarray, "n 4"]:
        """Constant rotations wxyz from bodies' canonical frames to the frames of their joints."""
        canonical, local = np.empty((2, len(names), 2, 3))
        for index, body in enumerate(self.bodies[name] for name in names):
            stated = sorted(body.directions().items(), key=lambda item: _axis(item[1]) is not None)
            for place, (direction, value) in enumerate(stated):
                canonical[index, place] = CANONICAL[direction]
                local[index, place] = self._direction(motion, body.joint, value)
            if abs(float(local[index, 0] @ local[index, 1])) > PARALLEL:
                texts = [f"'{way}' ({'to ' if _axis(value) is None else ''}{value})" for way, value in stated]
                problem = (
                    f"the map '{self.name}' gives {names[index]} {' and '.join(texts)}, which lie along one line in "
                    "this file's rest pose."
                )
                do = "The map was written for another rest pose (do the arms hang here?): name another axis."
                raise FileError(motion.files[0], problem, do)
        turns = rotation.from_matrix(_frames(local) @ np.swapaxes(_frames(canonical), 1, 2))
        pitch = np.deg2rad([self.bodies[name].pitch_deg for name in names])
        return rotation.multiply(turns, rotation.from_axis_angle(AXES["y"], pitch))

    def _direction(self, motion: RawMotion, joint: str, value: str) -> Float[np.ndarray, " 3"]:
        axis = _axis(value)
        if axis is not None:
            return axis
        try:
            offset = motion.offset_between(joint, value)
        except KeyError as error:
            problem = f"joint '{value}' does not descend from '{joint}', which the skeleton '{self.name}' expects."
            raise FileError(motion.files[0], problem) from error
        if np.linalg.norm(offset) < 1e-9:
            raise FileError(motion.files[0], f"the bone from joint '{joint}' to '{value}' has no length.")
        return offset / np.linalg.norm(offset)


def _axis(value: str) -> Float[np.ndarray, " 3"] | None:
    """The unit vector of a map's direction; None if it is a joint's name."""
    if value in AXES:
        return AXES[value]
    try:
        vector = np.array([float(token) for token in value.split()])
    except ValueError:
        return None
    return rotation.normalize(vector) if vector.shape == (3,) and vector.any() else None


def _frames(directions: Float[np.ndarray, "n 2 3"]) -> Float[np.ndarray, "n 3 3"]:
    """Right-handed orthonormal columns: the first direction, the second made orthogonal to it, their cross product."""
    first, second = directions[:, 0], directions[:, 1]
    second = rotation.normalize(second - first * np.sum(first * second, axis=1, keepdims=True))
    return np.stack([first, second, rotation.cross(first, second)], axis=-1)


def read_map(path: Path) -> SkeletonMap:
    """Read and check a map file. Raises SettingsError."""
    value = settings.read_yaml(path)
    skeleton = settings.parse(SkeletonMap, {**value, "name": path.stem} if isinstance(value, dict) else value, path)
    faults = [f"body '{name}' is missing" for name in BODIES if name not in skeleton.bodies]
    faults += [f"unknown body '{name}'" for name in skeleton.bodies if name not in BODIES]
    for name, body in skeleton.bodies.items():
        stated = body.directions()
        if len(stated) != 2 or set(stated) == {"up", "down"}:
            faults.append(f"body '{name}' names {len(stated)} of ahead, left, up, down, expected two that differ")
        elif {value.lstrip("-") for value in stated.values()} in ({"x"}, {"y"}, {"z"}):
            faults.append(f"body '{name}' uses one axis twice")
    if faults:
        raise SettingsError(path, "; ".join(faults) + ".")
    return skeleton


@functools.cache
def shipped_maps() -> dict[str, SkeletonMap]:
    """The maps that come with the project, by name."""
    return {path.stem: read_map(path) for path in sorted(FOLDER.glob("*.yaml"))}


def stated_map(path: Path, stated: str) -> SkeletonMap:
    """The map with that name or in that `.yaml` file. Raises FileError."""
    if stated.endswith((".yaml", ".yml")):
        return read_map(Path(stated))
    if stated not in shipped_maps():
        raise FileError(path, f"unknown stated skeleton '{stated}'; there are: {', '.join(shipped_maps())}.")
    return shipped_maps()[stated]
