"""Arguments of the commands on motions, databases and robots, as dataclasses that tyro reads: a field is an option, its
docstring the help. Those on policies are in `policy_arguments.py`.

Nothing heavy is imported here: `booster-lab --help`, a typo and shell completion need the two files alone.
"""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal

from tyro.conf import OmitArgPrefixes, Positional, arg

from pipeline.cli.option_types import (
    File,
    Folder,
    Hertz,
    Naming,
    Number,
    RobotName,
    Text,
    integer,
    option,
    rate,
)

MOST_ASKINGS = 100
"""As `pipeline.batch.store` has it, which is not imported here."""


@dataclass(frozen=True, kw_only=True)
class FileStatement:
    """What the file does not say itself. Needed only when a command asks for it. See docs/sources.md."""

    unit: Text = None
    """unit of length: m, cm, mm, inch, cmu, or metres per unit"""
    up: Annotated[str | None, option("AXIS", str)] = None
    """axis that points up: x, y, z, -x, -y, -z (write --up=-y)"""
    fps: Annotated[float | None, option("HZ", rate), arg(name="source-fps")] = None
    """true frame rate, instead of what the file declares"""
    skeleton: Annotated[str | None, option("MAP", str)] = None
    """name of a skeleton map, or the path of your own (.yaml)"""
    asf: Annotated[str | None, option("FILE", str)] = None
    """the ASF file of an AMC, from the AMC's folder"""
    body_model: Annotated[str | None, option("NPZ", str)] = None
    """your own SMPL body model"""
    quaternion: Annotated[Literal["wxyz", "xyzw"] | None, option("{wxyz,xyzw}", str, ("wxyz", "xyzw"))] = None
    """order of a robot's root quaternion"""


Statement = OmitArgPrefixes[FileStatement]


@dataclass(frozen=True, kw_only=True)
class Inspect:
    """Show what a motion file is and what is wrong with it.

    Format, skeleton, unit, axes and rate of a motion file, its speeds, its windows of one skill, and everything that
    the project repairs, cuts or rejects, with the reason. A folder gives one line per file. A clip made by the graph
    (by name, or its file in the database) gives every feasibility criterion: value, threshold, unit, source, verdict.
    """

    input: Annotated[Positional[Path], arg(metavar="IN")]
    """a motion file, a folder of them, or a clip made by the graph"""
    robot: RobotName = "t1"
    json: bool = False
    """print a JSON object (for a folder: a list of them)"""
    write_map: bool = False
    """print the skeleton map of a file (YAML) instead: the one it is read with, or one to start from"""
    statement: Statement = FileStatement()


@dataclass(frozen=True, kw_only=True)
class Retarget:
    """Retarget a motion onto the robot, as CSV.

    Reads a motion file, repairs it, retargets it onto the robot and writes the robot's motion as CSV: root position
    [m], root quaternion xyzw, joints [rad] by name. Where damage cuts the motion, the longest piece goes to OUT.csv and
    the others, in order of time, to OUT.1.csv, OUT.2.csv, …
    """

    input: Annotated[Positional[Path], arg(metavar="IN")]
    """motion file (.amc, .bvh, .c3d, .csv, .glb, .gltf, .mcap, .npz, .pkl, .pt, .txt)"""
    out: Annotated[Path, arg(metavar="OUT.csv")]
    """where to write"""
    robot: RobotName = "t1"
    fps: Hertz = 30.0
    """rate of OUT.csv"""
    naming: Naming = None
    statement: Statement = FileStatement()


@dataclass(frozen=True, kw_only=True)
class Score:
    """Score how well a robot motion reproduces a human motion.

    Compares a robot motion (CSV, from this project or any other retargeting) with the human motion it was made from:
    feet, ground, limits, smoothness, self-collision, likeness. The human file is read and repaired as for `retarget`;
    the CSV must start with its first frame, in the world frame that repair leaves it in.
    """

    csv: Annotated[Positional[Path], arg(metavar="CSV")]
    """the robot's motion"""
    human: Annotated[Path, arg(metavar="CLIP")]
    """the human's motion file"""
    fps: Annotated[float | None, option("HZ", rate)] = None
    """rate of CSV, where the file does not state it"""
    json: bool = False
    """print a JSON object"""
    statement: Statement = FileStatement()


@dataclass(frozen=True, kw_only=True)
class Export:
    """Write the database's clips as other programs load them, with a dataset card.

    Writes every clip of a database as an archive for mjlab and BeyondMimic (`mjlab`) or for GMR without pickle (`gmr`),
    as a Rerun recording (`rerun`, needs the extra booster-lab[export]), or all of them as one LeRobotDataset v3
    (`lerobot`); and a dataset card (README.md) with sources, licences, seconds by skill and how it was made.
    """

    database: Annotated[Positional[Path], arg(metavar="DATABASE")]
    """folder of a database (data/expert_db/t1)"""
    format: Literal["mjlab", "gmr", "lerobot", "rerun"]
    """what to write"""
    out: Annotated[Path, arg(metavar="FOLDER")]
    """folder to write into"""
    skill: Annotated[tuple[str, ...], arg(metavar="NAME")] = ()
    """only clips of these skills"""
    naming: Naming = None


@dataclass(frozen=True, kw_only=True)
class Database:
    """Say what the expert database holds, list its versions, or put one in place.

    Earlier versions of the expert database are kept beside it, and so is a version that was refused because it lost too
    many clips. `restore VERSION` puts one in place and keeps the present one.
    """

    action: Positional[Literal["summary", "list", "restore"]]
    """say what the database in place holds and what to do next; list it and the kept versions; or put one in place"""
    version: Annotated[Positional[str | None], option("VERSION", str)] = None
    """version to restore, as `list` shows it"""
    robot: RobotName = "t1"


@dataclass(frozen=True, kw_only=True)
class Sources:
    """List the motion folders in use, or forget one.

    Runs record which motion folders they used. A folder of BOOSTER_LAB_MOTIONS stays a source until it is forgotten; a
    missing source stops a run before its clips leave the database.
    """

    action: Positional[Literal["list", "forget"]]
    """list the sources that runs have used; or remove some, and the next run makes the database without them"""
    names: Annotated[Positional[tuple[str, ...]], arg(metavar="NAME")] = ()
    """sources to forget, as `list` shows them"""


@dataclass(frozen=True, kw_only=True)
class Store:
    """Say how large the store is, or delete what no run needs any more.

    The store keeps the clips and answers of earlier settings, so that going back to them costs nothing. `gc` collects
    those that the last runs did not ask for: it says what it would delete, and deletes it with --delete. What the
    present results name is always kept, and what was deleted is made again when it is wanted.
    """

    action: Positional[Literal["size", "gc"]]
    """say how large the store is; or find, and with --delete remove, what no run needs"""
    keep: Annotated[int, option("N", integer("a number of runs", 1, MOST_ASKINGS))] = 5
    """runs of each stage whose answers are kept"""
    delete: bool = False
    """delete; without it nothing is changed"""


@dataclass(frozen=True, kw_only=True)
class View:
    """Play a clip: human and robot side by side.

    Plays a clip in the browser. CLIP is a motion file (repaired and retargeted first), a clip of the database
    (data/expert_db/t1/….json), or the name of a clip that the graph made, such as booster_lab/walk or
    booster_lab/walk@0-840~mirror; with the name of a whole recording, every clip made from it can be chosen in the
    browser. A rollout (…~rollout) plays beside the reference that it tracks; a robot log (.mcap) beside the simulation
    of the same command, with its failures. With --record a film is written instead, without a display.
    """

    clip: Annotated[Positional[str], arg(metavar="CLIP")]
    """motion file, robot log, clip of the database, or name of a clip"""
    robot: RobotName = "t1"
    port: Annotated[int, option("PORT", integer("a port", 1, 65535))] = 8080
    """port of the page; the next free one where it is taken"""
    host: Annotated[str, arg(metavar="ADDRESS")] = "127.0.0.1"
    """address to serve on; the default serves this machine only"""
    no_browser: bool = False
    """serve the page but do not open it"""
    picture: Annotated[Path | None, option("OUT.png", Path)] = None
    """write poses along the clip to a picture"""
    poses: Annotated[int, option("N", integer("a number of poses", 1, 40))] = 8
    """poses in the picture"""
    record: Annotated[Path | None, option("OUT", Path)] = None
    """write an .mp4 or .gif"""
    start: float = 0.0
    """where the film begins [s]"""
    seconds: Number = None
    """length of the film [s]; to the end where not given"""
    statement: Statement = FileStatement()


@dataclass(frozen=True, kw_only=True)
class Curate:
    """Find, watch, accept and exclude clips in the browser.

    A gallery of all clips that the graph has made, with figures, thresholds and playback. Decisions are written into
    data/curation.yaml. The page is served to this machine alone; the address that is printed holds a token without
    which nothing can be changed.
    """

    robot: RobotName = "t1"
    port: Annotated[int, option("PORT", integer("a port", 0, 65535))] = 8090
    """port of the page, the next free one where it is taken; 0: any"""
    no_browser: bool = False
    """serve the page but do not open it"""


@dataclass(frozen=True, kw_only=True)
class ImportRobot:
    """Make a robot folder from a URDF or MJCF.

    Writes a robot folder with the figures of its maker's model file, primitives instead of meshes, sites at soles,
    hands and joints, and a proposed human correspondence and mirror map; lists what a person must still state.
    """

    file: Annotated[Positional[Path], arg(metavar="FILE")]
    """URDF or MJCF of the robot"""
    name: Annotated[str, arg(metavar="NAME")]
    """name of the robot and of its folder"""
    shapes: File = None
    """another model file of the robot, to take its shapes and sites from"""
    joints: Annotated[Path | None, option("CSV", Path)] = None
    """values that replace the file's: the column joint and any others of joints.csv"""
    out: Folder = None
    """where to write; robots/NAME where not given"""


@dataclass(frozen=True, kw_only=True)
class CheckRobot:
    """Find what a robot folder lacks or contradicts.

    Checks masses, limits, mirror map, human correspondence, soles, balance, model files and gains of a robot folder;
    with another model file of the robot, lists the differences joint by joint. Exit code 0: no findings, 3: findings,
    1: could not run. Differences from the other file do not change the exit code.
    """

    folder: Annotated[Positional[Path], arg(metavar="DIR")]
    """folder of the robot (robots/k1)"""
    against: Annotated[Positional[Path | None], option("AGAINST", Path)] = None
    """URDF or MJCF of the same robot"""
