"""Joint centres and segment axes of a person from the points of Plug-in Gait, the conventional gait model (CGM).

Two kinds of points are read. The model's own outputs ("bones") are four points a segment: origin, and a point along
each axis (`LFEO`, `LFEA`, `LFEL`, `LFEP`). Where one of them is not in the file, joint centres are estimated from the
skin markers, in the proportions of an adult because C3D files of markers rarely hold the subject's measurements:

hip       Bell, Pedersen and Brand, J. Biomech. 23 (1990): 14 % of the distance of the front iliac spines to the middle,
          19 % back and 30 % down from the spine's marker, along the axes of the pelvis
knee,     the chord function of the CGM (Davis et al., Hum. Mov. Sci. 10, 1991): at half the joint's width from the
ankle,    lateral marker, at a right angle to the segment, in the plane of the wand marker where there is one; at the
shoulder  shoulder down from the marker on the acromion
elbow     at half its width from the lateral marker, at right angles to upper arm and forearm
wrist     between its two markers

Axes as in `pipeline.clips.human_clip`: x forward, y left, z up for a person who stands with hanging arms.
"""

from collections.abc import Mapping

import numpy as np
from jaxtyping import Float

from pipeline import rotation
from pipeline.clips.human_clip import BODIES, FEET

Points = Mapping[str, Float[np.ndarray, "t 3"]]
"""Positions of named points, in the file's unit and world; NaN where a point is missing."""
Segments = dict[str, tuple[np.ndarray, np.ndarray]]
"""Body -> positions (t, 3) and rotation matrices (t, 3, 3)."""

AXES = ("ahead", "left", "up")
LETTER = {"left": "L", "right": "R"}
SIDES = tuple(zip(FEET, (1.0, -1.0), strict=True))
"""Sides of the body, and where they lie along the left axis."""
HEAD_BAND = ("LFHD", "RFHD", "LBHD", "RBHD")

_ONE_SIDE = ("FE", "TI", "FO", "CL", "HU", "RA", "HN")
BONES = tuple(
    f"{segment}{point}"
    for segment in ("PEL", "TRX", "HED", *(f"{side}{part}" for side in "LR" for part in _ONE_SIDE))
    for point in ("O", "A", "L", "P")
)
"""Points of the model's outputs that are read."""

MARKERS = (
    *("LASI", "RASI", "C7", "T10", "CLAV", "STRN", *HEAD_BAND),
    *(f"{side}{name}" for side in "LR" for name in ("KNE", "ANK", "HEE", "TOE", "SHO", "ELB", "WRA", "WRB")),
)
"""Markers without which nothing is estimated; `LPSI` and `RPSI`, or `SACR`, come in addition."""
FURTHER = ("LPSI", "RPSI", "SACR", "LTHI", "RTHI", "LTIB", "RTIB", "LFIN", "RFIN")
"""Markers that are used where they are there."""
WANTED = frozenset((*BONES, *MARKERS, *FURTHER))

KNEE_SHARE, ANKLE_SHARE, ELBOW_SHARE, SHOULDER_SHARE = 0.143, 0.105, 0.15, 0.16
"""Half a joint's width plus 7 mm to the middle of a marker, over the length of the segment above it (of the upper arm
for the shoulder): 60 mm of 0.42 m, 43 mm of 0.41 m, 42 mm of 0.28 m, 47 mm of 0.29 m."""
HEAD_BAND_PITCH = np.deg2rad(15.0)
"""The front markers of a head band are higher than the ones at the back: by 14 to 17 degrees in the three recordings of
standing people that ship with pyCGM."""
CHEST_FROM_NOTCH, NECK_FROM_NOTCH = (-0.10, -0.35), (-0.15, 0.07)
"""Chest and neck from the jugular notch, ahead and up along the axes of the thorax, over the distance from the hips to
the notch (0.5 m): the middle of `T10` and `STRN`, and of `C7` and `CLAV`, in the same recordings."""
SPINE_SHARE, HEAD_SHARE = 0.35, 0.55
"""The lowest joint of the spine on the way from the hips to the chest, the head's on the way from neck to head band."""


def missing_points(names: frozenset[str]) -> tuple[str, ...]:
    """What a file with points of these names lacks; nothing where its motion can be read."""
    if set(BONES) <= names:
        return ()
    back = () if names >= {"LPSI", "RPSI"} or "SACR" in names else ("LPSI", "RPSI")
    return tuple(name for name in (*MARKERS, *back) if name not in names)


def body_poses(points: Points) -> tuple[Float[np.ndarray, "t 19 3"], Float[np.ndarray, "t 19 4"]]:
    """Positions in the file's unit and orientations wxyz of the canonical bodies; NaN where a point is missing."""
    bodies = _from_bones(points) if set(BONES) <= points.keys() else _from_markers(points)
    pos = np.stack([bodies[name][0] for name in BODIES], axis=1)
    axes = np.stack([bodies[name][1] for name in BODIES], axis=1)
    finite = np.isfinite(pos).all(axis=2) & np.isfinite(axes).all(axis=(2, 3))
    spanned = np.linalg.det(np.where(np.expand_dims(finite, (2, 3)), axes, 0.0)) > 0.5  # not by points on one line
    known = np.logical_and(finite, spanned)
    quat = rotation.from_matrix(np.where(known[:, :, None, None], axes, np.eye(3)))
    return np.where(known[:, :, None], pos, np.nan), np.where(known[:, :, None], quat, np.nan)


def _from_bones(points: Points) -> Segments:
    """Bodies from the model's outputs, whose axes of thorax, arms and feet differ from those of pelvis and legs.

    The shank bends about the femur's lateral axis: the model's tibia has the torsion of the ankle in it. The head band
    is taken where its markers are there: the model's head is level only after a static trial.
    """

    def axis(segment: str, point: str) -> np.ndarray:
        return points[f"{segment}{point}"] - points[f"{segment}O"]

    bodies = {"pelvis": (points["PELO"], _axes(left=axis("PEL", "L"), ahead=axis("PEL", "A")))}
    chest = _axes(up=-axis("TRX", "P"), ahead=axis("TRX", "A"))
    for side, sign in SIDES:
        s = LETTER[side]
        hip, knee, ankle, foot = (points[f"{s}{name}"] for name in ("FEP", "FEO", "TIO", "FOO"))
        shoulder, elbow, wrist = (points[f"{s}{name}"] for name in ("CLO", "HUO", "RAO"))
        ground = _axes(ahead=-axis(f"{s}FO", "P"), left=axis(f"{s}FO", "L"))
        bodies |= {
            f"{side}_hip": (hip, _axes(up=hip - knee, left=axis(f"{s}FE", "L"))),
            f"{side}_knee": (knee, _axes(up=knee - ankle, left=axis(f"{s}FE", "L"))),
            f"{side}_ankle": (ankle, ground),
            f"{side}_toe": (points.get(f"{s}TOE", foot), ground),
            f"{side}_shoulder": (shoulder, _axes(up=shoulder - elbow, left=-axis(f"{s}HU", "L"))),
            f"{side}_elbow": (elbow, _axes(up=elbow - wrist, left=-axis(f"{s}RA", "L"))),
            f"{side}_wrist": (wrist, _axes(up=axis(f"{s}HN", "P"), left=sign * axis(f"{s}HN", "A"))),
        }
    if set(HEAD_BAND) <= points.keys():
        return bodies | _trunk(bodies, points["TRXO"], chest, *_head(points))
    head = _axes(up=axis("HED", "P"), ahead=axis("HED", "A"))
    return bodies | _trunk(bodies, points["TRXO"], chest, points["HEDO"], head)


def _from_markers(points: Points) -> Segments:
    """Bodies from skin markers."""
    front = 0.5 * (points["LASI"] + points["RASI"])
    back = points["SACR"] if "SACR" in points else 0.5 * (points["LPSI"] + points["RPSI"])
    pelvis = _axes(left=points["LASI"] - points["RASI"], ahead=front - back)
    chest = _axes(
        up=points["C7"] + points["CLAV"] - points["T10"] - points["STRN"],
        ahead=points["CLAV"] + points["STRN"] - points["C7"] - points["T10"],
    )
    bodies: Segments = {}
    for side, sign in SIDES:
        bodies |= _leg(points, side, sign, pelvis) | _arm(points, side, sign, chest)
    bodies["pelvis"] = (0.5 * (bodies["left_hip"][0] + bodies["right_hip"][0]), pelvis)
    return bodies | _trunk(bodies, points["CLAV"], chest, *_head(points))


def _head(points: Points) -> tuple[np.ndarray, np.ndarray]:
    """The middle of the head band and the axes of the head, level for a person who looks forward."""
    head = _axes(
        left=points["LFHD"] + points["LBHD"] - points["RFHD"] - points["RBHD"],
        ahead=points["LFHD"] + points["RFHD"] - points["LBHD"] - points["RBHD"],
    )
    level = rotation.to_matrix(rotation.from_axis_angle(np.array([0.0, 1.0, 0.0]), HEAD_BAND_PITCH))
    return np.mean([points[name] for name in HEAD_BAND], axis=0), head @ level


def _leg(points: Points, side: str, sign: float, pelvis: np.ndarray) -> Segments:
    s = LETTER[side]
    spine, width = points[f"{s}ASI"], rotation.length(points["LASI"] - points["RASI"])[:, None]
    hip = spine + width * (pelvis @ np.array([-0.19, -0.14 * sign, -0.30]))
    inward = -sign * pelvis[:, :, 1]
    knee = _chord(hip, points[f"{s}KNE"], _away(points, f"{s}THI", f"{s}KNE", inward), KNEE_SHARE)
    ankle = _chord(knee, points[f"{s}ANK"], _away(points, f"{s}TIB", f"{s}ANK", inward), ANKLE_SHARE)
    lateral = sign * (points[f"{s}KNE"] - knee)
    foot = _axes(ahead=points[f"{s}TOE"] - points[f"{s}HEE"], left=sign * (points[f"{s}ANK"] - ankle))
    return {
        f"{side}_hip": (hip, _axes(up=hip - knee, left=lateral)),
        f"{side}_knee": (knee, _axes(up=knee - ankle, left=lateral)),
        f"{side}_ankle": (ankle, foot),
        f"{side}_toe": (points[f"{s}TOE"], foot),
    }


def _arm(points: Points, side: str, sign: float, chest: np.ndarray) -> Segments:
    s = LETTER[side]
    length = rotation.length(points[f"{s}SHO"] - points[f"{s}ELB"])
    shoulder = _chord(points["CLAV"], points[f"{s}SHO"], -chest[:, :, 2], SHOULDER_SHARE, length)
    wrist = 0.5 * (points[f"{s}WRA"] + points[f"{s}WRB"])
    elbow = _elbow(shoulder, points[f"{s}ELB"], wrist, sign)
    lateral = sign * (points[f"{s}ELB"] - elbow)
    hand = wrist - points[f"{s}FIN"] if f"{s}FIN" in points else elbow - wrist
    thumb = points[f"{s}WRA"] - points[f"{s}WRB"]
    return {
        f"{side}_shoulder": (shoulder, _axes(up=shoulder - elbow, left=lateral)),
        f"{side}_elbow": (elbow, _axes(up=elbow - wrist, left=lateral)),
        f"{side}_wrist": (wrist, _axes(up=hand, ahead=thumb)),
    }


def _trunk(bodies: Segments, notch: np.ndarray, chest: np.ndarray, band: np.ndarray, head: np.ndarray) -> Segments:
    """Spine, chest, neck and head: points between the hips, the jugular notch and the middle of the head band."""
    pelvis, turn = bodies["pelvis"]
    height = rotation.length(notch - pelvis)[:, None]
    low, neck = (
        notch + height * (chest @ np.array([ahead, 0.0, up])) for ahead, up in (CHEST_FROM_NOTCH, NECK_FROM_NOTCH)
    )
    return {
        "spine": (pelvis + SPINE_SHARE * (low - pelvis), _between(turn, chest)),
        "chest": (low, chest),
        "neck": (neck, _between(chest, head)),
        "head": (neck + HEAD_SHARE * (band - neck), head),
    }


def _chord(
    above: np.ndarray, marker: np.ndarray, inward: np.ndarray, share: float, length: np.ndarray | None = None
) -> Float[np.ndarray, "t 3"]:
    """Centre of a joint from its marker: the lines from the centre to `above` and to the marker are perpendicular.

    Args:
        above: centre of the next joint towards the trunk
        marker: marker of the joint
        inward: a vector that points from the marker roughly to the centre
        share: distance between marker and centre, as a share of `length`
        length: one per frame [m]; None: the distance between marker and `above`
    """
    way = above - marker
    along = rotation.normalize(way)
    distance = share * (rotation.length(way) if length is None else length)
    cosine = np.clip(distance / rotation.length(way), 0.0, 1.0)[:, None]
    across = rotation.normalize(inward - along * np.sum(inward * along, axis=1, keepdims=True))
    return marker + distance[:, None] * (cosine * along + np.sqrt(1.0 - cosine**2) * across)


def _away(points: Points, wand: str, marker: str, otherwise: np.ndarray) -> np.ndarray:
    """From a wand through its joint's marker: the joint is on the other side of the segment."""
    return points[marker] - points[wand] if wand in points else otherwise


def _elbow(shoulder: np.ndarray, marker: np.ndarray, wrist: np.ndarray, sign: float) -> Float[np.ndarray, "t 3"]:
    """The elbow's centre: from the marker at right angles to upper arm and forearm, on the inner side.

    With a and b from the marker to shoulder and wrist, e to the elbow has e e = e a = e b: that gives its part in the
    plane of a and b, and its length the rest. With a straight arm it is in the plane, with a bent one across.
    """
    a, b = shoulder - marker, wrist - marker
    square = (ELBOW_SHARE * rotation.length(a)) ** 2
    aa, bb, ab = (np.sum(left * right, axis=1) for left, right in ((a, a), (b, b), (a, b)))
    least = np.maximum(aa * bb - ab**2, 1e-6 * aa * bb)
    flat = (square * (bb - ab) / least)[:, None] * a + (square * (aa - ab) / least)[:, None] * b
    rest = np.maximum(square - np.sum(flat * flat, axis=1), 0.0)
    across = rotation.normalize(rotation.cross(a, b))
    return marker + flat - sign * np.sqrt(rest)[:, None] * across


def _axes(**directions: np.ndarray) -> Float[np.ndarray, "t 3 3"]:
    """Rotation matrices (columns ahead, left, up) from two of these; the first is kept, the second made orthogonal."""
    (first, kept), (second, rough) = ((AXES.index(name), each) for name, each in directions.items())
    third = 3 - first - second
    columns = {first: rotation.normalize(kept)}
    columns[second] = rotation.normalize(rough - columns[first] * np.sum(rough * columns[first], axis=1, keepdims=True))
    columns[third] = rotation.cross(columns[(third + 1) % 3], columns[(third + 2) % 3])
    return np.stack([columns[place] for place in range(3)], axis=-1)


def _between(low: np.ndarray, high: np.ndarray) -> Float[np.ndarray, "t 3 3"]:
    """Axes half way between those of two segments."""
    return _axes(up=low[:, :, 2] + high[:, :, 2], ahead=low[:, :, 0] + high[:, :, 0])
