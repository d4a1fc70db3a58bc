"""The criteria of self-collision."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pipeline.feasibility.criterion import Criterion, Verdict, criterion
from pipeline.feasibility.motion import Motion
from pipeline.feasibility.thresholds import ShareOfFrames, ToleranceMetres
from pipeline.simulation.self_collision import self_collision

GROUP = "self-collision"


@dataclass(frozen=True, kw_only=True)
class CollisionSettings:
    """The robot against itself."""

    depth: ToleranceMetres
    """Deepest overlap of two shapes [m]."""
    contact_depth: ToleranceMetres
    """An overlap deeper than this [m] counts for the share."""
    share: ShareOfFrames
    """Largest share of frames with such an overlap."""


@criterion(
    Criterion("self_collision_depth", GROUP, "collision.depth", "m", "deepest overlap of two collision shapes"),
    Criterion("self_collision_share", GROUP, "collision.share", "of frames", "share of frames with an overlap"),
)
def collisions(motion: Motion, settings: CollisionSettings) -> tuple[Verdict, Verdict]:
    """Deepest overlap of two of the robot's shapes, and the share of frames with one that counts."""
    found = self_collision(motion.clip, motion.robot)
    frame = int(np.argmax(found.depth))
    pair = " and ".join(found.pairs[frame] or ("no shapes",))
    overlap = found.depth > settings.contact_depth
    share = float(np.mean(overlap))
    return (
        Verdict(
            code="self_collision_depth",
            value=float(found.depth[frame]),
            limit=settings.depth,
            text=f"frame {frame}: {pair} overlap by {100 * found.depth[frame]:.1f} cm",
            bad=found.depth > settings.depth,
        ),
        Verdict(
            code="self_collision_share",
            value=share,
            limit=motion.largest_share(settings.share),
            text=f"parts overlap in {100 * share:.0f} % of the frames, most {pair}",
            bad=overlap,
        ),
    )
