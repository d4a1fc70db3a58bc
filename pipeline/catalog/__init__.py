"""The catalogue: every file measured and labelled, defects of the whole file found and corrected.

    ReadMotion -> frames stored once -> rate checked against gravity and gait -> numbers -> one clip

`catalogue_file` is the stage for a file, `catalogue` the same for what a reader has read.
"""

from pipeline.catalog.catalogue import catalogue, catalogue_file, correct
from pipeline.catalog.time_base import CatalogSettings, judge
