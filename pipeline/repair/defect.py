"""Results of the detectors: a defect, and all defects as masks of lost samples and cuts."""

from dataclasses import dataclass, field
from typing import Any

import numpy as np

from pipeline.clips.human_clip import BODIES
from pipeline.clips.outcome import Reason
from pipeline.repair.tree import BodyMask


@dataclass(frozen=True, kw_only=True)
class Defect:
    """Frames [start, stop) in which some bodies are invalid; start == stop is a cut before frame `start`."""

    code: str
    text: str
    """Description as a clause: "the pelvis jumps by 0.40 m"."""
    start: int
    stop: int
    bodies: tuple[int, ...]
    pos: bool = True
    """The bodies' positions are lost."""
    rot: bool = True
    """The bodies' orientations are lost."""
    value: float | None = None
    limit: float | None = None
    unit: str = ""

    @property
    def is_cut(self) -> bool:
        return self.start == self.stop

    def reason(self, fps: float, effect: str, done: str) -> Reason:
        """The defect as a reason, with times in the source clip."""
        if self.is_cut:
            where = f"before frame {self.start}"
        elif self.stop - self.start == 1:
            where = f"frame {self.start}"
        else:
            where = f"frames {self.start}-{self.stop - 1}"
        numbers = {"value": self.value, "limit": self.limit, "unit": self.unit}
        text = f"{where}: {self.text}; {done}."
        return Reason.of_frames(self.code, text, effect, (self.start, self.stop), fps, **numbers)


@dataclass
class Findings:
    """Defects of a clip, collected by the detectors; masks over t frames and the 19 bodies."""

    frame_count: int
    defects: list[Defect] = field(default_factory=list)
    lost_pos: BodyMask = field(init=False)
    lost_rot: BodyMask = field(init=False)

    def __post_init__(self) -> None:
        self.lost_pos = np.zeros((self.frame_count, len(BODIES)), dtype=bool)
        self.lost_rot = np.zeros((self.frame_count, len(BODIES)), dtype=bool)

    def add(self, defects: list[Defect]) -> None:
        """Add the defects of a detector."""
        self.defects += defects
        for defect in defects:
            bodies = list(defect.bodies)
            if defect.pos:
                self.lost_pos[defect.start : defect.stop, bodies] = True
            if defect.rot:
                self.lost_rot[defect.start : defect.stop, bodies] = True

    def with_more(self, defects: list[Defect]) -> "Findings":
        """A copy of these findings with further defects."""
        result = Findings(frame_count=self.frame_count, defects=[*self.defects])
        result.lost_pos, result.lost_rot = self.lost_pos.copy(), self.lost_rot.copy()
        result.add(defects)
        return result

    @property
    def cuts(self) -> list[int]:
        """Frames before which the motion is cut, sorted."""
        return sorted({defect.start for defect in self.defects if defect.is_cut})

    @property
    def beside_cuts(self) -> BodyMask:
        """Mask of the frames before and after each cut, for the bodies that jump there."""
        mask = np.zeros_like(self.lost_pos)
        for defect in self.defects:
            if defect.is_cut:
                mask[defect.start - 1 : defect.start + 1, list(defect.bodies)] = True
        return mask

    @property
    def lost(self) -> BodyMask:
        return self.lost_pos | self.lost_rot


def names(bodies: tuple[int, ...] | list[int]) -> str:
    """Names of bodies for a message: up to three, then a count."""
    if len(bodies) == len(BODIES):
        return "all joints"
    listed = ", ".join(BODIES[index] for index in list(bodies)[:3])
    return listed if len(bodies) <= 3 else f"{listed} and {len(bodies) - 3} more"


def spans(code: str, text: str, mask: BodyMask, *, pos: np.ndarray | None, rot: np.ndarray | None) -> list[Defect]:
    """A defect for each run of frames in which the same bodies are marked in `mask`."""
    marked = np.flatnonzero(mask.any(axis=1))
    if not len(marked):
        return []
    defects = []
    changes = np.flatnonzero((np.diff(marked) > 1) | (mask[marked[1:]] != mask[marked[:-1]]).any(axis=1)) + 1
    for group in np.split(marked, changes):
        start, stop = int(group[0]), int(group[-1]) + 1
        bodies = tuple(int(index) for index in np.flatnonzero(mask[start]))
        lost: dict[str, Any] = {
            kind: lost is not None and bool(lost[start:stop].any()) for kind, lost in (("pos", pos), ("rot", rot))
        }
        named = text.format(names=names(bodies))
        defects.append(Defect(code=code, text=named, start=start, stop=stop, bodies=bodies, **lost))
    return defects
