"""Arguments of the commands on motions, databases and robots, as dataclasses that tyro reads: a field is an option, its
docstring the help. Those on policies are in `policy_arguments.py`.

Nothing heavy is imported here: `booster-lab --help`, a typo and shell completion need only these two modules.
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
"""Equal to the constant in `pipeline.batch.store`, whose import would be slow."""


@dataclass(frozen=True, kw_only=True)
class FileStatement:
    """Facts that the file does not contain. Needed only when a command asks for them. See docs/sources.md."""

    unit: Text = None
    """unit of length: m, cm, mm, inch, cmu, or metres per unit"""
    up: Annotated[str | None, option("AXIS", str)] = None
    """axis that points up: x, y, z, -x, -y, -z (write --up=-y)"""
    fps: Annotated[float | None, option("HZ", rate), arg(name="source-fps")] = None
    """true frame rate, replaces the rate that the file declares"""
    skeleton: Annotated[str | None, option("MAP", str)] = None
    """name of a skeleton map, or the path of your own (.yaml)"""
    asf: Annotated[str | None, option("FILE", str)] = None
    """ASF file of an AMC, relative to the AMC's folder"""
    body_model: Annotated[str | None, option("NPZ", str)] = None
    """your own SMPL body model"""
    quaternion: Annotated[Literal["wxyz", "xyzw"] | None, option("{wxyz,xyzw}", str, ("wxyz", "xyzw"))] = None
    """order of a robot's root quaternion"""


Statement = OmitArgPrefixes[FileStatement]


@dataclass(frozen=True, kw_only=True)
class Inspect:
    """Show the format and defects of a motion file.

    Prints format, skeleton, unit, axes and rate of a motion file, its speeds, its windows of one skill, and everything
    that is repaired, cut or rejected, with the reason. For a folder it prints one line per file. For a clip of the
    graph (its name, or its file in the database) it prints every feasibility criterion: value, threshold, unit, source
    and verdict.
    """

    input: Annotated[Positional[Path], arg(metavar="IN")]
    """motion file, folder of motion files, or clip of the graph"""
    robot: RobotName = "t1"
    json: bool = False
    """print a JSON object (for a folder: a list of objects)"""
    write_map: bool = False
    """print the file's skeleton map (YAML) instead, or a draft of one"""
    statement: Statement = FileStatement()


@dataclass(frozen=True, kw_only=True)
class Retarget:
    """Retarget a motion onto the robot, as CSV.

    Reads a motion file, repairs it, retargets it onto the robot and writes the robot's motion as CSV: root position
    [m], root quaternion xyzw, joints [rad] by name. If repair cuts the motion, the longest piece is written to OUT.csv
    and the others, in order of time, to OUT.1.csv, OUT.2.csv, …
    """

    input: Annotated[Positional[Path], arg(metavar="IN")]
    """motion file (.amc, .bvh, .c3d, .csv, .glb, .gltf, .mcap, .npz, .pkl, .pt, .txt)"""
    out: Annotated[Path, arg(metavar="OUT.csv")]
    """CSV file to write"""
    robot: RobotName = "t1"
    fps: Hertz = 30.0
    """rate of OUT.csv"""
    naming: Naming = None
    statement: Statement = FileStatement()


@dataclass(frozen=True, kw_only=True)
class Score:
    """Score how well a robot motion reproduces a human motion.

    Compares a robot motion (CSV, from any retargeting tool) with its human motion: feet, ground, limits, smoothness,
    self-collision, likeness. The human file is read and repaired as for `retarget`. The CSV must start at the human's
    first frame, and be in the world frame of the repaired human motion.
    """

    csv: Annotated[Positional[Path], arg(metavar="CSV")]
    """the robot's motion"""
    human: Annotated[Path, arg(metavar="CLIP")]
    """the human's motion file"""
    fps: Annotated[float | None, option("HZ", rate)] = None
    """rate of CSV, if the file does not state it"""
    json: bool = False
    """print a JSON object"""
    statement: Statement = FileStatement()


@dataclass(frozen=True, kw_only=True)
class Export:
    """Write the database's clips in the formats of other programs, with a dataset card.

    Writes every clip of a database as an archive for mjlab and BeyondMimic (`mjlab`) or for GMR without pickle (`gmr`),
    as a Rerun recording (`rerun`, needs the extra booster-lab[export]), or all of them as one LeRobotDataset v3
    (`lerobot`). Adds a dataset card (README.md) with sources, licences, seconds by skill and stages.
    """

    database: Annotated[Positional[Path], arg(metavar="DATABASE")]
    """folder of a database (data/expert_db/t1)"""
    format: Literal["mjlab", "gmr", "lerobot", "rerun"]
    """format to write"""
    out: Annotated[Path, arg(metavar="FOLDER")]
    """folder to write into"""
    skill: Annotated[tuple[str, ...], arg(metavar="NAME")] = ()
    """only clips of these skills"""
    naming: Naming = None


@dataclass(frozen=True, kw_only=True)
class Database:
    """Summarize the expert database, list its versions, or restore a version.

    Earlier versions of the expert database are kept, and so is a version that was refused because it had lost too many
    clips. `restore VERSION` makes a version the current database, and keeps the previous one as a version.
    """

    action: Positional[Literal["summary", "list", "restore"]]
    """summarize the current database and suggest next steps; list it and the kept versions; or restore a version"""
    version: Annotated[Positional[str | None], option("VERSION", str)] = None
    """version to restore, as `list` shows it"""
    robot: RobotName = "t1"


@dataclass(frozen=True, kw_only=True)
class Sources:
    """List the motion folders in use, or forget one.

    Runs record the motion folders that they used. A folder of BOOSTER_LAB_MOTIONS remains a source until it is
    forgotten. If the folder of a source is missing, a run stops before clips are removed from the database.
    """

    action: Positional[Literal["list", "forget"]]
    """list the sources that runs have used; or forget some, so that the next database does not contain them"""
    names: Annotated[Positional[tuple[str, ...]], arg(metavar="NAME")] = ()
    """sources to forget, as `list` shows them"""


@dataclass(frozen=True, kw_only=True)
class Store:
    """Show the size of the store, or delete results that no run needs any more.

    The store keeps the clips and results of earlier settings, so that returning to them recomputes nothing. `gc` lists
    those that the last runs did not use, and deletes them with --delete. Clips of current results are always kept, and
    a deleted result is computed again when it is needed.
    """

    action: Positional[Literal["size", "gc"]]
    """show the size of the store; or list, and with --delete remove, results that no run needs"""
    keep: Annotated[int, option("N", integer("a number of runs", 1, MOST_ASKINGS))] = 5
    """number of last runs of each stage whose results are kept"""
    delete: bool = False
    """delete the listed results; without it nothing is changed"""


@dataclass(frozen=True, kw_only=True)
class View:
    """Play a clip: human and robot side by side.

    Plays a clip in the browser. CLIP is a motion file (repaired and retargeted first), a clip of the database
    (data/expert_db/t1/….json), or the name of a clip of the graph, such as booster_lab/walk or
    booster_lab/walk@0-840~mirror. For a whole recording, you choose one of its clips in the browser. A rollout
    (…~rollout) plays beside the reference that it tracks, a robot log (.mcap) beside the simulation of the same
    command, with its failures. --record writes a film instead, without a display.
    """

    clip: Annotated[Positional[str], arg(metavar="CLIP")]
    """motion file, robot log, clip of the database, or name of a clip"""
    robot: RobotName = "t1"
    port: Annotated[int, option("PORT", integer("a port", 1, 65535))] = 8080
    """port of the page; if it is in use, the next free port"""
    host: Annotated[str, arg(metavar="ADDRESS")] = "127.0.0.1"
    """address to serve on; the default is this machine only"""
    no_browser: bool = False
    """serve the page but do not open it"""
    picture: Annotated[Path | None, option("OUT.png", Path)] = None
    """write a picture of poses along the clip"""
    poses: Annotated[int, option("N", integer("a number of poses", 1, 40))] = 8
    """number of poses in the picture"""
    record: Annotated[Path | None, option("OUT", Path)] = None
    """write an .mp4 or .gif"""
    start: float = 0.0
    """start of the film in the clip [s]"""
    seconds: Number = None
    """length of the film [s]; default: to the end of the clip"""
    statement: Statement = FileStatement()


@dataclass(frozen=True, kw_only=True)
class Curate:
    """Find, watch, accept and exclude clips in the browser.

    Serves a gallery of all clips of the graph, with figures, thresholds and playback. Decisions are written to
    data/curation.yaml. The page is served to this machine only. The printed address contains a token, which is
    required for every change.
    """

    robot: RobotName = "t1"
    port: Annotated[int, option("PORT", integer("a port", 0, 65535))] = 8090
    """port of the page; if it is in use, the next free port; 0: any free port"""
    no_browser: bool = False
    """serve the page but do not open it"""


@dataclass(frozen=True, kw_only=True)
class ImportRobot:
    """Make a robot folder from a URDF or MJCF.

    Writes a robot folder with the numbers of the manufacturer's model file, primitives instead of meshes, sites at
    soles, hands and joints, and a proposed human correspondence and mirror map. Lists the values that you must add.
    """

    file: Annotated[Positional[Path], arg(metavar="FILE")]
    """URDF or MJCF of the robot"""
    name: Annotated[str, arg(metavar="NAME")]
    """name of the robot and of its folder"""
    shapes: File = None
    """another model file of the robot, the source of shapes and sites"""
    joints: Annotated[Path | None, option("CSV", Path)] = None
    """values that replace those of FILE: column joint, and any other columns of joints.csv"""
    out: Folder = None
    """folder to write; default: robots/NAME"""


@dataclass(frozen=True, kw_only=True)
class CheckRobot:
    """Check a robot folder for missing and contradictory values.

    Checks masses, limits, mirror map, human correspondence, soles, balance, model files and gains of a robot folder.
    With AGAINST, it also lists the differences of that file joint by joint. Exit code 0: no findings, 3: findings, 1:
    could not run. Differences from AGAINST do not change the exit code.
    """

    folder: Annotated[Positional[Path], arg(metavar="DIR")]
    """folder of the robot (robots/k1)"""
    against: Annotated[Positional[Path | None], option("AGAINST", Path)] = None
    """URDF or MJCF of the same robot"""
