"""What is asked of a run of `distil`: who teaches in which role, what teachers are told, and how it is learned."""

from __future__ import annotations

import dataclasses
import hashlib
import math
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from pipeline.learning.training_error import TrainingError
from pipeline.training.options import Options
from pipeline.training.roles import ROLES, Borders

BATCH = 4096
"""States of a step of least squares."""


@dataclass(frozen=True, kw_only=True)
class DistilRequest:
    """What is asked of a run."""

    out: Path
    preset: str
    options: Options
    """Of the environment."""
    teachers: dict[str, Path]
    """A policy file for each role that has one of its own."""
    start_from: Path | None
    """The policy file whose network is begun with; None: that of `other`."""
    num_envs: int
    device: str
    seed: int
    iterations: int
    minutes: float | None
    resume: bool
    memory: int
    """How many of the newest states are learned from."""
    passes: float
    """How often a state is learned from, in the mean, in the iteration that it comes with."""
    rate: float = 1e-3
    """Learning rate at first."""
    borders: Borders = field(default_factory=Borders)
    """Of the roles."""
    walks: dict[str, str] = field(default_factory=dict)
    """How fast the teacher of a role walks as it is told (`walked_speeds.py`)."""
    with_error: tuple[str, ...] = ()
    """Roles whose teachers are told what the velocity lacks on top of the command."""
    clip_joints: tuple[str, ...] = ()
    """Joints, by parts of their names, that are told by the clips (`clip_teacher.py`) …"""
    clip_roles: tuple[str, ...] = ("ahead", "fast")
    """… in these roles."""
    both_sides: tuple[str, ...] = ()
    """Roles whose teachers answer as they and their mirror images do, on average."""
    mirror_roles: tuple[str, ...] = ()
    """Roles of whose states half are learned as their mirror images."""
    beyond: dict[str, float] = field(default_factory=dict)
    """By which share the teacher of a role goes beyond what it does, away from who teaches `pushed` (`teachers.py`)."""
    physics: str | None = None

    def __post_init__(self) -> None:
        if self.memory < BATCH:
            raise TrainingError(f"--memory is {self.memory}; it must hold a batch of {BATCH} states at least.")
        if not 0.0 < self.passes < math.inf:
            raise TrainingError(f"--passes is {self.passes:g}; it must be a number over 0.")
        if not 0.0 < self.rate < math.inf:
            raise TrainingError(f"--rate is {self.rate:g}; it must be a number over 0.")
        for named, roles in (("--clip-role", self.clip_roles), ("--mirror-role", self.mirror_roles)):
            strangers = [role for role in roles if role not in ROLES]
            if strangers:
                raise TrainingError(f"{named} is '{strangers[0]}'; roles are {', '.join(ROLES)}.")
        if not self.clip_roles:
            raise TrainingError(f"--clip-role is ''; roles are {', '.join(ROLES)}.")

    def taught(self) -> dict[str, Any]:
        """Who teaches where, and what they are told."""
        borders = dataclasses.asdict(self.borders)
        return {
            "teachers": {role: digest_of(path) for role, path in sorted(self.teachers.items())},
            "borders": {name: each if math.isfinite(each) else None for name, each in borders.items()},
            "walks": self.walks,
            "both_sides": sorted(set(self.both_sides)),
            "with_error": sorted(set(self.with_error)),
            "clip_joints": sorted(set(self.clip_joints)),
            "clip_roles": sorted(set(self.clip_roles)),
            "mirror_roles": sorted(set(self.mirror_roles)),
            "beyond": self.beyond,
        }


def digest_of(path: Path) -> str:
    return hashlib.sha256(path.read_bytes()).hexdigest()
