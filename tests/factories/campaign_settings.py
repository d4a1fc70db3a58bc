"""Mutated settings files, robot folders and motor tables, and whether their values contradict the file."""

from __future__ import annotations

import csv
import functools
import io
import re
import shutil
import tomllib
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from pipeline.actuators.motor_table import read_motors
from pipeline.actuators.read_measurement import Measurement, read_measurement
from pipeline.actuators.settings import ActuatorSettings
from pipeline.actuators.standing import read_standing_pose
from pipeline.augment.process import AugmentSettings
from pipeline.catalog import CatalogSettings
from pipeline.errors import PipelineError
from pipeline.expert import DatabaseSettings
from pipeline.failures.settings import FailureSettings
from pipeline.feasibility import CommandSettings, FeasibilitySettings
from pipeline.feedback.rules import FeedbackRules
from pipeline.files import settings
from pipeline.files.csv_json import read_csv_text
from pipeline.hardware_logs import LogSettings
from pipeline.readers import read_sources
from pipeline.repair import RepairSettings
from pipeline.retarget import RetargetSettings
from pipeline.robot import load_robot
from pipeline.robot.robot_error import RobotError
from pipeline.selection import Curation
from pipeline.tracking.settings import TrackingSettings
from pipeline.validation.bars import ValidationSettings
from pipeline.validation.cross_engine_walk import CrossEngineSettings
from pipeline.validation.limit_cycles import LimitCycleSettings
from pipeline.webots.result import WebotsSettings
from tests.factories import mutations
from tests.factories.campaign import CRASHED, REFUSED, RIGHT, WRONG, Case, Verdict, is_sentence

ROOT = Path(__file__).resolve().parents[2]
KINDS: dict[str, type] = {
    "actuators": ActuatorSettings,
    "augment": AugmentSettings,
    "catalog": CatalogSettings,
    "commands": CommandSettings,
    "cross_engine": CrossEngineSettings,
    "curation": Curation,
    "database": DatabaseSettings,
    "failures": FailureSettings,
    "feasibility": FeasibilitySettings,
    "feedback_rules": FeedbackRules,
    "hardware_logs": LogSettings,
    "limit_cycles": LimitCycleSettings,
    "repair": RepairSettings,
    "retarget": RetargetSettings,
    "tracking": TrackingSettings,
    "validation": ValidationSettings,
    "webots": WebotsSettings,
}
ROBOT_FILES = ("joints.csv", "links.csv", "shapes.csv", "sites.csv", "standing.csv", "robot.toml", "t1.xml", "t1.urdf")
SOURCES = b"sources:\n  - name: mine\n    folder: motions\n    licence: CC0-1.0\n    statement: {fps: 30}\n"
DECIMAL = re.compile(r"[-+]?((0|[1-9][0-9]*)(\.[0-9]*)?|\.[0-9]+)([eE][-+]?[0-9]+)?")


@dataclass(frozen=True)
class _Base:
    """A file that is mutated: its content, and the check of a folder that holds the mutated one."""

    file: str
    content: bytes
    check: Callable[[Path, bytes], list[str]]
    """Reads the file in a folder; contradictions with the given content. Raises PipelineError."""


def _clean(name: str) -> bytes:
    """The content of a table or model of the robot or of its motors."""
    folder = "robots/t1" if name in ROBOT_FILES else "data/actuators/t1"
    return (ROOT / folder / name).read_bytes()


@functools.cache
def bases() -> tuple[_Base, ...]:
    """Every settings file of the project, the robot's tables and models, and tables of motors."""
    found = []
    for name, kind in KINDS.items():
        path = ROOT / "data" / f"{name}.yaml"
        found.append(_Base(path.name, path.read_bytes(), functools.partial(_check_settings, path, kind)))
    found.append(_Base("sources.yaml", SOURCES, _check_sources))
    for name in ROBOT_FILES:
        found.append(_Base(name, _clean(name), functools.partial(_check_robot, name)))
    for name in ("motors.csv", "knee.csv"):
        found.append(_Base(name, _clean(name), functools.partial(_check_motor, name)))
    return tuple(found)


def settings_cases(seed: int, count: int, folder: Path) -> Iterator[Case]:
    """`count` mutated files, every file in turn."""
    for index in range(count):
        base = bases()[index % len(bases())]
        rng = np.random.default_rng([seed, 2, index])
        content, what = mutations.mutated_text(base.content, rng)
        if content != base.content:
            yield Case(f"settings {index} {base.file}: {what}", functools.partial(_judge, base, content))


def _judge(base: _Base, content: bytes, folder: Path) -> Verdict:
    try:
        faults = base.check(folder, content)
    except RobotError as error:
        whole = all(is_sentence(line, "t1") for line in str(error).splitlines())
        return Verdict(REFUSED if whole else CRASHED, str(error), len(content))
    except PipelineError as error:
        whole = is_sentence(str(error), base.file)
        return Verdict(
            REFUSED if whole else CRASHED, f"{'' if whole else 'no sentence: '}{str(error)[:800]}", len(content)
        )
    return Verdict(WRONG if faults else RIGHT, "; ".join(faults[:5]), len(content))


def _check_settings(clean: Path, kind: type, folder: Path, content: bytes) -> list[str]:
    path = folder / clean.name
    path.write_bytes(content)
    found = settings.plain(settings.read(path, kind))
    before = settings.plain(settings.read(clean, kind))
    return contradictions(before, found, _as_texts(clean.read_bytes()), _as_texts(content))


def _as_texts(content: bytes) -> Any:
    """YAML whose scalars are all texts, by PyYAML alone."""
    return yaml.BaseLoader(content.decode()).get_single_data()


def _leaves(value: Any, where: str = "") -> dict[str, Any]:
    """The scalars of nested mappings and lists by their dotted names."""
    if isinstance(value, dict):
        pairs = value.items()
    elif isinstance(value, (list, tuple)):
        pairs = enumerate(value)
    else:
        return {where: value}
    return {name: leaf for key, each in pairs for name, leaf in _leaves(each, f"{where}.{key}").items()}


def _by_setting(text: Any) -> dict[str, Any]:
    """The scalars of a file by the names of the settings: a number with unit and source is its value."""
    return {name.replace(".value", ""): leaf for name, leaf in _leaves(text).items()}


def contradictions(before: Any, found: Any, clean: Any, text: Any) -> list[str]:
    """Values that changed where the file's text did not, that did not where it did, and numbers that it has not.

    Args:
        before, found: settings as plain values, of the clean and of the mutated file
        clean, text: the two files with every scalar as a text
    """
    old, new, old_text, new_text = _leaves(before), _leaves(found), _by_setting(clean), _by_setting(text)
    faults = []
    edited = {name for name in {*old_text, *new_text} if old_text.get(name) != new_text.get(name)}
    for name in {*old, *new}:
        touched = any(f"{edit}.".startswith(f"{name}.") or f"{name}.".startswith(f"{edit}.") for edit in edited)
        above = f"{name.rpartition('.')[0]}."  # a default comes and goes with the section that it is in
        touched |= any(each.startswith(above) for each in old_text) != any(each.startswith(above) for each in new_text)
        if old.get(name) != new.get(name) and not touched:
            faults.append(f"{name} changed from {old.get(name)!r} to {new.get(name)!r}, and its text did not")
    for name, word in new_text.items():
        value = new.get(name)
        is_number = isinstance(value, (int, float)) and not isinstance(value, bool)
        if is_number and not (DECIMAL.fullmatch(word) and float(word) == float(value)):
            faults.append(f"{name} is {value!r} where the file has '{word[:40]}'")
    return faults


def _check_sources(folder: Path, content: bytes) -> list[str]:
    (folder / "motions").mkdir()
    path = folder / "sources.yaml"
    path.write_bytes(content)
    found, faults = read_sources(path), []
    entries = _as_texts(content)["sources"]
    for source, entry in zip(found, entries, strict=True):
        fps = source.statement.fps
        stated = (entry.get("statement") or {}).get("fps")
        if source.name != entry["name"] or source.folder.name != Path(entry["folder"]).name:
            faults.append(f"the source {source.name} in {source.folder} is not {entry}")
        if fps is not None and (not DECIMAL.fullmatch(stated) or float(stated) != fps):
            faults.append(f"fps is {fps} where the file has '{stated}'")
    return faults


def _robot_folder(folder: Path) -> Path:
    return Path(shutil.copytree(ROOT / "robots/t1", folder / "t1", ignore=shutil.ignore_patterns("policies")))


def _check_robot(name: str, folder: Path, content: bytes) -> list[str]:
    robot_folder = _robot_folder(folder)
    (robot_folder / name).write_bytes(content)
    robot, clean = load_robot(robot_folder), load_robot("t1")
    faults = []
    standing, usual = read_standing_pose(robot_folder, robot), read_standing_pose(ROOT / "robots/t1", clean)
    if name == "standing.csv":
        return [] if standing is None else _table_faults(content, clean, standing)
    if standing is None or usual is None or not np.array_equal(standing.kp, usual.kp):
        faults.append("the standing pose is another")
    as_before = robot.digest == clean.digest
    if name == "robot.toml" and as_before and tomllib.loads(content.decode()) != tomllib.loads(_clean(name).decode()):
        faults.append("the configuration changed and the robot did not")
    elif name.endswith(".csv") and as_before and _cells(content) != _cells(_clean(name)):
        faults.append("cells of the table changed and the robot did not")
    elif not as_before and content.split() == _clean(name).split():
        faults.append("the robot changed and no cell of the table did")
    return faults + (_strange_numbers(content) if name.endswith(".csv") else [])


def _cells(content: bytes) -> list[list[Any]]:
    """The cells of a table, numbers as such."""
    rows = list(csv.reader(io.StringIO(content.decode("utf-8-sig"), newline="")))
    return [[float(cell) if DECIMAL.fullmatch(cell) else cell for cell in row] for row in rows if row]


def _strange_numbers(content: bytes) -> list[str]:
    """Cells that are no plain decimals in columns of numbers."""
    header, *rows = [row for row in csv.reader(io.StringIO(content.decode("utf-8-sig"), newline="")) if row]
    clean = {name: index for index, name in enumerate(header)}
    texts = {"link", "parent", "joint", "controlled", "shape", "kind", "role", "colour", "site", "source"}
    numbers = [index for name, index in clean.items() if name not in texts]
    return [
        f"'{row[index]}' is taken for a number"
        for row in rows
        for index in numbers
        if not DECIMAL.fullmatch(row[index])
    ]


def _table_faults(content: bytes, robot: Any, standing: Any) -> list[str]:
    rows = [row for row in csv.DictReader(io.StringIO(content.decode("utf-8-sig"), newline="")) if any(row.values())]
    faults = []
    for row in rows:
        index = robot.joint_names.index(row["joint"])
        for column, values in (("kp", standing.kp), ("kd", standing.kd), ("pos", standing.joint_pos)):
            if not DECIMAL.fullmatch(row[column].strip()) or float(row[column]) != values[index]:
                faults.append(f"{column} of {row['joint']} is {values[index]} where the file has '{row[column][:40]}'")
    if sorted(row["joint"] for row in rows) != sorted(robot.joint_names):
        faults.append("the rows are not one a joint")
    return faults


def _check_motor(name: str, folder: Path, content: bytes) -> list[str]:
    values = settings.read(ROOT / "data/actuators.yaml", ActuatorSettings)
    path = folder / name
    path.write_bytes(content)
    if name == "motors.csv":
        motors = read_motors(path, values.model)
        rows = list(csv.reader(line for line in content.decode("utf-8-sig").splitlines() if not line.startswith("#")))[
            1:
        ]
        faults = []
        for motor, row in zip(motors, rows, strict=True):
            words = row[3:6]
            told = [motor.motors_per_joint, motor.gear_ratio, motor.rotor_inertia]
            if not all(DECIMAL.fullmatch(word) for word in words) or [float(word) for word in words] != told:
                faults.append(f"motor {motor.name} has {told} where the file has {words}")
        return faults
    motors = {motor.name: motor for motor in read_motors(ROOT / "data/actuators/t1/motors.csv", values.model)}
    clean = read_measurement(_clean(name).decode(), name, motors["knee"], values.reading)
    found = read_measurement(read_csv_text(path), name, motors["knee"], values.reading)
    before, after = _data_rows(_clean(name)), _data_rows(content)
    if before[:1] != after[:1] or content.count(b"#") != _clean(name).count(b"#"):
        return []  # other columns, or other remarks on the unit
    changed = sum(one != other for one, other in zip(before, after, strict=False)) + abs(len(before) - len(after))
    differ = len(_points(clean) ^ _points(found))
    return [] if differ <= 2 * max(changed, 1) + 2 else [f"{differ} points changed, and {changed} rows"]


def _points(sweep: Measurement) -> set[tuple[float, float, bool]]:
    columns = (sweep.speed.round(9), sweep.torque.round(9), sweep.forward)
    return set(zip(*(column.tolist() for column in columns), strict=True))


def _data_rows(content: bytes) -> list[list[str]]:
    lines = content.decode("utf-8", "replace").replace("\r\n", "\n").replace("\r", "\n").split("\n")
    return [re.split(r"[,;\t ]+", line.strip()) for line in lines if line.strip() and not line.startswith("#")]
