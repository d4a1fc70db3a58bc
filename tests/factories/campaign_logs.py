"""Damaged logs and logs of faulty sensors, and whether a trial that was read from one states a wrong value."""

from __future__ import annotations

import dataclasses
import functools
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pyarrow

from pipeline.files import settings
from pipeline.hardware_logs import LogError, LogSettings, RobotLog, Trial, ingest, layouts, mcap_bytes, read_trial
from pipeline.robot import load_robot
from tests.factories.campaign import CRASHED, REFUSED, RIGHT, WRONG, Case, Verdict, is_sentence
from tests.factories.damaged_logs import Damaged, damaged_logs
from tests.factories.robot_logs import robot_log
from tests.factories.wrong_values import EXACT, wrong_values

ROOT = Path(__file__).resolve().parents[2]
DAMAGE_KINDS, DAMAGED_SHARE, SECONDS = 10, 0.8, 1.0
SENSOR_SECONDS = 5.0
WORDS = {"frozen": "change", "degrees": "in degrees", "g": "in g", "sign": "wrong sign"}
"""Kind of a fault of a sensor -> words of the note or refusal that names it."""


@functools.cache
def _settings() -> LogSettings:
    return settings.read(ROOT / "data/hardware_logs.yaml", LogSettings)


def log_cases(seed: int, count: int, folder: Path) -> Iterator[Case]:
    """`count` logs: four fifths damaged files of ten kinds, the others sound files of faulty sensors."""
    pyarrow.set_cpu_count(1)
    robot = load_robot("t1")
    each = max(round(DAMAGED_SHARE * count / DAMAGE_KINDS), 1)
    (folder / "logs").mkdir()
    (folder / "logs/clean.mcap").write_bytes(mcap_bytes(robot_log(robot, SECONDS)))
    (clean,) = _trials(folder / "logs/clean.mcap", folder / "trials")[0]
    for number, log in enumerate(damaged_logs(robot, seed, each, SECONDS)):
        yield Case(f"log {number} {log.kind}", functools.partial(_judge_damaged, log, clean))
    for number in range(DAMAGE_KINDS * each, count):
        rng = np.random.default_rng([seed, 3, number])
        kind, log = _faulty_sensors(robot_log(robot, SENSOR_SECONDS), rng)
        yield Case(f"log {number} {kind}", functools.partial(_judge_sensors, kind, mcap_bytes(log)))


def _trials(path: Path, out: Path) -> tuple[list[Trial], tuple[str, ...]]:
    """Trials and notes of a log. Raises LogError."""
    made = ingest(path, "log", out, layouts=layouts([load_robot("t1")]), settings=_settings())
    return [read_trial(trial.path) for trial in made.trials], made.notes


def _judge_damaged(log: Damaged, clean: Trial, folder: Path) -> Verdict:
    path, size = folder / f"damaged{log.suffix}", len(log.data)
    path.write_bytes(log.data)
    try:
        trials, notes = _trials(path, folder / "trials")
    except LogError as error:
        whole = is_sentence(str(error), path.name)
        return Verdict(REFUSED if whole else CRASHED, str(error), size)
    faults = [] if trials else ["neither trials nor a refusal"]
    if log.kind in (*EXACT, "clock"):
        faults += [f"wrong {name}" for trial in trials for name in wrong_values(trial, clean, log)]
    if log.kind == "schema" or (log.kind == "implausible" and not notes):
        faults.append("was read without a note")
    if not log.checked and any(trial.integrity != "unverified" for trial in trials):
        faults.append("is not marked as a file without checksums")
    return Verdict(WRONG if faults else RIGHT, "; ".join(faults), size)


def _faulty_sensors(log: RobotLog, rng: np.random.Generator) -> tuple[str, RobotLog]:
    """A log of one sensor that is frozen for more than 2 s, of attitude in degrees, acceleration in g or negated."""
    states = log.low_state
    time_s = (states.time_ns - states.time_ns[0]) * 1e-9
    noise = rng.normal(0.0, 1e-3, states.gyro_b.shape)
    arrays = {
        "gyro_b": np.gradient(states.rpy, time_s, axis=0) + noise,
        "acc_b": states.acc_b + noise,
        "rpy": states.rpy.copy(),
        "joint_pos": states.joint_pos.copy(),
        "joint_vel": states.joint_vel + 0.5,  # never at rest, so that gravity at rest refuses no log
    }
    kind = str(rng.choice(["frozen IMU", "frozen joints", "frozen joint", "degrees", "g", "sign"]))
    if kind.startswith("frozen"):
        start_s, length_s = float(rng.uniform(0.0, 1.5)), float(rng.uniform(2.2, 3.0))
        inside = np.flatnonzero((time_s >= start_s) & (time_s < start_s + length_s))
        names = ("rpy", "gyro_b", "acc_b") if kind == "frozen IMU" else ("joint_pos", "joint_vel")
        width = arrays[names[0]].shape[1]
        columns = [int(rng.integers(width))] if kind == "frozen joint" else list(range(width))
        for name in names:
            arrays[name][np.ix_(inside, columns)] = arrays[name][inside[0], columns]
    elif kind == "degrees":
        arrays["rpy"] = np.degrees(arrays["rpy"])
    else:
        arrays["acc_b"] = arrays["acc_b"] / 9.81 if kind == "g" else -arrays["acc_b"]
    return kind, dataclasses.replace(log, low_state=dataclasses.replace(states, **arrays))


def _judge_sensors(kind: str, data: bytes, folder: Path) -> Verdict:
    path = folder / "sensors.mcap"
    path.write_bytes(data)
    try:
        _, notes = _trials(path, folder / "trials")
    except LogError as error:
        whole = is_sentence(str(error), path.name)
        return Verdict(REFUSED if whole else CRASHED, str(error), len(data))
    named = any(WORDS[kind.split()[0]] in note for note in notes)
    return Verdict(RIGHT if named else WRONG, "" if named else f"no note names the fault: {notes}", len(data))
