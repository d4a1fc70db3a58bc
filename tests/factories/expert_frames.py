"""Expert frames from clips of frames and commands."""

from __future__ import annotations

import numpy as np

from pipeline.training.bundle import ExpertFrames


def expert_of(*clips: tuple[np.ndarray, np.ndarray]) -> ExpertFrames:
    """Clips of frames (t, c) and commands (t, 3), one after the other and of one weight."""
    return ExpertFrames(
        frames=np.concatenate([frames for frames, _ in clips]),
        command=np.concatenate([command for _, command in clips]),
        clip_start=np.cumsum([0, *(len(frames) for frames, _ in clips)]),
        clip_weight=np.ones(len(clips)),
    )
