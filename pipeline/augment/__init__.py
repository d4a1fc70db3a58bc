"""KP4: more motions from each one, mirrored, played slower or faster, with other steps or another posture."""

from pipeline.augment.process import process
from pipeline.augment.settings import AugmentSettings, Strengths

__all__ = ["AugmentSettings", "Strengths", "process"]
