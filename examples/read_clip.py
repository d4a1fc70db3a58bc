"""Read a motion file of any supported format: python examples/read_clip.py FILE."""

import sys
from pathlib import Path

import numpy as np

from pipeline.clips.human_clip import HumanClip
from pipeline.readers import read_motion

path = Path(sys.argv[1])
motion = read_motion(path, path.stem)
clip = motion.clip
print(f"{path}: {motion.format}, skeleton {motion.skeleton}, {clip.duration_s:.2f} s at {clip.fps:g} Hz")

if isinstance(clip, HumanClip):
    # Positions (frames, 3) in the world, z up [m]. Readers convert units and axes.
    pelvis = clip.pos("pelvis")
    speed = np.linalg.norm(np.diff(pelvis[:, :2], axis=0), axis=1) * clip.fps
    print(f"pelvis height {pelvis[:, 2].mean():.2f} m, mean speed {speed.mean():.2f} m/s")
else:
    print(f"a recording of the robot '{clip.robot}' with the joints {', '.join(clip.joint_names)}")
