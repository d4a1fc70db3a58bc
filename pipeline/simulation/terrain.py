"""Terrains: flat, sloping, rough, small steps, stones. The robot starts at the origin and walks in +x direction.

Within `START_M` of the origin, every terrain is a plane through it, horizontal except for a cross slope. Random terrain
is sampled on creation.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol, runtime_checkable

import mujoco
import numpy as np
from jaxtyping import Float

START_M = 0.5
"""Half length of the flat piece where the robot starts [m]."""
FAR_M = 30.0
"""Extent of unbounded terrain [m]."""
DEPTH_M = 1.0
"""Thickness of terrain boxes [m]."""
BESIDE_M = 0.005
"""Depth of the plane beside hills below their lowest point, so that no sole touches both [m]."""


@runtime_checkable
class Ground(Protocol):
    """A terrain."""

    def add_to(self, spec: mujoco.MjSpec) -> None:
        """Add its shapes to the world."""
        ...

    def height(self, x: float, y: float) -> float:
        """Height of its surface at x, y [m]."""
        ...


def tilt_at_start(ground: Ground) -> tuple[float, float]:
    """Roll and pitch [rad] of a robot on the ground's plane at the origin."""
    half = START_M / 2.0
    rise_x, rise_y = (ground.height(x, y) - ground.height(-x, -y) for x, y in ((half, 0.0), (0.0, half)))
    return math.atan(rise_y / START_M), -math.atan(rise_x / START_M)


@dataclass(frozen=True, kw_only=True)
class FlatGround:
    """A horizontal plane."""

    z: float = 0.0

    def add_to(self, spec: mujoco.MjSpec) -> None:
        _plane(spec, self.z)

    def height(self, x: float, y: float) -> float:
        return self.z


@dataclass(frozen=True, kw_only=True)
class Slope:
    """A ramp after the flat start, up (positive) or down."""

    angle_deg: float

    def add_to(self, spec: mujoco.MjSpec) -> None:
        _strip(spec, "start", (-FAR_M, START_M))
        angle = math.radians(self.angle_deg)
        half = np.array([FAR_M, FAR_M, DEPTH_M]) / 2.0
        along, normal = (math.cos(angle), 0.0, math.sin(angle)), (-math.sin(angle), 0.0, math.cos(angle))
        centre = np.array([START_M, 0.0, 0.0]) + half[0] * np.array(along) - half[2] * np.array(normal)
        _box(spec, "ramp", half, centre, [math.cos(angle / 2.0), 0.0, -math.sin(angle / 2.0), 0.0])

    def height(self, x: float, y: float) -> float:
        return max(x - START_M, 0.0) * math.tan(math.radians(self.angle_deg))


@dataclass(frozen=True, kw_only=True)
class CrossSlope:
    """A plane that rises to the left, including the start."""

    angle_deg: float

    def add_to(self, spec: mujoco.MjSpec) -> None:
        half = math.radians(self.angle_deg) / 2.0
        _plane(spec, 0.0, [math.cos(half), math.sin(half), 0.0, 0.0])

    def height(self, x: float, y: float) -> float:
        return y * math.tan(math.radians(self.angle_deg))


@dataclass(frozen=True, kw_only=True)
class Bump:
    """A speed bump perpendicular to the walk: a ridge with sloping sides."""

    at_m: float
    """Start of the bump along x."""
    rise_m: float
    """Height of the bump."""
    width_m: float
    """Total width along x."""

    def add_to(self, spec: mujoco.MjSpec) -> None:
        _plane(spec, 0.0)
        half = self.width_m / 2.0
        angle = math.atan2(self.rise_m, half)
        length = math.hypot(half, self.rise_m)
        for name, sign in (("up", 1.0), ("down", -1.0)):
            size = np.array([length, FAR_M, 0.02]) / 2.0
            middle = np.array([self.at_m + half - sign * half / 2.0, 0.0, self.rise_m / 2.0])
            normal = np.array([-sign * math.sin(angle), 0.0, math.cos(angle)])
            quat = [math.cos(angle / 2.0), 0.0, -sign * math.sin(angle / 2.0), 0.0]
            _box(spec, f"bump_{name}", size, middle - size[2] * normal, quat)

    def height(self, x: float, y: float) -> float:
        half = self.width_m / 2.0
        return max(self.rise_m * (1.0 - abs(x - self.at_m - half) / half), 0.0)


@dataclass(frozen=True, kw_only=True)
class Tiles:
    """Square tiles with individual heights on a plane: gravel as small steps, or stepping stones with gaps."""

    pitch_m: float
    """Distance between the centres of adjacent tiles."""
    gap_m: float
    """Gap between two tiles."""
    floor_m: float
    """Height of the plane below."""
    top_m: Float[np.ndarray, "r c"]
    """Height of each tile: rows along x after the flat start, columns along y centred at 0."""

    def add_to(self, spec: mujoco.MjSpec) -> None:
        _plane(spec, self.floor_m)
        width = self.top_m.shape[1] * self.pitch_m
        _strip(spec, "start", (-FAR_M, START_M))
        _strip(spec, "end", (START_M + len(self.top_m) * self.pitch_m, FAR_M))
        half = (self.pitch_m - self.gap_m) / 2.0
        for row, column in np.ndindex(self.top_m.shape):
            x = START_M + (row + 0.5) * self.pitch_m
            y = (column + 0.5) * self.pitch_m - width / 2.0
            height = self.top_m[row, column] - self.floor_m + 0.05
            size, pos = [half, half, height / 2.0], [x, y, self.top_m[row, column] - height / 2.0]
            _box(spec, f"tile_{row}_{column}", size, pos)

    def height(self, x: float, y: float) -> float:
        rows, columns = self.top_m.shape
        along, across = (x - START_M) / self.pitch_m, y / self.pitch_m + columns / 2.0
        row, column = math.floor(along), math.floor(across)
        if row < 0 or row >= rows:
            return 0.0
        edge = min(along - row, row + 1 - along, across - column, column + 1 - across) * self.pitch_m
        on_tile = 0 <= column < columns and edge >= self.gap_m / 2.0
        return float(self.top_m[row, column]) if on_tile else self.floor_m


@dataclass(frozen=True, kw_only=True)
class RoughGround:
    """A height field between flat ends, walked along x, with a plane at its sides."""

    spacing_m: float
    """Distance between two grid points."""
    z_m: Float[np.ndarray, "c r"]
    """Height of each point: rows along y centred at 0, columns along x after the flat start."""

    def add_to(self, spec: mujoco.MjSpec) -> None:
        rows, columns = self.z_m.shape
        low, high = float(self.z_m.min()), float(self.z_m.max())
        _plane(spec, low - BESIDE_M)
        half_x, half_y = (columns - 1) * self.spacing_m / 2.0, (rows - 1) * self.spacing_m / 2.0
        spec.add_hfield(
            name="rough",
            nrow=rows,
            ncol=columns,
            size=[half_x, half_y, max(high - low, 1e-6), DEPTH_M],
            userdata=((self.z_m - low) / max(high - low, 1e-6)).ravel(),
        )
        spec.worldbody.add_geom(
            name="rough", type=mujoco.mjtGeom.mjGEOM_HFIELD, hfieldname="rough", pos=[START_M + half_x, 0.0, low]
        )
        _strip(spec, "start", (-FAR_M, START_M))
        _strip(spec, "end", (START_M + 2.0 * half_x, FAR_M))

    def height(self, x: float, y: float) -> float:
        rows, columns = self.z_m.shape
        across, along = y / self.spacing_m + (rows - 1) / 2.0, (x - START_M) / self.spacing_m
        if not (0.0 <= along <= columns - 1):
            return 0.0
        if not (0.0 <= across <= rows - 1):
            return float(self.z_m.min()) - BESIDE_M
        return float(self.z_m[round(across), round(along)])


LENGTH_M, WIDTH_M = 9.0, 3.0
"""Length and width of terrain with tiles, stones or hills [m]."""


def gravel(rng: np.random.Generator, *, step_m: float) -> Tiles:
    """Tiles of 15 cm side by side, heights uniform in +-`step_m`/2."""
    pitch = 0.15
    shape = (round(LENGTH_M / pitch), round(WIDTH_M / pitch))
    return Tiles(pitch_m=pitch, gap_m=0.0, floor_m=-step_m, top_m=rng.uniform(-0.5, 0.5, shape) * step_m)


def stepping_stones(rng: np.random.Generator, *, gap_m: float, step_m: float) -> Tiles:
    """Stones of 30 cm with gaps 10 cm deep between them, tops uniform in +-`step_m`/2."""
    pitch = 0.3 + gap_m
    shape = (round(LENGTH_M / pitch), round(WIDTH_M / pitch))
    return Tiles(pitch_m=pitch, gap_m=gap_m, floor_m=-0.1, top_m=rng.uniform(-0.5, 0.5, shape) * step_m)


def rough_ground(rng: np.random.Generator, *, amplitude_m: float) -> RoughGround:
    """Smooth random hills: noise filtered to a wave length of about 0.4 m, from 0 to +-`amplitude_m` at most."""
    from scipy.ndimage import gaussian_filter

    spacing = 0.05
    shape = (round(WIDTH_M / spacing) + 1, round(LENGTH_M / spacing) + 1)
    noise = gaussian_filter(rng.normal(size=shape), 0.4 / (2.0 * math.pi) / spacing * 2.0, mode="wrap")
    z = amplitude_m * noise / np.abs(noise).max()
    ramp = np.clip(np.arange(shape[1]) * spacing / 0.3, 0.0, 1.0)
    return RoughGround(spacing_m=spacing, z_m=z * ramp * ramp[::-1])


IDENTITY = [1.0, 0.0, 0.0, 0.0]
Vector = Sequence[float] | np.ndarray


def _plane(spec: mujoco.MjSpec, z: float, quat: Sequence[float] = IDENTITY) -> None:
    size = [0.0, 0.0, 0.05]
    spec.worldbody.add_geom(name="ground", type=mujoco.mjtGeom.mjGEOM_PLANE, size=size, pos=[0.0, 0.0, z], quat=quat)


def _box(spec: mujoco.MjSpec, name: str, half: Vector, pos: Vector, quat: Sequence[float] = IDENTITY) -> None:
    spec.worldbody.add_geom(name=name, type=mujoco.mjtGeom.mjGEOM_BOX, size=half, pos=pos, quat=quat)


def _strip(spec: mujoco.MjSpec, name: str, along_x: tuple[float, float]) -> None:
    """A box over the whole width with its top at height 0, between two x positions [m]."""
    low, high = along_x
    half = [(high - low) / 2.0, FAR_M / 2.0, DEPTH_M / 2.0]
    _box(spec, name, half, [(low + high) / 2.0, 0.0, -DEPTH_M / 2.0])
