"""Whether a clip's frames are what a clip must be: finite, unit quaternions, shapes that fit together."""

from __future__ import annotations

import numpy as np

from pipeline.clips.human_clip import HumanClip
from pipeline.clips.outcome import Clip

UNIT_TOLERANCE = 1e-6
"""How far from 1 the length of a quaternion may be."""


def faults_of(clip: Clip) -> list[str]:
    """Every fault of a clip's frames, each a sentence with the first frame it is found at; none for a sound clip.

    A human clip must have its contacts labelled, a recording of a robot may not know them.
    """
    if isinstance(clip, HumanClip):
        arrays, quats = {"body_pos_w": clip.body_pos_w, "body_quat_w": clip.body_quat_w}, clip.body_quat_w
    else:
        arrays = {"root_pos_w": clip.root_pos_w, "root_quat_w": clip.root_quat_w, "joint_pos": clip.joint_pos}
        quats = clip.root_quat_w
    faults = []
    for name, values in arrays.items():
        bad = ~np.isfinite(values).reshape(len(values), -1).all(axis=1)
        if bad.any():
            faults.append(f"frame {int(np.argmax(bad))}: {name} is not finite")
    off = np.abs(np.linalg.norm(quats, axis=-1) - 1.0).reshape(len(quats), -1).max(axis=1, initial=0.0)
    if (off > UNIT_TOLERANCE).any():
        frame = int(np.argmax(off > UNIT_TOLERANCE))
        faults.append(f"frame {frame}: a quaternion's length is off by {off[frame]:.1e}")
    if clip.contacts is None and isinstance(clip, HumanClip):
        faults.append("contacts are not labelled")
    if clip.frame_count < 2 or not clip.fps > 0.0:
        faults.append(f"{clip.frame_count} frames at {clip.fps} frames/s are no motion")
    return faults
