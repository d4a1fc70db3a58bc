"""KP4: variants of each motion: mirrored, time-scaled, with other steps or another posture."""

from pipeline.augment.process import AugmentSettings, Strengths, process
