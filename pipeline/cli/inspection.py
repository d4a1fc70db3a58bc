"""What there is to say of one motion file."""

from __future__ import annotations

import dataclasses
import math
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from pipeline.cli.chain import Chain
from pipeline.clips.human_clip import HumanClip
from pipeline.clips.outcome import Outcome, Piece, Reason
from pipeline.readers import Statement
from pipeline.viewing.human_figure import leg_length

WINDOW_NUMBERS = ("skill", "forward_m_s", "lateral_m_s", "yaw_rate_rad_s")


@dataclass(frozen=True, kw_only=True)
class Inspection:
    """One file, all its facts and every reason. The fields are the keys of `--json`."""

    file: str
    kind: str
    """`human` or `robot`."""
    format: str
    skeleton: str
    """Name of the skeleton map, or of the robot."""
    unit: str | None
    """Unit of length of the file."""
    up_axis: str | None
    licence: str | None
    declared_fps: float | None
    """Frames per second as the file says [Hz]."""
    fps: float
    """Frames per second that the motion is taken to have [Hz]."""
    frames: int
    seconds: float
    leg_length: float | None
    """Thigh plus shank [m]; None for a robot."""
    speed_mean: float | None
    """Horizontal speed of the root [m/s]; None where too little was recorded to tell it."""
    speed_max: float | None
    usable_seconds: float
    """What is left after repair [s]."""
    usable_pieces: int
    windows: list[dict[str, Any]]
    """Windows of one skill: `start_s, stop_s, skill, forward_m_s, lateral_m_s, yaw_rate_rad_s`."""
    reasons: list[dict[str, Any]]
    """`stage, code, text, effect` (`rejected`, `repaired`, `noted`) and, where known, `start_s, stop_s, value,
    limit, unit`."""

    def to_dict(self) -> dict[str, Any]:
        """JSON types; what is not finite is None."""
        return _finite(dataclasses.asdict(self))


def inspect_file(chain: Chain, path: Path, stated: Statement) -> Inspection:
    """Read, catalogue, cut in windows and repair one file, all reasons gathered. Raises FileError."""
    read = chain.read(path, stated)
    catalogued = chain.catalogued(read)
    reasons = [_reason("catalogue", reason) for reason in catalogued.reasons]
    windows: list[dict[str, Any]] = []
    usable_s, pieces = 0.0, 0
    clip = catalogued.pieces[0].clip if catalogued.pieces else read.motion.clip
    for piece in catalogued.pieces[:1]:
        windows = _windows(chain.windows(piece), piece)
        repaired = chain.repaired(piece)
        reasons += [_reason("repair", reason) for reason in repaired.reasons]
        usable_s += sum(each.clip.duration_s for each in repaired.pieces)
        pieces = len(repaired.pieces)
    speed = chain.speeds(clip)
    return Inspection(
        file=str(path),
        kind="human" if isinstance(clip, HumanClip) else "robot",
        format=read.motion.format,
        skeleton=read.motion.skeleton,
        unit=read.motion.unit,
        up_axis=read.motion.up_axis,
        licence=read.source.licence_of(read.path),
        declared_fps=read.motion.declared_fps,
        fps=clip.fps,
        frames=clip.frame_count,
        seconds=clip.duration_s,
        leg_length=leg_length(clip) if isinstance(clip, HumanClip) else None,
        speed_mean=float(speed.mean()) if len(speed) else None,
        speed_max=float(speed.max()) if len(speed) else None,
        usable_seconds=usable_s,
        usable_pieces=pieces,
        windows=windows,
        reasons=reasons,
    )


def _windows(selected: Outcome, whole: Piece) -> list[dict[str, Any]]:
    fps = whole.clip.fps
    rows = []
    for piece in selected.pieces:
        times = {
            "start_s": int(piece.numbers["start_frame"] or 0) / fps,
            "stop_s": int(piece.numbers["stop_frame"] or 0) / fps,
        }
        rows.append({**times, **{name: piece.numbers[name] for name in WINDOW_NUMBERS}})
    return rows


def _reason(stage: str, reason: Reason) -> dict[str, Any]:
    return {"stage": stage, **reason.to_dict()}


def _finite(value: Any) -> Any:
    if isinstance(value, dict):
        return {name: _finite(entry) for name, entry in value.items()}
    if isinstance(value, list):
        return [_finite(entry) for entry in value]
    if hasattr(value, "item"):
        value = value.item()
    return None if isinstance(value, float) and not math.isfinite(value) else value
