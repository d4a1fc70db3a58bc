"""A film of a policy's walk in MuJoCo, made without a display."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from pipeline.clips.robot_clip import RobotClip
from pipeline.errors import PipelineError, UnknownNameError
from pipeline.validation.deployed import Deployed
from pipeline.viewing.film import write_film
from pipeline.viewing.live_walk import TERRAINS, LiveWalk
from pipeline.viewing.robot_figure import robot_figure

LONGEST_S = 120.0


@dataclass(frozen=True, kw_only=True)
class Walk:
    """What is filmed."""

    command: tuple[float, float, float]
    """Forward and left velocity [m/s], yaw rate [rad/s]."""
    seconds: float
    push: float | None = None
    """Impulse of a push to the left at half time [N s]; None: no push."""
    terrain: str = "flat"
    friction: float = 1.0


def record_walk(path: Path, one: Deployed, walk: Walk) -> str:
    """Write the film of a walk; a sentence about it. Raises UnknownNameError, FileError."""
    record, fell_s = simulated(one, walk)
    forward, lateral, yaw = walk.command
    text = f"command {forward:g} m/s, {lateral:g} m/s, {yaw:g} rad/s, {walk.terrain}"
    count = write_film(path, [robot_figure(record, one.robot)], text=text)
    end = f"; it fell at {fell_s:.2f} s" if fell_s is not None else ""
    return f"{path}: {count} pictures, {record.duration_s:.1f} s, {text}{end}"


def simulated(one: Deployed, walk: Walk) -> tuple[RobotClip, float | None]:
    """The walk at the control rate, and when the robot fell [s]; None if it did not."""
    if walk.terrain not in TERRAINS:
        raise UnknownNameError("terrain", walk.terrain, list(TERRAINS))
    if not 0.0 < walk.seconds <= LONGEST_S:
        raise PipelineError(
            f"a walk of {walk.seconds:g} s can't be filmed, allowed are more than 0 to {LONGEST_S:g} s."
        )
    live = LiveWalk(one, walk.terrain, walk.friction)
    live.goal = np.array(walk.command)
    fell_s = None
    steps = max(round(walk.seconds / live.control_s), 2)
    for step in range(steps):
        if walk.push is not None and step == steps // 2:
            live.push(walk.push, np.pi / 2.0)
        live.step()
        if live.fallen and fell_s is None:
            fell_s = live.time_s
    record = live.record()
    clip = RobotClip(
        name="walk",
        fps=one.task.control_hz,
        robot=one.robot.name,
        joint_names=one.robot.joint_names,
        root_pos_w=record.root_pos_w,
        root_quat_w=record.root_quat_w,
        joint_pos=record.joint_pos,
    )
    return clip, fell_s
