"""KP4: more motions from each one, mirrored and played slower or faster."""

from pipeline.augment.process import process
from pipeline.augment.settings import AugmentSettings

__all__ = ["AugmentSettings", "process"]
