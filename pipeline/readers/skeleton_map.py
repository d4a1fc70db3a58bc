"""Skeleton maps: which joint of a file is which canonical body, and how its axes lie in it.

One small YAML file a skeleton in `skeletons/`. A map is found by the joint names of a motion, never
by its file name: every joint a map names has to be there. See docs/sources.md for how to write one.
"""

from __future__ import annotations

import functools
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from jaxtyping import Float

from pipeline import rotation
from pipeline.clips.human_clip import BODIES
from pipeline.errors import AmbiguousFileError, FileError, SettingsError
from pipeline.files import settings
from pipeline.readers.raw_motion import RawMotion

FOLDER = Path(__file__).parent / "skeletons"

AXES = {
    f"{sign}{axis}": unit * row
    for sign, unit in (("", 1.0), ("-", -1.0))
    for axis, row in zip("xyz", np.eye(3), strict=True)
}
CANONICAL = {"ahead": AXES["x"], "left": AXES["y"], "up": AXES["z"], "down": AXES["-z"]}


@dataclass(frozen=True, kw_only=True)
class BodyMap:
    """One canonical body in a skeleton. Two of `ahead`, `left`, `up`, `down` say how its axes lie.

    Each is an axis of the joint's frame (`x`, `-y`, …), three numbers in it (`"0 0.87 -0.5"`), or the name
    of a joint below it (the direction of that joint at rest). A joint's direction is kept exactly, the
    other one is made orthogonal to it.
    """

    joint: str
    ahead: str | None = None
    left: str | None = None
    up: str | None = None
    down: str | None = None
    pitch_deg: float = 0.0
    """Turn about the body's left axis that makes an upright person's body level [deg], forward positive."""
    offset: tuple[float, float, float] = (0.0, 0.0, 0.0)
    """For a body that the skeleton lacks: its place from `joint`, in the body's own frame [m]."""

    def directions(self) -> dict[str, str]:
        """What the map says of the axes: canonical direction -> axis or joint."""
        return {name: value for name in CANONICAL if (value := getattr(self, name)) is not None}


@dataclass(frozen=True, kw_only=True)
class SkeletonMap:
    """How one family of skeletons becomes the canonical one."""

    title: str
    """What this skeleton is, for people."""
    bodies: dict[str, BodyMap]
    """Canonical body -> its joint and axes; all 19."""
    name: str = ""
    """Name of the map's file."""
    also: tuple[str, ...] = ()
    """Joints that have to be in the file too, to tell skeletons with similar names apart."""

    rest: dict[str, tuple[float, float, float]] = field(default_factory=dict)
    """Joints and their rest offsets in the file's unit, for a figure that only its proportions tell from others."""

    def fits(self, motion: RawMotion) -> bool:
        """Every joint is there, and the rest offsets that the map states are the motion's (1 %)."""
        if not self.joints <= set(motion.joint_names):
            return False
        found = [motion.rest_offset[motion.joint_names.index(joint)] for joint in self.rest]
        return all(
            np.allclose(got, want, atol=0.01 * np.linalg.norm(want))
            for got, want in zip(found, self.rest.values(), strict=True)
        )

    @functools.cached_property
    def joints(self) -> frozenset[str]:
        """Every joint the map needs."""
        named = {value for body in self.bodies.values() for value in body.directions().values() if _axis(value) is None}
        return frozenset(named | {body.joint for body in self.bodies.values()} | set(self.also) | set(self.rest))

    def rest_frame(self, motion: RawMotion, name: str) -> Float[np.ndarray, " 4"]:
        """Constant rotation wxyz from a body's canonical frame to the frame of its joint."""
        return self.rest_frames(motion, (name,))[0]

    def rest_frames(self, motion: RawMotion, names: Sequence[str] = BODIES) -> Float[np.ndarray, "n 4"]:
        """`rest_frame` of several bodies."""
        canonical, local = np.empty((2, len(names), 2, 3))
        for index, body in enumerate(self.bodies[name] for name in names):
            said = sorted(body.directions().items(), key=lambda item: _axis(item[1]) is not None)
            for place, (direction, value) in enumerate(said):
                canonical[index, place] = CANONICAL[direction]
                local[index, place] = self._direction(motion, body.joint, value)
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
    """The unit vector that a map's direction states; None where it is a joint's name."""
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
    """A map file, checked. Raises SettingsError."""
    value = settings.read_yaml(path)
    skeleton = settings.parse(SkeletonMap, {**value, "name": path.stem} if isinstance(value, dict) else value, path)
    faults = [f"body '{name}' is missing" for name in BODIES if name not in skeleton.bodies]
    faults += [f"unknown body '{name}'" for name in skeleton.bodies if name not in BODIES]
    for name, body in skeleton.bodies.items():
        said = body.directions()
        if len(said) != 2 or set(said) == {"up", "down"}:
            faults.append(f"body '{name}' names {len(said)} of ahead, left, up, down, wanted two that differ")
        elif {value.lstrip("-") for value in said.values()} in ({"x"}, {"y"}, {"z"}):
            faults.append(f"body '{name}' uses one axis twice")
    if faults:
        raise SettingsError(path, "; ".join(faults) + ".")
    return skeleton


@functools.cache
def shipped_maps() -> dict[str, SkeletonMap]:
    """The maps that come with the project, by name."""
    return {path.stem: read_map(path) for path in sorted(FOLDER.glob("*.yaml"))}


def find_map(motion: RawMotion, stated: str | None = None) -> SkeletonMap:
    """The map of a motion, by its joint names, or the one that is stated (a name or a `.yaml` file).

    Raises FileError for an unknown skeleton, AmbiguousFileError when several maps fit.
    """
    path, names = motion.files[0], set(motion.joint_names)
    if stated is not None:
        skeleton = _stated(path, stated)
        if not skeleton.joints <= names:
            missing = ", ".join(sorted(skeleton.joints - names))
            raise FileError(path, f"the stated skeleton '{stated}' needs joints that the file lacks: {missing}.")
        return skeleton
    fitting = [skeleton for skeleton in shipped_maps().values() if skeleton.fits(motion)]
    best = [one for one in fitting if not any(_less_specific(one, other) for other in fitting)]
    if not best:
        raise FileError(path, *_unknown(motion.joint_names))
    if len(best) > 1:
        found = ", ".join(skeleton.name for skeleton in best)
        raise AmbiguousFileError(path, f"several skeletons fit: {found}.", "State `skeleton:` in data/sources.yaml.")
    return best[0]


def _less_specific(one: SkeletonMap, other: SkeletonMap) -> bool:
    """`other` asks for all that `one` asks for, and more."""
    return (one.joints, len(one.rest)) != (other.joints, len(other.rest)) and (
        one.joints <= other.joints and len(one.rest) <= len(other.rest)
    )


def _stated(path: Path, stated: str) -> SkeletonMap:
    if stated.endswith((".yaml", ".yml")):
        return read_map(Path(stated))
    if stated not in shipped_maps():
        raise FileError(path, f"unknown stated skeleton '{stated}'; there are: {', '.join(shipped_maps())}.")
    return shipped_maps()[stated]


def _unknown(names: tuple[str, ...]) -> tuple[str, str]:
    """Problem and remedy for a skeleton that no map fits: the closest map, missing and extra joints."""
    closest = max(shipped_maps().values(), key=lambda one: (len(one.joints & set(names)) / len(one.joints), one.name))
    missing = sorted(closest.joints - set(names))
    extra = [name[:40] for name in names if name not in closest.joints]
    more = f" and {len(extra) - 12} more" if len(extra) > 12 else ""
    problem = (
        f"unknown skeleton of {len(names)} joints. Closest is '{closest.name}'; missing: {', '.join(missing)}; "
        f"not in it: {', '.join(extra[:12]) or 'none'}{more}."
    )
    return problem, "Write a map (docs/sources.md has a template) and state it as `skeleton:` in data/sources.yaml."
