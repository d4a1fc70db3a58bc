"""Errors cross processes: every class survives pickling with its text and its facts."""

import pickle
from pathlib import Path
from typing import Any

import pytest

from pipeline.batch import ClipPool
from pipeline.deployment.controller import PolicyMisfitError
from pipeline.errors import AmbiguousFileError, ClipError, FileError, PipelineError, SettingsError, UnknownNameError
from pipeline.expert import DatabaseError
from pipeline.files.ranges import RangeError
from pipeline.hardware_logs import LogError
from pipeline.readers.remembered import RememberedSource, SourceLostError
from pipeline.robot.robot_error import RobotError

LOST = RememberedSource(name="takes", folder="/mocap", named_in="BOOSTER_LAB_MOTIONS", files=3)
ERRORS = [
    PipelineError("one sentence."),
    FileError("/x", "it is broken.", "Mend it.", 3),
    AmbiguousFileError("/x", "it can be read in two ways.", "State `unit:`."),
    SettingsError(Path("/x"), "it is broken.", line=3),
    ClipError("walk", "code", "it is broken.", 412),
    UnknownNameError("robot", "x", ["t1", "k1"]),
    RangeError([("low", "is 3, allowed is at most 2")]),
    DatabaseError(Path("/db"), ["a.json: is missing"]),
    LogError("/x.mcap", "it is broken", "Copy it again.", offset=12, recovered=34),
    RobotError([FileError(Path("/robot.toml"), "it is broken.", "Mend it.", 2)]),
    SourceLostError(Path("/sources.json"), [(LOST, "is not a folder any more")]),
]
"""One of each signature."""


def classes() -> list[type[PipelineError]]:
    """Every class below PipelineError that is imported here, with whatever arguments."""
    found, todo = [], [PipelineError]
    while todo:
        found.append(todo.pop())
        todo += found[-1].__subclasses__()
    return found


def facts(error: PipelineError) -> dict[str, Any]:
    """The facts of an error. No two errors are equal, so the faults of a RobotError are compared by theirs."""
    if isinstance(error, RobotError):
        return {**vars(error), "faults": [(type(each), str(each), vars(each)) for each in error.faults]}
    return vars(error)


def raise_again(error: PipelineError) -> None:
    raise error


@pytest.mark.parametrize("error", ERRORS, ids=lambda error: type(error).__name__)
def test_an_error_survives_pickling_with_text_and_facts(error):
    back = pickle.loads(pickle.dumps(error))  # noqa: S301, made in this test
    assert type(back) is type(error)
    assert str(back) == str(error)
    assert facts(back) == facts(error)


def test_every_class_survives_whatever_its_arguments_are():
    assert PolicyMisfitError in classes()
    for kind in classes():
        error = kind.__new__(kind, "one sentence.")
        vars(error)["fact"] = 3
        back = pickle.loads(pickle.dumps(error))  # noqa: S301, made in this test
        assert (type(back), str(back), vars(back)) == (kind, "one sentence.", {"fact": 3})


@pytest.mark.parametrize("error", [ERRORS[1], ERRORS[4], ERRORS[5]], ids=lambda error: type(error).__name__)
def test_the_error_of_a_worker_process_reaches_the_caller(error):
    with pytest.raises(type(error)) as raised:
        list(ClipPool(workers=2).map(raise_again, [(error,), (error,)]))
    assert str(raised.value) == str(error)


def test_a_message_does_not_grow_with_what_it_quotes():
    text = str(FileError("a.csv", f"the name '{'y' * 150_000}' is unknown.", "Name another."))
    assert len(text) < 10_000
    assert text.startswith("a.csv: the name 'yyy") and text.endswith("' is unknown. Name another.")
