"""KP4: more motions from each one, mirrored, played slower or faster, with other steps or another posture."""

from pipeline.augment.process import AugmentSettings, Strengths, process
