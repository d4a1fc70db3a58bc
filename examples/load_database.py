"""Sample windows for an AMP discriminator: python examples/load_database.py FOLDER [WINDOWS]."""

import sys
from pathlib import Path

import numpy as np

from pipeline.expert.read import read_database

WINDOW = 4
"""Consecutive frames that the discriminator observes, at 50 Hz."""

database = read_database(Path(sys.argv[1]))
count = int(sys.argv[2]) if len(sys.argv) > 2 else 512
rng = np.random.default_rng(0)

# A clip is drawn by its MotionWeight, then a window of it uniformly; a window never crosses clips.
clips = [clip for clip in database.clips if len(clip.frames) >= WINDOW]
weight = np.array([clip.weight for clip in clips])
drawn = rng.choice(len(clips), size=count, p=weight / weight.sum())
starts = [rng.integers(len(clips[index].frames) - WINDOW + 1) for index in drawn]
windows = np.stack([clips[index].frames[start : start + WINDOW] for index, start in zip(drawn, starts, strict=True)])

# Columns 0 to 6 are the root's pose in the world, which the discriminator must not observe.
features = windows[:, :, 7:]
print(f"{len(clips)} clips, {database.manifest['seconds']:.1f} s, licence {database.manifest['licence']['strictest']}")
print(f"windows {features.shape}, float64; mean {features.mean():.3f}, deviation {features.std():.3f}")
