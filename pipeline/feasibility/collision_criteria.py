"""The criterion of self-collision."""

from __future__ import annotations

import numpy as np

from pipeline.feasibility.motion import Motion
from pipeline.feasibility.settings import CollisionSettings
from pipeline.feasibility.verdict import Verdict
from pipeline.simulation.self_collision import self_collision


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
            unit="m",
            text=f"frame {frame}: {pair} overlap by {100 * found.depth[frame]:.1f} cm",
            bad=found.depth > settings.depth,
        ),
        Verdict(
            code="self_collision_share",
            value=share,
            limit=motion.largest_share(settings.share),
            unit="of frames",
            text=f"parts overlap in {100 * share:.0f} % of the frames, most {pair}",
            bad=overlap,
        ),
    )
