"""A piece put at the origin: heading +x, ground at z = 0, first pelvis over (0, 0)."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass

import numpy as np

from pipeline import rotation
from pipeline.clips.human_clip import HumanClip


@dataclass(frozen=True, kw_only=True)
class Placement:
    """Where a piece was in the world of its source: `p_source = R_z(heading) p_piece + (x, y, floor + slope t)`."""

    heading_rad: float
    origin_x_m: float
    origin_y_m: float
    floor_m: float
    """Height of the ground at the piece's first frame."""
    floor_slope_m_s: float = 0.0
    """How fast the ground of the recording rose."""

    def origin_w(self, clip: HumanClip) -> np.ndarray:
        """The piece's origin in each frame (t, 1, 3)."""
        place = np.tile([self.origin_x_m, self.origin_y_m, self.floor_m], (clip.frame_count, 1, 1))
        place[:, 0, 2] += self.floor_slope_m_s * np.arange(clip.frame_count) / clip.fps
        return place

    def applied(self, clip: HumanClip) -> HumanClip:
        """The clip in the piece's world."""
        back = rotation.about_z(-self.heading_rad)
        return dataclasses.replace(
            clip,
            body_pos_w=rotation.rotate(back, clip.body_pos_w - self.origin_w(clip)),
            body_quat_w=rotation.make_continuous(rotation.multiply(back, clip.body_quat_w)),
        )

    def undone(self, clip: HumanClip) -> HumanClip:
        """The piece in the world of its source."""
        turn = rotation.about_z(self.heading_rad)
        return dataclasses.replace(
            clip,
            body_pos_w=rotation.rotate(turn, clip.body_pos_w) + self.origin_w(clip),
            body_quat_w=rotation.make_continuous(rotation.multiply(turn, clip.body_quat_w)),
        )


def place(clip: HumanClip, floor_m: float, heading_s: float) -> Placement:
    """The placement of a clip: mean facing of the pelvis over its first `heading_s` [s]."""
    count = max(1, round(heading_s * clip.fps))
    return Placement(
        heading_rad=mean_heading(clip.quat("pelvis")[:count]),
        origin_x_m=float(clip.pos("pelvis")[0, 0]),
        origin_y_m=float(clip.pos("pelvis")[0, 1]),
        floor_m=floor_m,
    )


def mean_heading(quat_w: np.ndarray) -> float:
    """Mean direction of the bodies' x axes on the ground [rad], of orientations (t, 4)."""
    ahead = rotation.rotate(quat_w, np.array([1.0, 0.0, 0.0]))[:, :2]
    flat = rotation.normalize(ahead).mean(axis=0)
    return float(np.arctan2(flat[1], flat[0]))
