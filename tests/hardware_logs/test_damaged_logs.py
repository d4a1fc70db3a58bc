"""300 damaged logs: nothing wrong is taken for true where a checksum exists, and what has none is marked."""

import json
import subprocess
import sys
from dataclasses import dataclass

import numpy as np
import pytest

from pipeline.files import settings
from pipeline.hardware_logs import LogSettings, Trial, ingest, layouts, read_trial, write_mcap
from pipeline.robot import load_robot
from tests.factories.damaged_logs import Damaged, damaged_logs, write_all
from tests.factories.robot_logs import POLICY, robot_log
from tests.factories.wrong_values import EXACT, wrong_values

SEED, EACH = 8, 30
SECONDS = 1.0


@dataclass(frozen=True)
class Outcome:
    """What became of a damaged log."""

    log: Damaged
    said: dict
    trials: list[Trial]


@pytest.fixture(scope="module")
def ran(root, tmp_path_factory):
    """All logs, ingested in one process; what became of each and what memory the process took."""
    folder = tmp_path_factory.mktemp("damaged")
    logs = damaged_logs(load_robot("t1"), SEED, EACH, SECONDS)
    paths = write_all(folder / "logs", logs)
    command = [sys.executable, str(root / "benchmarks/ingest_worker.py"), str(folder / "logs"), str(folder / "out")]
    done = subprocess.run(command, capture_output=True, text=True, check=False, cwd=root)
    assert done.returncode == 0, done.stderr
    *said, process = map(json.loads, done.stdout.splitlines())
    by_name = {each["file"]: each for each in said}
    found = [by_name[path.name] for path in paths]
    outcomes = [
        Outcome(log=log, said=each, trials=[read_trial(path) for path in map(root.joinpath, each["trials"])])
        for log, each in zip(logs, found, strict=True)
    ]
    return outcomes, process


@pytest.fixture(scope="module")
def clean(root, tmp_path_factory):
    """The trial of the log before it was damaged."""
    folder, robot = tmp_path_factory.mktemp("clean"), load_robot("t1")
    write_mcap(folder / "clean.mcap", robot_log(robot, SECONDS))
    values = settings.read(root / "data/hardware_logs.yaml", LogSettings)
    made = ingest(folder / "clean.mcap", "clean", folder / "out", layouts=layouts([robot]), settings=values)
    assert made.integrity == "complete"
    assert made.notes == ()
    return read_trial(made.trials[0].path)


def of_kind(outcomes, *kinds):
    return [each for each in outcomes if each.log.kind in kinds]


def test_every_log_is_answered_with_trials_or_with_one_sentence(ran):
    outcomes, _ = ran
    assert len(outcomes) == 300
    for each in outcomes:
        assert bool(each.trials) != bool(each.said["refused"])
        assert "\n" not in each.said["refused"]
        assert all("\n" not in note for note in each.said.get("notes", ()))


@pytest.mark.parametrize("kind", [*EXACT, "clock"])
def test_no_value_is_wrong_where_there_are_checksums(ran, clean, kind):
    outcomes, _ = ran
    chosen = of_kind(outcomes, kind)
    assert len(chosen) == EACH
    wrong = {
        each.said["file"]: names
        for each in chosen
        for trial in each.trials
        if (names := wrong_values(trial, clean, each.log))
    }
    assert wrong == {}
    for trial in (trial for each in chosen for trial in each.trials):
        assert trial.policy_digest in (POLICY, None)
        assert trial.robot == "t1"
        assert trial.integrity != "unverified"


@pytest.mark.parametrize("kind", EXACT)
def test_damage_is_told(ran, kind):
    outcomes, _ = ran
    for each in of_kind(outcomes, kind):
        for trial in each.trials:
            assert trial.integrity == "recovered" or trial.measured.all()
            if trial.integrity == "recovered":
                assert "lost" in trial.notes[0]


def test_a_log_of_which_all_messages_are_there_loses_none(ran, clean):
    """The last bytes are the summary's: all messages are intact."""
    outcomes, _ = ran
    for each in of_kind(outcomes, "truncated")[:5]:
        (trial,) = each.trials
        assert trial.integrity == "recovered"
        assert len(trial.time_s) == len(clean.time_s)
        assert trial.gaps == ()


def test_most_of_a_flipped_log_is_recovered(ran, clean):
    outcomes, _ = ran
    chosen = of_kind(outcomes, "flipped")
    kept = [sum(trial.measured.sum() for trial in each.trials) / len(clean.time_s) for each in chosen]
    assert np.median(kept) > 0.6


def test_what_has_no_checksums_is_marked(ran):
    outcomes, _ = ran
    chosen = of_kind(outcomes, "unchecked", "bag")
    assert sum(bool(each.trials) for each in chosen) > len(chosen) / 2
    for trial in (trial for each in chosen for trial in each.trials):
        assert trial.integrity == "unverified"
        assert "no checksums" in trial.notes[0]


def test_wrong_schemas_are_refused(ran):
    outcomes, _ = ran
    for each in of_kind(outcomes, "schema"):
        assert each.trials == []
        assert "/low_state" in each.said["refused"]


def test_a_clock_that_jumps_ends_a_trial_and_takes_the_schedule_with_it(ran):
    outcomes, _ = ran
    jumped = [each for each in of_kind(outcomes, "clock") if each.log.clock]
    assert len(jumped) == EACH / 3
    for each in jumped:
        one, other = each.trials
        assert np.isfinite(one.command).all()
        assert np.isnan(other.command).all()


def test_what_no_robot_says_is_refused_or_left_out(ran):
    outcomes, _ = ran
    for index, each in enumerate(of_kind(outcomes, "implausible")):
        if index % 5 == 0:
            assert "not finite" in each.trials[0].notes[0]
        else:
            assert (
                "joints" in each.said["refused"]
                or "it of another" in each.said["refused"]
                or ("a second" in each.said["refused"])
            )


def test_memory_stays_below_a_gigabyte(ran):
    _, process = ran
    assert process["peak_mb"] < 1_000
