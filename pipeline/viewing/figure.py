"""A drawable motion: rigid parts made of primitives, with their poses per frame.

HumanClip -> human_figure -> Figure -> contact sheet (PNG)
RobotClip -> robot_figure -> Figure -> scene of the browser viewer
"""

from dataclasses import dataclass, field

import numpy as np
from jaxtyping import Float

from pipeline import rotation

Color = tuple[float, float, float]
"""Red, green, blue, 0 to 1."""


@dataclass(frozen=True, kw_only=True)
class Shape:
    """A primitive fixed to a part; sizes as in MuJoCo."""

    kind: str
    """`box` (three half sides), `sphere` (radius), `ellipsoid` (three half axes), `capsule` or `cylinder` (radius,
    half the length of the cylinder; along z)."""
    size: tuple[float, ...]
    """[m]"""
    color: Color
    name: str = ""
    pos: tuple[float, float, float] = (0.0, 0.0, 0.0)
    """Centre in the part's frame [m]."""
    quat: tuple[float, float, float, float] = (1.0, 0.0, 0.0, 0.0)
    """Orientation in the part's frame, wxyz."""


@dataclass(frozen=True, kw_only=True)
class Part:
    """A rigid body of the figure."""

    name: str
    shapes: tuple[Shape, ...]
    foot: int | None = None
    """Foot whose contact is shown: 0 left, 1 right; None for other parts."""


@dataclass(frozen=True, kw_only=True)
class Figure:
    """T frames of P parts. A part that is missing in a frame has NaN there and is not drawn."""

    name: str
    fps: float
    """Frames per second [Hz]."""
    parts: tuple[Part, ...]
    pos_w: Float[np.ndarray, "t p 3"]
    """Origins of the parts, world frame [m]."""
    quat_w: Float[np.ndarray, "t p 4"]
    """Orientations of the parts, world frame, wxyz."""
    root_pos_w: Float[np.ndarray, "t 3"]
    """Position of the whole figure [m]."""
    heading: Float[np.ndarray, " t"]
    """Heading about world z [rad]."""
    contacts: np.ndarray | None = field(default=None)
    """Foot contacts (t, 2), (left, right); None if unknown."""

    @property
    def frame_count(self) -> int:
        return len(self.pos_w)

    @property
    def duration_s(self) -> float:
        """Time of the last frame [s]; the first is at 0."""
        return (self.frame_count - 1) / self.fps

    @property
    def first_heading(self) -> float:
        """Heading [rad] in the first frame with a known one; 0 if there is none."""
        known = self.heading[np.isfinite(self.heading)]
        return float(known[0]) if len(known) else 0.0

    def frame_at(self, time_s: float) -> int:
        """The frame nearest to a time, clamped to the clip."""
        return int(np.clip(round(time_s * self.fps), 0, self.frame_count - 1))

    def drawn(self, frame: int) -> np.ndarray:
        """Whether each part is present in a frame (p,)."""
        return np.isfinite(self.pos_w[frame]).all(axis=1) & np.isfinite(self.quat_w[frame]).all(axis=1)

    def shape_poses(self, frame: int) -> tuple[Float[np.ndarray, "n 3"], Float[np.ndarray, "n 4"]]:
        """World positions [m] and orientations (wxyz) of all shapes, parts in order, shapes in order within."""
        part = np.repeat(np.arange(len(self.parts)), [len(part.shapes) for part in self.parts])
        pos = np.array([shape.pos for part in self.parts for shape in part.shapes])
        quat = np.array([shape.quat for part in self.parts for shape in part.shapes])
        part_quat = self.quat_w[frame, part]
        return self.pos_w[frame, part] + rotation.rotate(part_quat, pos), rotation.multiply(part_quat, quat)
