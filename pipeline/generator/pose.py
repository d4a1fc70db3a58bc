"""A motion of the generator's skeleton: root position and world orientation of each joint."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from pipeline import rotation
from pipeline.generator import skeleton


@dataclass(frozen=True, kw_only=True)
class Motion:
    """World: x forward, y left, z up; T frames."""

    fps: float
    """[Hz]"""
    root_pos_w: Float[np.ndarray, "t 3"]
    """Joint `Hips` [m]."""
    quat_w: Mapping[str, Float[np.ndarray, "t 4"]]
    """Orientation of every joint, wxyz; identity in the rest pose."""

    def positions_w(self) -> dict[str, Float[np.ndarray, "t 3"]]:
        """Position of every joint [m]."""
        positions: dict[str, np.ndarray] = {}
        for joint in skeleton.JOINTS:
            if joint.parent is None:
                positions[joint.name] = self.root_pos_w
            else:
                arm = rotation.rotate(self.quat_w[joint.parent], np.array(joint.offset))
                positions[joint.name] = positions[joint.parent] + arm
        return positions

    def local_quat(self, joint: skeleton.Joint) -> Float[np.ndarray, "t 4"]:
        """Orientation of a joint against its parent, wxyz."""
        if joint.parent is None:
            return self.quat_w[joint.name]
        return rotation.multiply(rotation.conjugate(self.quat_w[joint.parent]), self.quat_w[joint.name])
