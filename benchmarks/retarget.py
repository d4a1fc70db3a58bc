"""Speed and quality of retargeting on human clips, pooled and frame-weighted, against the project's bars.

    python benchmarks/retarget.py [--fps 30] [--json] [--each] FILE_OR_FOLDER...

The stance labels are the scorer's own (from the human's toes, three strictnesses), never the planner's. Self-collision
is contact between the robot's collision primitives in MuJoCo.
"""

from __future__ import annotations

import argparse
import dataclasses
import json
import platform
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import mujoco
import numpy as np

ROOT = Path(__file__).resolve().parent.parent
sys.path.insert(0, str(ROOT))

from pipeline import time_series  # noqa: E402
from pipeline.clips.human_clip import FEET, HumanClip  # noqa: E402
from pipeline.clips.robot_clip import RobotClip  # noqa: E402
from pipeline.files import settings as settings_file  # noqa: E402
from pipeline.quality import retargeting  # noqa: E402
from pipeline.readers import read_motion  # noqa: E402
from pipeline.repair import RepairSettings  # noqa: E402
from pipeline.repair import process as repair  # noqa: E402
from pipeline.retarget import RetargetSettings, process  # noqa: E402
from pipeline.retarget.resample import resampled  # noqa: E402
from pipeline.robot import Kinematics, Robot, load_robot, mujoco_model  # noqa: E402

LABELS = {"strict": (0.015, 0.20), "middle": (0.025, 0.45), "loose": (0.04, 0.8)}
"""Strictness: (toe height over its 5th percentile [m], horizontal toe speed [m/s]) below which a foot stands."""
VERTICAL_SPEED_M_S = 0.4
COLLISION_DEPTH = 0.002
"""[m] Contacts up to this deep don't count."""

BARS = (
    # name, unit, sense, bound
    ("frames per second", "1/s", ">=", 6400.0),
    ("frames over a position limit", "%", "<=", 0.0),
    ("frames over a speed limit", "%", "<=", 0.0),
    ("slip strict", "m/s", "<=", 0.012),
    ("slip middle", "m/s", "<=", 0.010),
    ("drift in a stance", "cm", "<=", 0.5),
    ("deepest penetration", "cm", "<=", 1.5),
    ("frames over 1 cm deep", "%", "<=", 0.3),
    ("jerk", "rad/s3", "<=", 220.0),
    ("jump frames", "%", "<=", 0.4),
    ("self-collision frames", "%", "<=", 1.0),
    ("deepest self-collision", "cm", "<=", 2.0),
    ("limb direction error", "deg", "<=", 2.5),
    ("thigh direction error", "deg", "<=", 4.0),
    ("shank direction error", "deg", "<=", 4.0),
    ("trunk orientation error", "deg", "<=", 3.5),
    ("pelvis heading error", "deg", "<=", 2.0),
    ("height shift", "mm", "<=", 5.0),
)


def stance_labels(human: HumanClip, strictness: str) -> np.ndarray:
    """(t, 2) frames in which a foot stands: toe low and slow, five-frame median (at 30 fps)."""
    height_limit, speed_limit = LABELS[strictness]
    width = 2 * round(human.fps / 15.0) + 1
    columns = []
    for side in FEET:
        toe = human.pos(f"{side}_toe")
        velocity = time_series.derivative(toe, human.fps)
        label = toe[:, 2] < np.percentile(toe[:, 2], 5.0) + height_limit
        label &= np.linalg.norm(velocity[:, :2], axis=1) < speed_limit
        label &= np.abs(velocity[:, 2]) < VERTICAL_SPEED_M_S
        columns.append(time_series.moving_mean(label.astype(float), width) > 0.5)
    return np.stack(columns, axis=1)


def score(human: HumanClip, clip: RobotClip, robot: Robot, model: mujoco.MjModel) -> dict[str, np.ndarray]:
    """Arrays to pool over clips: one value a frame (or a stance frame, or a stance)."""
    kinematics = Kinematics(robot)
    poses = kinematics.forward(clip.root_pos_w, clip.root_quat_w, clip.joint_pos)
    soles = kinematics.site_pos_w(poses, robot.feet)
    corners = kinematics.site_pos_w(poses, (*robot.sole_corners[0], *robot.sole_corners[1]))[..., 2]
    speed = np.linalg.norm(time_series.derivative(soles[..., :2], clip.fps), axis=-1)
    result: dict[str, np.ndarray] = {}
    for strictness in LABELS:
        labels = stance_labels(human, strictness)
        inner = labels.copy()
        inner[1:] &= labels[:-1]
        inner[:-1] &= labels[1:]
        result[f"slip {strictness}"] = speed[inner]
        if strictness == "middle":
            shift = float(np.median(soles[..., 2][labels])) if labels.any() else 0.0
            result["drift in a stance"] = 100 * np.concatenate(
                [retargeting.stance_drifts(soles[:, side], labels[:, side]) for side in range(2)]
            )
    depth = np.maximum(0.0, shift - corners.min(axis=1))
    limbs = np.rad2deg(retargeting.limb_direction_error(human, poses, robot))
    steps = np.abs(np.diff(clip.joint_pos, axis=0)) * clip.fps
    third = np.abs(np.diff(clip.joint_pos[:, robot.controlled_index], n=3, axis=0)).mean(axis=1) * clip.fps**3
    outside = (clip.joint_pos < robot.joint_lower) | (clip.joint_pos > robot.joint_upper)
    collision, pairs = self_collision(clip, model)
    return result | {
        "frames over a position limit": 100.0 * outside.any(axis=1),
        "frames over a speed limit": 100.0 * (steps > robot.retarget_speed_limit).any(axis=1),
        "deepest penetration": 100 * depth,
        "frames over 1 cm deep": 100.0 * (depth > 0.01),
        "jerk": third,
        "jump frames": 100.0 * retargeting.jump_frames(clip),
        "self-collision frames": 100.0 * (collision > COLLISION_DEPTH),
        "deepest self-collision": 100 * collision,
        "limb direction error": limbs.mean(axis=1),
        "thigh direction error": limbs[:, 0:2].mean(axis=1),
        "shank direction error": limbs[:, 2:4].mean(axis=1),
        "trunk orientation error": np.rad2deg(retargeting.trunk_orientation_error(human, poses, robot)),
        "pelvis heading error": np.rad2deg(retargeting.pelvis_heading_error(human, poses, robot)),
        "height shift": np.array([1000.0 * abs(shift)]),
        "pairs": pairs,
    }


def self_collision(clip: RobotClip, model: mujoco.MjModel) -> tuple[np.ndarray, dict[tuple[str, str], int]]:
    """Depth [m] (t,) of the deepest contact between links a frame, and frames a pair of links."""
    data = mujoco.MjData(model)
    depth, pairs = np.zeros(clip.frame_count), {}
    for frame in range(clip.frame_count):
        data.qpos[:3], data.qpos[3:7] = clip.root_pos_w[frame], clip.root_quat_w[frame]
        data.qpos[7:] = clip.joint_pos[frame]
        mujoco.mj_kinematics(model, data)
        mujoco.mj_collision(model, data)
        for contact in data.contact:
            if contact.dist < -COLLISION_DEPTH:
                names = sorted(model.body(int(model.geom_bodyid[g])).name for g in contact.geom)
                pairs[tuple(names)] = pairs.get(tuple(names), 0) + 1
            depth[frame] = max(depth[frame], -contact.dist)
    return depth, pairs


def pooled(name: str, values: np.ndarray) -> float:
    """The figure of one measure over all clips: the largest for depths, else the mean."""
    if len(values) == 0:
        return 0.0
    return float(values.max() if name.startswith("deepest") or name == "height shift" else values.mean())


def files_in(paths: list[Path]) -> Iterator[Path]:
    for path in paths:
        yield from sorted(path.rglob("*.bvh")) if path.is_dir() else [path]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("paths", nargs="+", type=Path)
    parser.add_argument("--fps", type=float, default=30.0)
    parser.add_argument("--robot", default="t1")
    parser.add_argument("--settings", type=Path, default=ROOT / "data/retarget.yaml")
    parser.add_argument("--json", action="store_true")
    parser.add_argument("--raw", action="store_true", help="clips as recorded, without repair")
    parser.add_argument("--each", action="store_true", help="one line a clip, too")
    arguments = parser.parse_args()
    robot = load_robot(arguments.robot)
    model = mujoco_model(robot)
    settings = settings_file.read(arguments.settings, RetargetSettings)
    settings = dataclasses.replace(settings, fps=arguments.fps)
    scores, frames, seconds, pairs = [], 0, 0.0, {}
    for human in repaired(files_in(arguments.paths), arguments.raw):
        start_s = time.process_time()
        outcome = process(human, {}, settings=settings, robot=robot)
        spent_s = time.process_time() - start_s
        clip = outcome.pieces[0].clip
        scored = score(resampled(human, settings.fps), clip, robot, model)
        for pair, count in scored.pop("pairs").items():
            pairs[pair] = pairs.get(pair, 0) + count
        scores.append(scored)
        frames, seconds = frames + clip.frame_count, seconds + spent_s
        if arguments.each:
            line = "  ".join(f"{name.split()[0]} {pooled(name, scored[name]):.3g}" for name, *_ in BARS[1:])
            print(f"{human.name}: {clip.frame_count} frames  {line}")
    if not scores:
        parser.error("repair left nothing of these clips; --raw takes them as recorded")
    pool = {name: np.concatenate([scored[name] for scored in scores]) for name in scores[0]}
    figures = {"frames per second": frames / seconds} | {name: pooled(name, values) for name, values in pool.items()}
    report(figures, pairs, arguments.json)


def repaired(paths: Iterator[Path], raw: bool) -> Iterator[HumanClip]:
    """The clips of the files as repair hands them on, or as they were recorded."""
    settings = settings_file.read(ROOT / "data/repair.yaml", RepairSettings)
    for path in paths:
        clip = read_motion(path, path.stem).clip
        pieces = [clip] if raw else [piece.clip for piece in repair(clip, {}, settings=settings).pieces]
        yield from (piece for piece in pieces if isinstance(piece, HumanClip))


def report(figures: dict[str, float], pairs: dict, as_json: bool) -> None:
    bars = []
    for name, unit, sense, bound in BARS:
        value = figures[name]
        holds = value >= bound if sense == ">=" else value <= bound
        bars.append({"name": name, "value": value, "unit": unit, "bound": f"{sense} {bound:g}", "holds": holds})
    if as_json:
        machine = f"{platform.machine()}, {platform.python_implementation()} {platform.python_version()}"
        print(json.dumps({"bars": bars, "machine": machine}, indent=1))
        return
    for bar in bars:
        mark = "" if bar["holds"] else "MISSED"
        print(f"{bar['name']:32} {bar['value']:10.4g} {bar['unit']:7} {bar['bound']:>10}  {mark}")
    print(f"{'slip loose':32} {figures['slip loose']:10.4g} m/s")
    worst = sorted(pairs.items(), key=lambda item: -item[1])[:12]
    print("collisions: " + ", ".join(f"{'-'.join(pair)} {count}" for pair, count in worst))


if __name__ == "__main__":
    main()
