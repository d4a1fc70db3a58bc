"""The catalogue: measure and label every file, correct defects that concern the whole file.

    ReadMotion -> frames stored once -> rate checked against gravity and gait -> numbers -> one clip

`catalogue_file` is the stage for a file, `catalogue` the same for a motion that was already read.
"""

from pipeline.catalog.catalogue import catalogue, catalogue_file, correct
from pipeline.catalog.time_base import CatalogSettings, judge
