"""The labels of what a window shows."""

from __future__ import annotations

SKILLS: tuple[str, ...] = (
    "stand",
    "turn_left",
    "turn_right",
    "side_left",
    "side_right",
    "back",
    "walk_slow",
    "walk",
    "walk_fast_jog",
    "run",
)
"""What a window can show."""

TRANSITION = "transition"
"""What lies between two skills and is neither."""

LABELS: tuple[str, ...] = (*SKILLS, TRANSITION)
