"""Content of a robot folder: its tables, `robot.toml`, and alternative joint names (`aliases.csv`, optional).

    joint,booster_2026
    Left_Knee_Pitch,left_knee_pitch_joint

Each further column of the aliases is a naming: of a newer model file, of recordings, of another deployment program. It
is not part of the robot's digest, since it does not affect computations.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path

from pipeline.errors import FileError
from pipeline.files.csv_json import read_csv_text
from pipeline.robot.robot_error import refuse
from pipeline.robot.tables import JointRow, LinkRow, ShapeRow, SiteRow, read_records

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
    """Part of the human body (`HUMAN_LINKS`) -> link that corresponds to it."""


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
    """File name -> text of each file."""
    namings: dict[str, tuple[str, ...]] = field(default_factory=dict)
    """Names of the joints in other namings, from `aliases.csv`."""
    aliases_text: str = ""
    """The text of `aliases.csv`; empty without the file."""

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


ALIASES = "aliases.csv"


def read_aliases(folder: Path, joints: Sequence[str]) -> tuple[dict[str, tuple[str, ...]], str]:
    """Names of the joints in their order by naming, and the text of the file; none without a file. Raises RobotError
    with every fault."""
    path = folder / ALIASES
    if not path.is_file():
        return {}, ""
    header, *rows = read_records(path) or [[]]
    if len(header) < 2 or header[0] != "joint" or len(set(header)) < len(header) or not all(header):
        problem = f"the columns are {', '.join(header) or 'missing'}."
        refuse([FileError(path, problem, "They must be joint and the name of each naming.", line=1)])
    lengths = {line: len(row) for line, row in enumerate(rows, start=2) if len(row) != len(header)}
    do = f"Write {len(header)}."
    refuse([FileError(path, f"the row has {n} values.", do, line) for line, n in lengths.items()])
    if [row[0] for row in rows] != list(joints):
        problem = "the joints are not those of joints.csv in their order."
        refuse([FileError(path, problem, f"Write a row for each of: {', '.join(joints)}.")])
    namings = {name: tuple(row[place] for row in rows) for place, name in enumerate(header) if place}
    refuse(_unclear(path, joints, namings))
    return namings, read_csv_text(path)


def _unclear(path: Path, joints: Sequence[str], namings: dict[str, tuple[str, ...]]) -> list[FileError]:
    """Faults for names that are empty or used for two joints."""
    owner = {joint: joint for joint in joints}
    faults = []
    for names in namings.values():
        for line, (joint, name) in enumerate(zip(joints, names, strict=True), start=2):
            if not name.strip() or owner.setdefault(name, joint) != joint:
                both = f"'{name}' stands for '{joint}', and for '{owner.get(name)}'."
                problem = both if name.strip() else f"'{joint}' has no name."
                faults.append(FileError(path, problem, "Give each joint a name of its own.", line))
    return faults
