"""The clock of the viewer: plays, pauses, jumps, loops."""

from __future__ import annotations

from dataclasses import dataclass

SPEEDS = (0.1, 0.25, 0.5, 1.0, 2.0)
"""Playing speeds / real time."""


@dataclass
class Playback:
    """Playback state of a clip."""

    duration_s: float
    """Time of the last frame [s]."""
    time_s: float = 0.0
    speed: float = 1.0
    playing: bool = True

    def advance(self, passed_s: float) -> None:
        """Advance by real time, looping at the end."""
        if self.playing and self.duration_s > 0.0:
            self.time_s = (self.time_s + self.speed * passed_s) % self.duration_s

    def seek(self, time_s: float) -> None:
        """Jump to a time, clamped to the clip."""
        self.time_s = min(max(time_s, 0.0), self.duration_s)
