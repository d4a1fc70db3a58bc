"""A criterion is one registration: a toy criterion appears everywhere, and a wrong one is refused."""

import logging
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Annotated

import numpy as np
import pytest

from pipeline.batch import ClipPool, Entry, Manifest, Stage, Store, run_stage
from pipeline.errors import FileError, SettingsError
from pipeline.feasibility import FeasibilitySettings, assess, criteria_table, process
from pipeline.feasibility.criterion import MEASURES, MOTION, NOTHING, REGISTERED, Criterion, Verdict, criterion, results
from pipeline.feasibility.docs_table import docs_table, rewrite
from pipeline.feasibility.motion import Motion, motion_of
from pipeline.feasibility.settings import fault_of
from pipeline.files import settings
from pipeline.files.ranges import Range
from pipeline.files.sourced import Unit, origins
from tests.factories.robot_clips import standing, wandering

CODE = "toy_way"
TOY = Criterion(CODE, "toys", "toy.way", "m", "distance from the first root position to the last", cuts=NOTHING)


@dataclass(frozen=True, kw_only=True)
class ToySettings:
    way: Annotated[float, Range(0.0, 1.0), Unit("m")]


@dataclass(frozen=True, kw_only=True)
class WithToy(FeasibilitySettings):
    toy: ToySettings


def toy_way(motion: Motion, section: ToySettings) -> tuple[Verdict, ...]:
    way = float(np.linalg.norm(motion.clip.root_pos_w[-1] - motion.clip.root_pos_w[0]))
    return (Verdict(code=CODE, value=way, limit=section.way, text=f"the root ends {way:.2f} m from its start"),)


@pytest.fixture
def toy() -> Iterator[None]:
    criterion(TOY)(toy_way)
    yield
    del REGISTERED[CODE], MEASURES[toy_way]


@pytest.fixture
def file(root: Path, tmp_path: Path) -> Path:
    path = tmp_path / "feasibility.yaml"
    rule = 'toy:\n  way: {value: 0.1, unit: m, source: judge, why: "Toys stay where they are."}\n'
    path.write_text((root / "data" / "feasibility.yaml").read_text() + rule)
    return path


def test_a_toy_criterion_decides_and_appears_in_every_table(toy, file: Path, robot, tmp_path: Path):
    limits = settings.read(file, WithToy)
    clips = {"still": standing(robot), "moving": wandering(robot)}
    store = Store(root=tmp_path / "store")
    entries = tuple(Entry(clip=name, blob=store.put_clip(clip), numbers={}) for name, clip in clips.items())
    stage = Stage(name="toys", version="1", function=partial(process, settings=limits, robot=robot))
    previous = Manifest(stage="before", entries=entries, judged=())
    made = run_stage(stage, previous, store, ClipPool(backend="sequential"), logging.getLogger("test"))
    moving, still = made.judged
    assert still.numbers[CODE] == 0.0
    assert moving.numbers[CODE] > 0.1
    (reason,) = [reason for reason in moving.reasons if reason["code"] == CODE]
    assert reason["text"].endswith("m from its start; at most 0.1 m is allowed.")
    assert [entry.clip for entry in made.entries] == ["still"]
    assert made.entries[0].numbers[CODE] == 0.0
    table = criteria_table.split(made, origins(settings.read_yaml(file)))[1]
    row = table[(table["clip"] == "moving") & (table["criterion"] == CODE)].iloc[0]
    assert (row["group"], row["verdict"], row["threshold"], row["unit"]) == ("toys", "broken", 0.1, "m")
    assert (row["setting"], row["source"], row["why"]) == ("toy.way", "judge", "Toys stay where they are.")
    summary = criteria_table.by_criterion(table).set_index("criterion").loc[CODE]
    assert (summary["clips"], summary["broken"], summary["closest clip"]) == (2, 1, "still")
    assert CODE in set(criteria_table.worst_margins(table)["criterion"])
    assert f"| toys | `{CODE}` | {TOY.what} [m] | `toy.way` | – |" in docs_table()


def test_its_threshold_is_checked_as_the_others_are(toy, file: Path):
    file.write_text(file.read_text().replace("way: {value: 0.1", "way: {value: 7"))
    with pytest.raises(SettingsError, match=r"'toy\.way' is 7, allowed is 0 to 1"):
        settings.read(file, WithToy)


def test_every_registered_criterion_has_a_threshold_of_its_unit():
    assert [fault_of(each) for each in REGISTERED.values()] == [""] * len(REGISTERED)
    assert "'toy.way' is in no field" in fault_of(TOY)
    assert fault_of(TOY, WithToy) == ""
    wrong = Criterion(CODE, "toys", "toy.way", "deg", "")
    assert fault_of(wrong, WithToy) == "'toy_way': 'toy.way' is in ['m'], the criterion in 'deg'"


def test_a_code_is_registered_once():
    with pytest.raises(ValueError, match="'root_jerk' is registered twice"):
        criterion(REGISTERED["root_jerk"])(toy_way)
    assert toy_way not in MEASURES


def test_a_function_that_forgets_one_of_its_criteria_is_refused(toy, file: Path, robot, monkeypatch):
    monkeypatch.setitem(MEASURES, toy_way, (TOY, TOY))
    limits = settings.read(file, WithToy)
    with pytest.raises(AssertionError, match="toy_way"):
        list(results(motion_of(standing(robot), robot, limits), limits, MOTION))


def test_each_criterion_of_a_motion_is_measured_or_skipped(root: Path, robot):
    limits = settings.read(root / "data" / "feasibility.yaml", FeasibilitySettings)
    found = assess(motion_of(standing(robot), robot, limits), limits)
    codes = [each.code for each in (*found.verdicts, *found.skipped)]
    assert sorted(codes) == sorted(code for code, each in REGISTERED.items() if each.of == MOTION)


def test_the_table_in_the_docs_is_that_of_the_code(root: Path, tmp_path: Path):
    page = tmp_path / "feasibility.md"
    page.write_text((root / "docs" / "feasibility.md").read_text())
    rewrite(page)
    assert page.read_text() == (root / "docs" / "feasibility.md").read_text(), (
        "Run: python -m pipeline.feasibility.docs_table docs/feasibility.md"
    )
    page.write_text("no place for a table")
    with pytest.raises(FileError, match="the comments"):
        rewrite(page)


@pytest.mark.parametrize(("page", "message"), [("README.md", "the comments"), ("none.md", "No such file")])
def test_the_command_says_in_a_sentence_which_page_has_no_table(root: Path, page: str, message: str):
    command = [sys.executable, "-m", "pipeline.feasibility.docs_table", page]
    done = subprocess.run(command, cwd=root, capture_output=True, text=True)
    assert done.returncode == 1 and message in done.stderr and done.stderr.count("\n") == 1


def test_the_command_that_writes_the_table_prints_its_usage(root: Path):
    command = [sys.executable, "-m", "pipeline.feasibility.docs_table", "--help"]
    done = subprocess.run(command, cwd=root, capture_output=True, text=True, check=True)
    assert done.stdout.startswith("usage: python -m pipeline.feasibility.docs_table")
