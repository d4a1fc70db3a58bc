"""Names of joints without what a program puts around them, and which part of which limb they name.

The alias lists cover the names that Mixamo, Rokoko, Xsens and MotionBuilder, Nokov, OptiTrack Motive, Perception
Neuron, SOMA and Kimodo, 100STYLE, CMU, LAFAN1, Unreal, 3ds Max's Biped, VRM and Rigify give to joints.
"""

from __future__ import annotations

import re
from collections.abc import Sequence

SEPARATORS = ":|_-. "

HIP = ("upleg", "upperleg", "thigh", "femur", "hip", "leg")
KNEE = ("lowerleg", "lowleg", "shin", "calf", "tibia", "shank", "knee", "leg")
ANKLE = ("foot", "ankle")
TOE = ("toebase", "toe", "toes", "toe0", "ball", "forefoot")
SHOULDER = ("upperarm", "uparm", "uarm", "humerus", "arm", "shoulder")
ELBOW = ("forearm", "lowerarm", "lowarm", "farm", "radius", "elbow")
WRIST = ("hand", "wrist", "palm")
"""Names of the joint at the upper end of each part of a limb, the surest first. `leg` is the thigh of skeletons that
call the shank otherwise, `shoulder` the upper arm of skeletons without an arm."""

LIMBS = {"hip": HIP, "knee": KNEE, "ankle": ANKLE, "toe": TOE, "shoulder": SHOULDER, "elbow": ELBOW, "wrist": WRIST}
HEADS = ("head", "chead", "spine006")
"""Of VRM (`C_Head`) and Rigify (`spine.006`) the last two."""

_PARTS = frozenset(alias for aliases in LIMBS.values() for alias in aliases)


def shared_prefix(names: Sequence[str]) -> str:
    """What all joints but a root or two begin with, up to a separator: `mixamorig7:`, `Take_01:`, `Character1_`."""
    for skipped in range(min(3, len(names))):
        kept = names[skipped:]
        common = _common_start(min(kept), max(kept)) if len(kept) > 2 else ""
        last = max(common.rfind(separator) for separator in SEPARATORS)
        prefix = common[: last + 1]
        if prefix and all(len(name) > len(prefix) for name in kept):
            return prefix
    return ""


def _common_start(first: str, last: str) -> str:
    """What two names begin with alike; of the first and the last in order it is what all between begin with."""
    differ = (index for index, (a, b) in enumerate(zip(first, last, strict=False)) if a != b)
    return first[: next(differ, min(len(first), len(last)))]


def without_prefix(names: tuple[str, ...]) -> tuple[str, ...]:
    """The names without their shared prefix; unchanged where that would make two of them equal."""
    prefix = shared_prefix(names)
    bare = tuple(name.removeprefix(prefix) for name in names)
    return bare if len(set(bare)) == len(names) else names


def side_and_part(name: str) -> tuple[str, str]:
    """`left`, `right` or nothing, and the rest of a name in small letters without separators."""
    words = re.findall(r"[A-Z]+(?=[A-Z][a-z])|[A-Z]?[a-z]+|[A-Z]+|\d+", name)
    flat = "".join(words).lower()
    for side in ("left", "right"):
        if flat.startswith(side):
            return side, flat.removeprefix(side)
        if flat.endswith(side):
            return side, flat.removesuffix(side)
    lower = [word.lower() for word in words]
    for side in ("left", "right"):
        for rest in (lower[1:] if lower[:1] == [side[0]] else [], lower[:-1] if lower[-1:] == [side[0]] else []):
            if rest:
                return side, "".join(rest)
        if flat.startswith(side[0]) and flat[1:] in _PARTS:
            return side, flat[1:]
    return "", flat
