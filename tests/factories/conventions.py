"""One motion under the joint names, rest poses, units and axes of many programs, written as BVH.

The figure and its motion are those of `motion_files`; what a convention adds (joints between, fingers, a root above)
is rigid. Another rest pose changes every joint's frame: with R the turn of a joint's rest frame against the T pose its
offset is R_parent offset and its rotation R_parent rotation R^-1.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from scipy.spatial.transform import Rotation

from tests.factories.motion_files import JOINTS, NAMES, Poses

SIDES = ("Left", "Right")


@dataclass(frozen=True)
class Convention:
    """Names of the joints of one program; what is not named keeps the name of `motion_files`."""

    names: Mapping[str, str] = field(default_factory=dict)
    """Joint of the figure -> name; `{side}` in both stands for `Left` and `Right`."""
    prefix: str = ""
    above: tuple[str, ...] = ()
    """Roots above the hips."""
    between: Mapping[str, Sequence[str]] = field(default_factory=dict)
    """Joint of the figure -> joints between its parent and it, evenly on the way."""
    leaves: Mapping[str, Sequence[str]] = field(default_factory=dict)
    """Joint of the figure -> further joints that hang on it, such as fingers."""
    ends: tuple[str, ...] = ()
    """Joints of the figure that are End Sites here."""

    def sided(self, table: Mapping[str, object]) -> dict:
        """A table with `{side}` written out."""
        return {
            _fill(key, side): value if not isinstance(value, str) else _fill(value, side)
            for side in SIDES
            for key, value in table.items()
        }


def _fill(text: str, side: str) -> str:
    return text.replace("{side}", side).replace("{s}", side[0])


HUMAN_IK = {"Chest": "Spine2", "{side}Toe": "{side}ToeBase"}
XSENS = {
    "Spine": "Chest",
    "Chest": "Chest4",
    "{side}Shoulder": "{side}Collar",
    "{side}Arm": "{side}Shoulder",
    "{side}ForeArm": "{side}Elbow",
    "{side}Hand": "{side}Wrist",
    "{side}UpLeg": "{side}Hip",
    "{side}Leg": "{side}Knee",
    "{side}Foot": "{side}Ankle",
}
CONVENTIONS: dict[str, Convention] = {
    "mixamo": Convention(
        names=HUMAN_IK,
        prefix="mixamorig7:",
        between={"Chest": ["Spine1"]},
        leaves={"Head": ["HeadTop_End"], "LeftHand": ["LeftHandThumb1", "LeftHandIndex1"]},
    ),
    "rokoko": Convention(
        names={
            **XSENS,
            "Spine": "Spine1",
            "Chest": "Spine4",
            "{side}Shoulder": "{side}Shoulder",
            "{side}Arm": "{side}Arm",
            "{side}ForeArm": "{side}Forearm",
            "{side}Hand": "{side}Hand",
            "{side}UpLeg": "{side}Thigh",
            "{side}Leg": "{side}Shin",
            "{side}Foot": "{side}Foot",
        },
        above=("Root",),
        between={"Chest": ["Spine2", "Spine3"]},
    ),
    "xsens": Convention(names=XSENS, between={"Chest": ["Chest2", "Chest3"]}),
    "nokov": Convention(
        names={**HUMAN_IK, "Chest": "Spine1"}, prefix="Tester_01:", leaves={"LeftHand": ["LeftHandIndex1"]}
    ),
    "optitrack": Convention(
        names={
            "Hips": "Hip",
            "Spine": "Ab",
            "{side}Shoulder": "{s}Shoulder",
            "{side}Arm": "{s}UArm",
            "{side}ForeArm": "{s}FArm",
            "{side}Hand": "{s}Hand",
            "{side}UpLeg": "{s}Thigh",
            "{side}Leg": "{s}Shin",
            "{side}Foot": "{s}Foot",
            "{side}Toe": "{s}Toe",
        },
        prefix="Skeleton 001:",
    ),
    "perception_neuron": Convention(
        names={"Chest": "Spine3"},
        between={"Chest": ["Spine1", "Spine2"]},
        leaves={"LeftHand": ["LeftInHandIndex", "LeftHandThumb1"]},
        ends=("LeftToe", "RightToe"),
    ),
    "soma": Convention(
        names={
            "Spine": "Spine1",
            "Neck": "Neck1",
            "{side}UpLeg": "{side}Leg",
            "{side}Leg": "{side}Shin",
            "{side}Toe": "{side}ToeBase",
        },
        above=("Root",),
        between={"Chest": ["Spine2"], "Head": ["Neck2"]},
        leaves={"Head": ["HeadEnd", "Jaw", "LeftEye", "RightEye"], "LeftHand": ["LeftHandThumb1"]},
    ),
    "100style": Convention(names=XSENS, between={"Chest": ["Chest2", "Chest3"]}, prefix="Character1_"),
    "cmu": Convention(
        names={"Spine": "LowerBack", "Chest": "Spine1", "Neck": "Neck1", "{side}Toe": "{side}ToeBase"},
        between={"Chest": ["Spine"], "LeftUpLeg": ["LHipJoint"], "RightUpLeg": ["RHipJoint"]},
        leaves={"LeftHand": ["LeftFingerBase", "LThumb"]},
    ),
    "lafan1": Convention(names={"Chest": "Spine2"}, between={"Chest": ["Spine1"]}, above=("SimulationBone",)),
    "unreal": Convention(
        names={
            "Hips": "pelvis",
            "Spine": "spine_01",
            "Chest": "spine_03",
            "Neck": "neck_01",
            "Head": "head",
            **{
                f"{side}{old}": f"{new}_{side[0].lower()}"
                for side in SIDES
                for old, new in (
                    ("Shoulder", "clavicle"),
                    ("Arm", "upperarm"),
                    ("ForeArm", "lowerarm"),
                    ("Hand", "hand"),
                    ("UpLeg", "thigh"),
                    ("Leg", "calf"),
                    ("Foot", "foot"),
                    ("Toe", "ball"),
                )
            },
        },
        above=("root",),
        between={"Chest": ["spine_02"]},
        leaves={"LeftUpLeg": ["thigh_twist_01_l"]},
    ),
    "biped": Convention(
        names={
            "Hips": "Pelvis",
            "Chest": "Spine2",
            "{side}Shoulder": "{s} Clavicle",
            "{side}Arm": "{s} UpperArm",
            "{side}ForeArm": "{s} Forearm",
            "{side}Hand": "{s} Hand",
            "{side}UpLeg": "{s} Thigh",
            "{side}Leg": "{s} Calf",
            "{side}Foot": "{s} Foot",
            "{side}Toe": "{s} Toe0",
        },
        prefix="Bip01 ",
        between={"Chest": ["Spine1"]},
    ),
    "smpl": Convention(
        names={
            "Hips": "Pelvis",
            "Spine": "Spine1",
            "Chest": "Spine3",
            "{side}Shoulder": "{s}_Collar",
            "{side}Arm": "{s}_Shoulder",
            "{side}ForeArm": "{s}_Elbow",
            "{side}Hand": "{s}_Wrist",
            "{side}UpLeg": "{s}_Hip",
            "{side}Leg": "{s}_Knee",
            "{side}Foot": "{s}_Ankle",
            "{side}Toe": "{s}_Foot",
        },
        prefix="m_avg_",
        between={"Chest": ["Spine2"]},
        leaves={"LeftHand": ["L_Hand"], "RightHand": ["R_Hand"]},
    ),
    "xsens_mvn": Convention(
        names={
            "Hips": "Pelvis",
            "Spine": "L5",
            "Chest": "T8",
            "{side}Arm": "{side}UpperArm",
            "{side}UpLeg": "{side}UpperLeg",
            "{side}Leg": "{side}LowerLeg",
        },
        between={"Chest": ["L3", "T12"]},
    ),
    "rigify": Convention(
        names={
            "Hips": "spine",
            "Spine": "spine.001",
            "Chest": "spine.003",
            "Neck": "spine.004",
            "Head": "spine.006",
            "{side}Shoulder": "shoulder.{s}",
            "{side}Arm": "upper_arm.{s}",
            "{side}ForeArm": "forearm.{s}",
            "{side}Hand": "hand.{s}",
            "{side}UpLeg": "thigh.{s}",
            "{side}Leg": "shin.{s}",
            "{side}Foot": "foot.{s}",
            "{side}Toe": "toe.{s}",
        },
        prefix="DEF-",
        between={"Chest": ["spine.002"], "Head": ["spine.005"]},
    ),
}
"""By the program or data set whose names they are."""

DROP_DEG = {"T": 0.0, "A": 45.0, "hanging": 90.0}
"""How far the arms hang below the horizontal in each rest pose [deg]."""


def rest_turns(pose: str) -> dict[str, np.ndarray]:
    """Turn of each joint's rest frame against the T pose, y up and z ahead."""
    turns = {name: np.eye(3) for name in NAMES}
    for side, sign in (("Left", -1.0), ("Right", 1.0)):
        turn = Rotation.from_euler("z", sign * DROP_DEG[pose], degrees=True).as_matrix()
        turns |= {f"{side}{part}": turn for part in ("Arm", "ForeArm", "Hand")}
    return turns


def write_bvh(
    poses: Poses,
    convention: Convention,
    *,
    rest: str = "T",
    metres_per_unit: float = 0.01,
    frame_turn: np.ndarray | None = None,
    world_turn: np.ndarray | None = None,
    fps: float = 60.0,
) -> str:
    """The motion as a BVH of that convention.

    Args:
        frame_turn: rotation of every frame, world and joints alike
        world_turn: rotation of the world alone
    """
    turns = rest_turns(rest)
    frame = np.eye(3) if frame_turn is None else frame_turn
    world = np.eye(3) if world_turn is None else world_turn
    names, rows, lines = convention.sided(convention.names), [], []
    zero = np.zeros((poses.frames, 3))

    def channels(local: np.ndarray) -> np.ndarray:
        return Rotation.from_matrix(frame @ local @ frame.T).as_euler("ZXY", degrees=True)

    def opened(name: str, offset: np.ndarray, place: np.ndarray | None, angles: np.ndarray) -> None:
        lines.extend([f"{'JOINT' if lines else 'ROOT'} {convention.prefix}{name}", "{"])
        lines.append("OFFSET " + " ".join(f"{value:.7f}" for value in frame @ offset / metres_per_unit))
        if place is None:
            lines.append("CHANNELS 3 Zrotation Xrotation Yrotation")
        else:
            lines.append("CHANNELS 6 Xposition Yposition Zposition Zrotation Xrotation Yrotation")
            rows.append(place / metres_per_unit)
        rows.append(angles)

    def leaf(name: str, offset: np.ndarray) -> None:
        opened(name, offset, None, zero)
        lines.extend(["End Site", "{", "OFFSET 0 0 0", "}", "}"])

    def joint(name: str) -> None:
        parent, offset = JOINTS[name]
        above = np.eye(3) if parent is None else turns[parent]
        local = above @ poses.local[:, NAMES.index(name)] @ turns[name].T
        between = convention.between.get(name, ())
        step = above @ np.array(offset) / (len(between) + 1)
        for each in between:
            opened(each, step, None, zero)
        if parent is None:
            turned = Rotation.from_matrix(world @ frame @ local @ frame.T).as_euler("ZXY", degrees=True)
            opened(names.get(name, name), np.zeros(3), poses.root @ (world @ frame).T, turned)
        else:
            opened(names.get(name, name), step, None, channels(local))
        for number, each in enumerate(convention.leaves.get(name, ())):
            leaf(each, turns[name] @ np.array([0.03 * number, 0.04, 0.02]))
        children = [child for child, (of, _) in JOINTS.items() if of == name]
        for child in children:
            if child in convention.ends:
                end = frame @ turns[name] @ np.array(JOINTS[child][1]) / metres_per_unit
                lines.extend(["End Site", "{", "OFFSET " + " ".join(f"{value:.7f}" for value in end), "}"])
            else:
                joint(child)
        if not children and name not in convention.leaves:
            lines.extend(["End Site", "{", "OFFSET 0 0 0", "}"])
        lines.extend(["}"] * (1 + len(between)))

    for name in convention.above:
        opened(name, np.zeros(3), zero, zero)
    joint("Hips")
    lines.extend(["}"] * len(convention.above))
    text = ["HIERARCHY", *lines, "MOTION", f"Frames: {poses.frames}", f"Frame Time: {1.0 / fps:.7f}"]
    text += [" ".join(f"{value:.7f}" for value in row) for row in np.concatenate(rows, axis=1)]
    return "\n".join(text) + "\n"
