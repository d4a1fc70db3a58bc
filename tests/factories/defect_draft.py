"""A clip while a defect is put into it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float

from pipeline import rotation
from pipeline.clips.human_clip import HumanClip, body
from pipeline.repair.tree import PARENT, descendants, to_local

LIMBS: tuple[tuple[int, ...], ...] = tuple(
    tuple(body(f"{side}_{part}") for part in parts)
    for parts in (("hip", "knee", "ankle", "toe"), ("shoulder", "elbow", "wrist"))
    for side in ("left", "right")
)
"""Both legs, then both arms."""


@dataclass(kw_only=True)
class Draft:
    """Arrays to be written to, and what is said of the defect."""

    pos: Float[np.ndarray, "t 19 3"]
    quat: Float[np.ndarray, "t 19 4"]
    contacts: Bool[np.ndarray, "t 2"] | None
    fps: float
    rng: np.random.Generator
    start: int
    stop: int
    """Frames [start, stop) to be spoilt; a defect may move them."""
    strength: float | None = None
    """How much it matters, 1 the least that does; None where the distance from the truth tells."""
    size_m: float | None = None
    """What was added to a floor [m]."""
    holds: bool = False
    """Something keeps still: it matters from three frames on."""
    still: tuple[int, ...] = ()
    """Bodies whose motion is missing, as far as they move."""
    still_in_world: bool = False
    """It is their place in the world that does not move; else their rotation in their parents' frames."""

    @classmethod
    def of(cls, clip: HumanClip, start: int, stop: int, rng: np.random.Generator) -> Draft:
        pos, quat = clip.body_pos_w.copy(), clip.body_quat_w.copy()
        return cls(pos=pos, quat=quat, contacts=clip.contacts, fps=clip.fps, rng=rng, start=start, stop=stop)

    @property
    def span(self) -> slice:
        return slice(self.start, self.stop)

    def size(self, least: float, low: float = 0.3, high: float = 10.0) -> float:
        """A random size around the `least` that matters: `low` to `high` times it, by the logarithm."""
        return least * float(np.exp(self.rng.uniform(np.log(low), np.log(high))))

    def direction(self) -> Float[np.ndarray, " 3"]:
        """A random unit vector."""
        return rotation.normalize(self.rng.normal(size=3))

    def turn(self, span: slice, turns: dict[int, np.ndarray]) -> None:
        """Give some bodies other rotations in their parents' frames; what hangs below them goes along."""
        offset, local = to_local(self.pos[span], self.quat[span])
        moved = sorted({index for top in turns for index in (top, *descendants(top))})
        for index in moved:
            parent = PARENT[index]
            self.pos[span, index] = self.pos[span, parent] + rotation.rotate(self.quat[span, parent], offset[:, index])
            self.quat[span, index] = rotation.multiply(self.quat[span, parent], turns.get(index, local[:, index]))
