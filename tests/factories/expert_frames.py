"""Expert frames from clips of frames and commands."""

from __future__ import annotations

import numpy as np

from pipeline.training.bundle import FPS, ExpertFrames

JOINTS = 21
FOOT = 7 + JOINTS + 6
"""Where a frame has the left foot in the trunk's frame; the right one is behind it."""


def expert_of(*clips: tuple[np.ndarray, np.ndarray]) -> ExpertFrames:
    """Clips of frames (t, c) and commands (t, 3), one after the other and of one weight."""
    return ExpertFrames(
        frames=np.concatenate([frames for frames, _ in clips]),
        command=np.concatenate([command for _, command in clips]),
        clip_start=np.cumsum([0, *(len(frames) for frames, _ in clips)]),
        clip_weight=np.ones(len(clips)),
    )


def walking(step_s: float, seconds: float, speed: float) -> tuple[np.ndarray, np.ndarray]:
    """Frames and commands of a robot that lifts its feet by turns, each for the time of a step."""
    count = round(seconds * FPS)
    frames = np.zeros((count, 37 + 2 * JOINTS), dtype=np.float32)
    frames[:, 2], frames[:, 3] = 0.7, 1.0
    frames[:, [FOOT + 2, FOOT + 5]] = -0.7
    turn = np.arange(count) // round(step_s * FPS) % 2
    for foot in (0, 1):
        frames[turn == foot, FOOT + 3 * foot + 2] += 0.05
    command = np.zeros((count, 3), dtype=np.float32)
    command[:, 0] = speed
    return frames, command
