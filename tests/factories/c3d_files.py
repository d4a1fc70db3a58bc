"""C3D files of a canonical clip's motion, written by ezc3d: skin markers of Plug-in Gait, or the model's bones.

Every marker is placed so that the published construction (docstring of `pipeline.readers.plug_in_gait`) has the clip's
joint for its answer: the geometry is solved backwards here, with code of its own.
"""

from __future__ import annotations

import ezc3d
import numpy as np
from scipy.spatial.transform import Rotation

X, Y, Z = np.eye(3)
PELVIS_TILT_DEG, CHEST_TILT_DEG, BAND_TILT_DEG = 10.0, -7.0, -15.0
KNEE, ANKLE, ELBOW, SHOULDER = 0.143, 0.105, 0.15, 0.16


def axes(clip, name, pitch_deg=0.0):
    """Rotation matrices (t, 3, 3) of a body, pitched forward."""
    turn = Rotation.from_quat(np.roll(clip.quat(name), -1, axis=1)) * Rotation.from_euler("y", pitch_deg, degrees=True)
    return turn.as_matrix()


def unit(vector):
    return vector / np.linalg.norm(vector, axis=1, keepdims=True)


def across(vector, along):
    """Unit part of a vector that is at a right angle to another one."""
    along = unit(along)
    return unit(vector - along * np.sum(vector * along, axis=1, keepdims=True))


def lateral(joint, above, direction, share):
    """Where a joint's marker is: at `share` of its own distance to the joint above, at a right angle."""
    length = np.linalg.norm(above - joint, axis=1, keepdims=True)
    return joint + across(direction, above - joint) * share * length / np.sqrt(1.0 - share**2)


def markers(clip) -> dict[str, np.ndarray]:
    """Positions [m] (t, 3) of the markers, for a clip whose elbows are bent or stretched about their left axes."""
    points = {}
    pelvis, chest = axes(clip, "pelvis", PELVIS_TILT_DEG), axes(clip, "chest", CHEST_TILT_DEG)
    hips = {side: clip.pos(f"{side}_hip") for side in ("left", "right")}
    width = np.linalg.norm(hips["left"] - hips["right"], axis=1, keepdims=True) / 0.72
    middle = 0.5 * (hips["left"] + hips["right"]) + width * (pelvis @ np.array([0.19, 0.0, 0.30]))
    for side, letter, sign in (("left", "L", 1.0), ("right", "R", -1.0)):
        points[f"{letter}ASI"] = middle + 0.5 * sign * width * pelvis[:, :, 1]
        points[f"{letter}PSI"] = middle + pelvis @ np.array([-0.16, 0.05 * sign, 0.0])
        points |= leg(clip, side, letter, sign)
    neck, notch = clip.pos("neck"), clip.pos("neck")
    for _ in range(50):
        height = np.linalg.norm(notch - 0.5 * (hips["left"] + hips["right"]), axis=1, keepdims=True)
        notch = neck - height * (chest @ np.array([-0.15, 0.0, 0.07]))
    points |= {"CLAV": notch, "C7": notch - 0.15 * chest[:, :, 0], "STRN": notch - 0.2 * chest[:, :, 2]}
    points["T10"] = points["C7"] + points["STRN"] - notch
    band, middle = axes(clip, "head", BAND_TILT_DEG), neck + (clip.pos("head") - neck) / 0.55
    for name, place in {"LF": (1, 1), "RF": (1, -1), "LB": (-1, 1), "RB": (-1, -1)}.items():
        points[f"{name}HD"] = middle + band @ np.array([0.09 * place[0], 0.06 * place[1], 0.0])
    for side, letter, sign in (("left", "L", 1.0), ("right", "R", -1.0)):
        points |= arm(clip, side, letter, sign, notch, chest)
    return points


def leg(clip, side, letter, sign):
    hip, knee, ankle, toe = (clip.pos(f"{side}_{part}") for part in ("hip", "knee", "ankle", "toe"))
    out = sign * axes(clip, f"{side}_hip")[:, :, 1]
    kne = lateral(knee, hip, out, KNEE)
    ank = lateral(ankle, knee, sign * axes(clip, f"{side}_ankle")[:, :, 1], ANKLE)
    wand = {
        f"{letter}THI": 0.5 * (hip + kne) + 0.08 * unit(kne - knee),
        f"{letter}TIB": 0.5 * (knee + ank) + 0.08 * unit(ank - ankle),
    }
    heel = toe - 0.2 * axes(clip, f"{side}_ankle")[:, :, 0]
    return {f"{letter}KNE": kne, f"{letter}ANK": ank, f"{letter}TOE": toe, f"{letter}HEE": heel, **wand}


def arm(clip, side, letter, sign, notch, chest):
    shoulder, elbow, wrist = (clip.pos(f"{side}_{part}") for part in ("shoulder", "elbow", "wrist"))
    bend = np.cross(elbow - shoulder, wrist - elbow)
    left = axes(clip, f"{side}_shoulder")[:, :, 1]
    bend = np.where(np.linalg.norm(bend, axis=1, keepdims=True) < 1e-6, left, bend)
    bend = unit(bend * np.sign(np.sum(bend * left, axis=1, keepdims=True)))
    length = np.linalg.norm(elbow - shoulder, axis=1, keepdims=True)
    elb = elbow + sign * bend * ELBOW * length / np.sqrt(1.0 - ELBOW**2)
    sho = shoulder
    for _ in range(50):
        distance = SHOULDER * np.linalg.norm(sho - elb, axis=1, keepdims=True)
        sho = shoulder + distance * across(chest[:, :, 2], notch - shoulder)
    hand = axes(clip, f"{side}_wrist")
    bar = 0.03 * hand[:, :, 0]
    fin = wrist - 0.08 * hand[:, :, 2]
    return {f"{letter}SHO": sho, f"{letter}ELB": elb, f"{letter}WRA": wrist + bar, f"{letter}WRB": wrist - bar} | {
        f"{letter}FIN": fin
    }


def bones(clip) -> dict[str, np.ndarray]:
    """The model's outputs (t, 3) [m]: origin, anterior, lateral and proximal point of each segment."""
    segments = {"PEL": (0.5 * (clip.pos("left_hip") + clip.pos("right_hip")), axes(clip, "pelvis", PELVIS_TILT_DEG))}
    chest = axes(clip, "chest", CHEST_TILT_DEG)
    segments["TRX"] = (markers(clip)["CLAV"], chest @ np.diag([1.0, -1.0, -1.0]))
    segments["HED"] = (clip.pos("neck") + (clip.pos("head") - clip.pos("neck")) / 0.55, axes(clip, "head"))
    for side, letter, sign in (("left", "L", 1.0), ("right", "R", -1.0)):
        places = {part: clip.pos(f"{side}_{part}") for part in ("knee", "ankle", "toe", "shoulder", "elbow", "wrist")}
        turns = {part: axes(clip, f"{side}_{part}") for part in ("hip", "knee", "ankle", "shoulder", "elbow", "wrist")}
        segments |= {
            f"{letter}FE": (places["knee"], turns["hip"]),
            f"{letter}TI": (places["ankle"], turns["knee"]),
            f"{letter}FO": (places["toe"], turns["ankle"] @ np.column_stack([Z, Y, -X])),
            f"{letter}CL": (places["shoulder"], chest),
            f"{letter}HU": (places["elbow"], turns["shoulder"] @ np.diag([-1.0, -1.0, 1.0])),
            f"{letter}RA": (places["wrist"], turns["elbow"] @ np.diag([-1.0, -1.0, 1.0])),
            f"{letter}HN": (places["wrist"], turns["wrist"] @ np.column_stack([sign * Y, -sign * X, Z])),
        }
    points = {}
    for name, (origin, turn) in segments.items():
        points[f"{name}O"] = origin
        for column, letter in enumerate("ALP"):
            points[f"{name}{letter}"] = origin + 0.2 * turn[:, :, column]
    for side, letter in (("left", "L"), ("right", "R")):
        points[f"{letter}FEP"] = clip.pos(f"{side}_hip")
    return points


def write_c3d(path, points, fps, *, unit="mm", declared=None, analog=0, prefix="", world=None, further=0):
    """Write named points [m] (t, 3); NaN is a missing point.

    Args:
        unit: unit of the numbers
        declared: POINT:UNITS where it is another
        analog: analog channels of ten samples a frame
        prefix: in front of every name
        world: rotation matrix into the file's world
        further: points without a use, named C_1 and so on
    """
    scale = {"mm": 1000.0, "cm": 100.0, "m": 1.0}[unit]
    frames = len(next(iter(points.values())))
    turned = {
        prefix + name: scale * (place @ (np.eye(3) if world is None else world).T) for name, place in points.items()
    }
    turned |= {f"{prefix}C_{number}": np.full((frames, 3), float(number)) for number in range(1, further + 1)}
    file = ezc3d.c3d()
    file["parameters"]["POINT"]["RATE"]["value"] = [fps]
    file["parameters"]["POINT"]["UNITS"]["value"] = [declared if declared is not None else unit]
    file["parameters"]["POINT"]["LABELS"]["value"] = tuple(turned)
    if analog:
        file["parameters"]["ANALOG"]["RATE"]["value"] = [10.0 * fps]
        file["parameters"]["ANALOG"]["LABELS"]["value"] = tuple(f"Force{number}" for number in range(analog))
        file["data"]["analogs"] = np.random.default_rng(1).normal(size=(1, analog, 10 * frames))
    data = np.ones((4, len(turned), frames))
    data[:3] = np.stack(list(turned.values())).transpose(2, 0, 1)
    file["data"]["points"] = data
    file.write(str(path))
