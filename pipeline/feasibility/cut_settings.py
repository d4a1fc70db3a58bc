"""How motions are cut, and what a short one is held to; part of `data/feasibility.yaml`."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

from pipeline.feasibility.units import OfFrames, Seconds
from pipeline.files.ranges import SHARE, Range, check
from pipeline.files.sourced import Unit


@dataclass(frozen=True, kw_only=True)
class CutSettings:
    """What is done with bad stretches."""

    min_seconds: Seconds
    """Shortest stretch that goes on [s]."""
    max_cuts: Annotated[int, Unit("-")]
    """How often what is left of a clip is cut again; a cut moves the ends that filters see."""
    margin_s: Seconds
    """Cut away with a bad frame on both sides [s]."""
    share_s: Seconds
    """A shorter clip may have as many frames at fault as one of this time [s], for shares and percentiles alike."""
    short_share: OfFrames
    """Larger than this no share of a short clip's own frames at fault becomes by that."""

    def __post_init__(self) -> None:
        check(
            self,
            min_seconds=Range(0.04, 60.0),
            max_cuts=Range(0, 20),
            margin_s=Range(0.0, 5.0),
            share_s=Range(0.0, 60.0),
            short_share=SHARE,
        )
