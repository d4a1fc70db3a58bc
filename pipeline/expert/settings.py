"""Settings of the expert database, read from `data/database.yaml`."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

from pipeline.files.ranges import SHARE, Range
from pipeline.files.sourced import Unit


@dataclass(frozen=True, kw_only=True)
class DatabaseSettings:
    """`data/database.yaml`."""

    max_lost_share: Annotated[float, SHARE, Unit("share")]
    """Largest share of the clips, or of the seconds, of the database in place that a new one may lack."""
    kept_versions: Annotated[int, Range(1, 1000)]
    """Earlier versions that are kept."""
