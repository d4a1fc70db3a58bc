"""Settings of the expert database, read from `data/database.yaml`."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

from pipeline.files.ranges import SHARE, Range, check
from pipeline.files.sourced import Unit


@dataclass(frozen=True, kw_only=True)
class DatabaseSettings:
    """`data/database.yaml`."""

    max_lost_share: Annotated[float, Unit("share")]
    """Largest share of the clips, or of the seconds, of the database in place that a new one may lack."""
    kept_versions: int
    """Earlier versions that are kept."""

    def __post_init__(self) -> None:
        check(self, max_lost_share=SHARE, kept_versions=Range(1, 1000))
