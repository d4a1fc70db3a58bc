"""Motion files of every format from one motion of a figure, written with scipy and plain matrices.

`Figure` and `poses` are the truth; each writer turns it into a file by its own arithmetic, so that a test
holds a reader against something it shares no code with.
"""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

JOINTS: dict[str, tuple[str | None, tuple[float, float, float]]] = {
    "Hips": (None, (0.0, 0.0, 0.0)),
    "Spine": ("Hips", (0.0, 0.10, -0.01)),
    "Chest": ("Spine", (0.0, 0.20, 0.0)),
    "Neck": ("Chest", (0.0, 0.22, 0.0)),
    "Head": ("Neck", (0.0, 0.08, 0.015)),
    "LeftShoulder": ("Chest", (0.03, 0.15, 0.0)),
    "LeftArm": ("LeftShoulder", (0.15, -0.015, -0.01)),
    "LeftForeArm": ("LeftArm", (0.32, 0.0, 0.0)),
    "LeftHand": ("LeftForeArm", (0.25, 0.0, 0.0)),
    "RightShoulder": ("Chest", (-0.03, 0.15, 0.0)),
    "RightArm": ("RightShoulder", (-0.15, -0.015, -0.01)),
    "RightForeArm": ("RightArm", (-0.32, 0.0, 0.0)),
    "RightHand": ("RightForeArm", (-0.25, 0.0, 0.0)),
    "LeftUpLeg": ("Hips", (0.09, -0.05, 0.0)),
    "LeftLeg": ("LeftUpLeg", (0.0, -0.42, 0.0)),
    "LeftFoot": ("LeftLeg", (0.0, -0.43, 0.0)),
    "LeftToe": ("LeftFoot", (0.0, -0.06, 0.13)),
    "RightUpLeg": ("Hips", (-0.09, -0.05, 0.0)),
    "RightLeg": ("RightUpLeg", (0.0, -0.42, 0.0)),
    "RightFoot": ("RightLeg", (0.0, -0.43, 0.0)),
    "RightToe": ("RightFoot", (0.0, -0.06, 0.13)),
}
"""A T-pose figure: joint -> parent and offset [m], x left, y up, z forward; names as the project's own BVH."""

NAMES = tuple(JOINTS)


@dataclass(frozen=True)
class Poses:
    """T frames: the root's position [m] (t, 3) and every joint's rotation in its parent's frame (t, j, 3, 3), y up."""

    root: np.ndarray
    local: np.ndarray

    @property
    def frames(self) -> int:
        return len(self.root)


def upright(frames: int, seed: int | None = None) -> Poses:
    """The rest pose walking along z (forward); with a seed, every joint turns smoothly by up to half a radian."""
    time = np.linspace(0.0, 1.0, frames)
    root = np.stack([0.05 * np.sin(6 * time), 0.95 + 0.0 * time, 1.2 * time], axis=1)
    local = np.broadcast_to(np.eye(3), (frames, len(NAMES), 3, 3)).copy()
    if seed is not None:
        random = np.random.default_rng(seed)
        phase, axis = random.uniform(0, 6.28, (len(NAMES), 3)), random.uniform(-0.3, 0.3, (len(NAMES), 3))
        angles = axis * np.sin(5 * time[:, None, None] + phase)
        local = Rotation.from_rotvec(angles.reshape(-1, 3)).as_matrix().reshape(frames, len(NAMES), 3, 3)
    return Poses(root=root, local=local)


def world(poses: Poses) -> tuple[np.ndarray, np.ndarray]:
    """Joint positions [m] (t, j, 3) and rotations (t, j, 3, 3) by 4x4 matrices, frame by frame, y up."""
    pos, turn = np.zeros((poses.frames, len(NAMES), 3)), np.zeros((poses.frames, len(NAMES), 3, 3))
    for frame in range(poses.frames):
        placed: dict[str, np.ndarray] = {}
        for index, (name, (parent, offset)) in enumerate(JOINTS.items()):
            local = np.eye(4)
            local[:3, :3] = poses.local[frame, index]
            local[:3, 3] = poses.root[frame] if parent is None else offset
            placed[name] = local if parent is None else placed[parent] @ local
            pos[frame, index], turn[frame, index] = placed[name][:3, 3], placed[name][:3, :3]
    return pos, turn


@dataclass(frozen=True)
class BvhStyle:
    """How a BVH is written: none of it changes the motion."""

    metres_per_unit: float = 0.01
    orders: tuple[str, ...] = ("ZXY",)
    """Orders of the rotation channels, taken in turn by the joints."""
    position_order: str = "XYZ"
    all_positions: bool = False
    """Six channels in every joint."""
    root_turn: np.ndarray | None = None
    """Rotation of the world: other axes for the world, the joints' frames stay."""
    frame_turn: np.ndarray | None = None
    """Rotation of every frame, world and joints alike: how a z-up program exports."""
    line_end: str = "\n"
    start: str = ""
    indent: str = "  "
    fps: float = 60.0


def bvh(poses: Poses, style: BvhStyle = BvhStyle()) -> str:
    """A BVH file of the motion."""
    lines = [f"{style.start}HIERARCHY", *_hierarchy("Hips", 0, style), "MOTION", f"Frames: {poses.frames}"]
    lines.append(f"Frame Time: {1.0 / style.fps:.7f}")
    lines += [" ".join(f"{value:.9f}" for value in row) for row in bvh_rows(poses, style)]
    return style.line_end.join(lines) + style.line_end


def bvh_rows(poses: Poses, style: BvhStyle) -> np.ndarray:
    """The numbers of the motion block (t, c), joint by joint in the order of the hierarchy."""
    turn = np.eye(3) if style.frame_turn is None else style.frame_turn
    world_turn = np.eye(3) if style.root_turn is None else style.root_turn
    columns = []
    for name in _depth_first("Hips"):
        index = NAMES.index(name)
        local = turn @ poses.local[:, index] @ turn.T
        place = np.broadcast_to(turn @ np.array(JOINTS[name][1]), (poses.frames, 3))
        if name == "Hips":
            local, place = world_turn @ local, poses.root @ (world_turn @ turn).T
        if name == "Hips" or style.all_positions:
            columns.append(place[:, ["XYZ".index(axis) for axis in style.position_order]] / style.metres_per_unit)
        columns.append(Rotation.from_matrix(local).as_euler(_order(name, style), degrees=True))
    return np.concatenate(columns, axis=1)


def _order(name: str, style: BvhStyle) -> str:
    return style.orders[NAMES.index(name) % len(style.orders)]


def _depth_first(name: str) -> list[str]:
    children = [child for child, (parent, _) in JOINTS.items() if parent == name]
    return [name, *(entry for child in children for entry in _depth_first(child))]


def _hierarchy(name: str, depth: int, style: BvhStyle) -> list[str]:
    pad, inner = style.indent * depth, style.indent * (depth + 1)
    turn = np.eye(3) if style.frame_turn is None else style.frame_turn
    offset = turn @ np.array(JOINTS[name][1]) / style.metres_per_unit
    channels = [f"{axis}rotation" for axis in _order(name, style)]
    if name == "Hips" or style.all_positions:
        channels = [f"{axis}position" for axis in style.position_order] + channels
    lines = [f"{pad}{'ROOT' if depth == 0 else 'JOINT'} {name}", f"{pad}{{"]
    lines += [f"{inner}OFFSET {' '.join(f'{value:.9f}' for value in offset)}"]
    lines += [f"{inner}CHANNELS {len(channels)} {' '.join(channels)}"]
    children = [child for child, (parent, _) in JOINTS.items() if parent == name]
    for child in children:
        lines += _hierarchy(child, depth + 1, style)
    if not children:
        lines += [f"{inner}End Site", f"{inner}{{", f"{inner}{style.indent}OFFSET 0 0 0", f"{inner}}}"]
    return [*lines, f"{pad}}}"]


def smpl_npz(path: Path, *, frames: int = 20, poses: np.ndarray | None = None, **extra) -> Path:
    """An AMASS-style archive, z up: standing in the T-pose, walking along -y, which is where z of the model points."""
    if poses is None:
        poses = np.zeros((frames, 72))
        poses[:, 0] = np.pi / 2  # the model's y up becomes z up
    trans = np.stack([np.zeros(len(poses)), -0.02 * np.arange(len(poses)), np.full(len(poses), 0.95)], axis=1)
    arrays = {"poses": poses, "trans": trans, "betas": np.zeros(10), "mocap_framerate": 30, **extra}
    np.savez(path, **{name: value for name, value in arrays.items() if value is not None})
    return path


def deepmimic(rows: int = 20, frame_s: float = 1 / 30) -> dict:
    """A DeepMimic motion of the figure standing and gliding along x; edit `Frames` to move it."""
    ball = [1.0, 0.0, 0.0, 0.0]
    leg, arm = [*ball, 0.0, *ball], [*ball, 0.0]
    body = [*ball, *ball, *ball, *leg, *arm, *leg, *arm]
    return {"Loop": "none", "Frames": [[frame_s, 0.02 * row, 0.9, 0.0, *body] for row in range(rows)]}


def write_deepmimic(path: Path, motion: dict) -> Path:
    path.write_text(json.dumps(motion))
    return path


ASF = """:version 1.10
:name TEST
:units
  mass 1.0
  length 0.45
  angle deg
:root
   order TX TY TZ RX RY RZ
   axis XYZ
   position 0 0 0
   orientation 0 0 0
:bonedata
{bones}
:hierarchy
  begin
    root lhipjoint rhipjoint lowerback
    lhipjoint lfemur
    lfemur ltibia
    ltibia lfoot
    lfoot ltoes
    rhipjoint rfemur
    rfemur rtibia
    rtibia rfoot
    rfoot rtoes
    lowerback upperback
    upperback thorax
    thorax lowerneck lclavicle rclavicle
    lowerneck upperneck
    upperneck head
    lclavicle lhumerus
    lhumerus lradius
    lradius lwrist
    lwrist lhand
    rclavicle rhumerus
    rhumerus rradius
    rradius rwrist
    rwrist rhand
  end
"""

_TRUNK = [
    ("lowerback", "0 1 0", 1.9, "0 0 0", "rx ry rz"),
    ("upperback", "0 1 0", 1.9, "0 0 0", "rx ry rz"),
    ("thorax", "0 1 0", 1.9, "0 0 0", "rx ry rz"),
    ("lowerneck", "0 1 0", 1.8, "0 0 0", "rx ry rz"),
    ("upperneck", "0 1 0", 1.8, "0 0 0", "rx ry rz"),
    ("head", "0 1 0", 1.8, "0 0 0", "rx ry rz"),
]


def asf_bones() -> list[tuple[str, str, float, str, str]]:
    """Name, direction, length [1/.45 inch], axis [deg] and degrees of freedom of each bone; CMU's figure."""
    bones = list(_TRUNK)
    for side, sign in (("l", 1), ("r", -1)):
        spread = f"{0.34202 * sign} -0.939693 0"
        bones += [
            (f"{side}hipjoint", f"{0.7 * sign} -0.7 0", 2.5, "0 0 0", ""),
            (f"{side}femur", spread, 7.4, f"0 0 {20 * sign}", "rx ry rz"),
            (f"{side}tibia", spread, 7.6, f"0 0 {20 * sign}", "rx"),
            (f"{side}foot", "0 0 1", 2.3, f"-90 0 {20 * sign}", "rx rz"),
            (f"{side}toes", "0 0 1", 1.0, f"-90 0 {20 * sign}", "rx"),
            (f"{side}clavicle", f"{sign} 0.2 0", 3.7, "0 0 0", "ry rz"),
            (f"{side}humerus", f"{sign} 0 0", 4.9, f"180 {-30 * sign} {-90 * sign}", "rx ry rz"),
            (f"{side}radius", f"{sign} 0 0", 2.6, f"180 {-30 * sign} {-90 * sign}", "rx"),
            (f"{side}wrist", f"{sign} 0 0", 1.3, f"0 {90 * sign} {90 * sign}", "ry"),
            (f"{side}hand", f"{sign} 0 0", 0.7, f"0 {90 * sign} {90 * sign}", "rx rz"),
        ]
    return bones


def asf() -> str:
    """An ASF file of that figure."""
    blocks = []
    for number, (name, direction, length, axis, dof) in enumerate(asf_bones(), start=1):
        lines = ["begin", f"id {number}", f"name {name}", f"direction {direction}", f"length {length}"]
        lines += [f"axis {axis} XYZ", *([f"dof {dof}"] if dof else []), "end"]
        blocks.append("\n".join(f"     {line}" for line in lines))
    return ASF.replace("{bones}", "\n".join(blocks))


def amc(frames: list[dict[str, list[float]]], root: list[list[float]]) -> str:
    """An AMC file: per frame the root's six numbers and the bones that are not at zero."""
    lines = ["#!OML:ASF test", ":FULLY-SPECIFIED", ":DEGREES"]
    for number, (values, place) in enumerate(zip(frames, root, strict=True), start=1):
        lines += [str(number), f"root {' '.join(map(str, place))}"]
        for name, _, _, _, dof in asf_bones():
            if dof:
                turn = values.get(name, [0.0] * len(dof.split()))
                lines.append(f"{name} {' '.join(map(str, turn))}")
    return "\n".join(lines) + "\n"
