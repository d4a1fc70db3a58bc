"""A robot folder as written: its tables and `robot.toml`."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path

from pipeline.robot.tables import JointRow, LinkRow, ShapeRow, SiteRow

CONFIG = "robot.toml"
LINKS, JOINTS, SHAPES, SITES = "links.csv", "joints.csv", "shapes.csv", "sites.csv"
FILES = (CONFIG, LINKS, JOINTS, SHAPES, SITES)
"""The source files of a robot folder."""

SIDES = ("left", "right")
HUMAN_LINKS = (
    "trunk",
    "pelvis",
    *(f"{side}_{part}" for side in SIDES for part in ("thigh", "shank", "foot", "upper_arm", "forearm")),
)
"""Parts of the human body that every robot must name a link for."""
HUMAN_SITES = tuple(
    f"{side}_{joint}" for side in SIDES for joint in ("hip", "knee", "ankle", "shoulder", "elbow", "wrist")
)
"""Joints of the human body that every robot must have a site of the same name for."""


@dataclass(frozen=True, kw_only=True)
class Config:
    """Content of `robot.toml`. Pairs are (left, right)."""

    root_link: str
    key_links: tuple[str, ...]
    """Links whose pose is used by tracking rewards and the discriminator; the root link first."""
    hands: tuple[str, str]
    """Sites at the ends of the arms."""
    feet: tuple[str, str]
    """Sites at the centres of the soles."""
    sole_corners: tuple[tuple[str, str, str, str], tuple[str, str, str, str]]
    """Sites at the corners of the soles, in order around each sole."""
    mirror_names: tuple[tuple[str, str], ...]
    """Parts of names that are swapped in the mirror image."""
    contact_excludes: tuple[tuple[str, str], ...]
    """Pairs of links without collision in simulation."""
    colours: dict[str, tuple[float, float, float]]
    """Red, green, blue in 0..1 of each colour named in the shapes table."""
    human_links: dict[str, str]
    """Part of the human body (`HUMAN_LINKS`) to the link that turns with it."""


@dataclass(frozen=True, kw_only=True)
class Description:
    """The tables of a robot folder. `links[0]` is the root link; parents precede their children."""

    folder: Path
    config: Config
    links: tuple[LinkRow, ...]
    joints: tuple[JointRow, ...]
    shapes: tuple[ShapeRow, ...]
    sites: tuple[SiteRow, ...]
    contents: dict[str, str]
    """Text of each file that was read, by its name."""
    namings: dict[str, tuple[str, ...]] = field(default_factory=dict)
    """Names of the joints in other namings, from `aliases.csv`."""
    aliases_text: str = ""
    """The text of `aliases.csv`; empty where there is none."""

    @property
    def name(self) -> str:
        return self.folder.name

    @cached_property
    def link_names(self) -> tuple[str, ...]:
        return tuple(row.link for row in self.links)

    @cached_property
    def joint_rows(self) -> dict[str, JointRow]:
        """Rows of the joints table by joint."""
        return {row.joint: row for row in self.joints}

    def children(self, link: str) -> list[LinkRow]:
        return [row for row in self.links if row.parent == link]
