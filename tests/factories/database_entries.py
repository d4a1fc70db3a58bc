"""Entries of a small expert database, and the bytes of its files."""

from pathlib import Path

from pipeline.expert import ExpertEntry
from pipeline.robot import Robot
from tests.factories.robot_clips import wandering


def entries_of(robot: Robot, count: int = 2) -> list[ExpertEntry]:
    return [
        ExpertEntry(
            clip=wandering(robot, seed=index).cut(0, 60, f"source/clip{index}@0-60~mirror"),
            weight=1.0 + index,
            skill="walk",
            licence="CC0-1.0" if index else "CC-BY-NC-4.0",
            numbers={"file": "source/clip.bvh", "file_sha256": "ab", "foot_slip_mean": 0.02 * index, "mirrored": True},
            stages={"repair": {"version": "1"}},
        )
        for index in range(count)
    ]


def bytes_of(folder: Path) -> dict[str, bytes]:
    return {path.name: path.read_bytes() for path in sorted(folder.iterdir())}
