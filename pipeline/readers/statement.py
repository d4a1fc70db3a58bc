"""What a person states about files that do not state it themselves."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, kw_only=True)
class Statement:
    """Facts of a source, or of some of its files, from data/sources.yaml. None: the file has to state it."""

    unit: str | None = None
    """Unit of length: `m`, `cm`, `mm`, `inch`, `cmu`, or metres per unit as a number."""
    up: str | None = None
    """The axis that points up: `x`, `y`, `z`, or with a minus sign."""
    fps: float | None = None
    """Frames per second [Hz]; overrides what the file declares."""
    skeleton: str | None = None
    """Name of a skeleton map, or the path of a map of your own (`.yaml`)."""
    asf: str | None = None
    """The ASF file of an AMC: its path, from the AMC's folder if relative."""
    body_model: str | None = None
    """Path of an SMPL body model of your own (`.npz`); a mean human skeleton is used without it."""
    tracks: str | None = None
    """The robot motion that a robot's recording tracked: its path, from the recording's folder."""
    quaternion: str | None = None
    """Order of the root's quaternion in a robot's file that does not name its columns: `wxyz` or `xyzw`."""


NOTHING_STATED = Statement()
"""The file has to state everything."""
