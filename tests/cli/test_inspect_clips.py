"""`booster-lab inspect` on clips that were made: every criterion, for a person and as JSON."""

import dataclasses
import json
import logging
from functools import partial
from pathlib import Path

import numpy as np
import pytest

from pipeline.batch import ClipPool, Entry, Judged, Manifest, Stage, Store, run_stage
from pipeline.cli.main import main
from pipeline.feasibility import FeasibilitySettings, criteria_table, process
from pipeline.feasibility.criterion import codes
from pipeline.files import settings
from pipeline.files.sourced import origins
from pipeline.robot import Robot
from pipeline.selection import Decision, without_excluded
from tests.factories.robot_clips import standing


@pytest.fixture
def project(tmp_path: Path, root: Path, robot: Robot, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A checkout whose KP5 judged a clip that stands, its mirror image, and one sunk into the ground."""
    (tmp_path / "robots").symlink_to(root / "robots")
    store = Store(root=tmp_path / "data" / "store")
    clip = standing(robot)
    sunk = dataclasses.replace(clip, root_pos_w=clip.root_pos_w - np.array([0.0, 0.0, 0.05]))
    clips = {"mine/stand@0-99": clip, "mine/stand@0-99~mirror": clip, "mine/sunk@0-99": sunk}
    entries = tuple(Entry(clip=name, blob=store.put_clip(each), numbers={}) for name, each in clips.items())
    limits = settings.read(root / "data" / "feasibility.yaml", FeasibilitySettings)
    stage = Stage(name="feasible_motions", version="1", function=partial(process, settings=limits, robot=robot))
    previous = Manifest(stage="motion_variants", entries=entries, judged=())
    made = run_stage(stage, previous, store, ClipPool(backend="sequential"), logging.getLogger("test"))
    manifest, table = criteria_table.split(made, origins(settings.read_yaml(root / "data" / "feasibility.yaml")))
    store.save("feasible_motions", manifest)
    criteria_table.write(criteria_table.path_beside(store.manifest_path("feasible_motions")), table, manifest)
    for stage, clip, code in (
        ("motion_catalog", "mine/torn", "unreadable"),
        ("repaired_motions", "mine/skate@0-99", "foot_skate"),
    ):
        why = {"code": code, "text": f"the {code} rule.", "effect": "rejected", "start_s": 0.5, "stop_s": 1.25}
        fate = Judged(clip=clip, pieces=(), reasons=(why,), numbers={})
        store.save(stage, Manifest(stage=stage, entries=(), judged=(fate,)))
    monkeypatch.chdir(tmp_path)
    return tmp_path


def test_a_clip_prints_every_criterion(project: Path, capsys):
    assert main(["inspect", "mine/sunk@0-99"]) == 0
    printed = capsys.readouterr().out
    lines = printed.splitlines()
    assert lines[0] == "mine/sunk@0-99, 0.00 to 2.00 s: not kept as a whole"
    assert all(any(code in line for line in lines) for code in codes())
    deepest = next(line for line in lines if " penetration_max " in line)
    assert "0.0504" in deepest or "0.05" in deepest
    assert "at most 0.03" in deepest and " broken " in deepest and "judge: " in deepest
    assert "not applicable: no tracked rollout" in next(line for line in lines if "tracking_growth" in line)
    assert any("penetration_max: frame" in line for line in lines[lines.index("  broken") :])


def test_the_same_as_json(project: Path, capsys):
    assert main(["inspect", "--json", "mine/stand@0-99"]) == 0
    rows = json.loads(capsys.readouterr().out)
    assert [row["criterion"] for row in rows] == codes()
    assert all(list(row) == list(criteria_table.COLUMNS) for row in rows)
    assert {row["verdict"] for row in rows} == {"holds", "not applicable"}
    assert {row["piece"] for row in rows} == {"mine/stand@0-99"}


def test_a_recording_prints_a_line_a_clip_made_of_it(project: Path, capsys):
    assert main(["inspect", "mine"]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert [line.split()[0] for line in lines] == [
        "clip",
        "mine/stand@0-99",
        "mine/stand@0-99~mirror",
        "mine/sunk@0-99",
    ]
    assert lines[1].split()[1:] == ["2.00", "2.00", "nothing"]
    assert lines[3].split()[1:3] == ["2.00", "0.00"]
    assert "penetration_max" in lines[3]


def test_a_clip_that_a_person_excluded_is_not_kept(project: Path, capsys):
    store = Store(root=project / "data" / "store")
    decision = Decision(clip="mine/stand@0-99", verdict="exclude", by="Ada", why="its feet slide", day="2026-11-26")
    kept = without_excluded(store.load("feasible_motions"), [decision])
    table = criteria_table.read(criteria(store), store.manifest_path("feasible_motions"), "feasible_motions")
    store.save("feasible_motions", kept)
    criteria_table.write(criteria(store), table, kept)
    said = "excluded by Ada on 2026-11-26: its feet slide"
    assert main(["inspect", "mine/stand@0-99"]) == 0
    assert capsys.readouterr().out.startswith(f"mine/stand@0-99, 0.00 to 2.00 s: not kept: {said}\n")
    assert main(["inspect", "mine"]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert lines[1].split()[1] == "2.00" and lines[1].endswith(f" 0.00  {said}")
    assert lines[2].split()[1:] == ["2.00", "2.00", "nothing"]
    assert main(["inspect", "--json", "mine/stand@0-99"]) == 0
    assert {row["piece"] for row in json.loads(capsys.readouterr().out)} == {""}


def criteria(store: Store) -> Path:
    """The table of criteria of KP5."""
    return criteria_table.path_beside(store.manifest_path("feasible_motions"))


@pytest.mark.parametrize(
    ("name", "clip", "stage", "code"),
    [
        ("mine/torn", "mine/torn", "motion_catalog", "unreadable"),
        ("mine/skate", "mine/skate@0-99", "repaired_motions", "foot_skate"),
    ],
)
def test_a_clip_that_an_earlier_stage_rejected_prints_stage_and_reasons(project: Path, capsys, name, clip, stage, code):
    assert main(["inspect", name]) == 0
    head, _, reason = capsys.readouterr().out.splitlines()
    assert head == f"{clip}: rejected by {stage}"
    assert reason.split() == ["rejected", "0.50", "1.25", code, "the", code, "rule."]
    assert main(["inspect", "--json", name]) == 0
    (found,) = json.loads(capsys.readouterr().out)
    assert (found["clip"], found["stage"], found["reasons"][0]["code"]) == (clip, stage, code)


def test_a_file_of_the_database_is_the_clip_in_it(project: Path, capsys):
    (project / "clip.json").write_text(json.dumps({"Clip": "mine/stand@0-99~mirror"}))
    assert main(["inspect", "clip.json"]) == 0
    assert capsys.readouterr().out.startswith("mine/stand@0-99~mirror, 0.00 to 2.00 s: kept as")


@pytest.mark.parametrize(
    ("name", "said"),
    [
        ("mine/sink@0-99", "neither a file nor an evaluated clip; similar names: mine/sunk@0-99"),
        ("other.json", "other.json: not JSON ("),
        ("gone.bvh", "gone.bvh: the file does not exist"),
    ],
)
def test_what_is_no_clip_is_told_in_a_sentence(project: Path, capsys, name: str, said: str):
    (project / "other.json").write_text("{")
    assert main(["inspect", name]) == 1
    assert said in capsys.readouterr().err


def test_without_a_table_the_command_that_makes_one_is_told(project: Path, capsys):
    (project / "data/store/manifests/feasible_motions.criteria.parquet").unlink()
    assert main(["inspect", "mine/stand@0-99"]) == 1
    assert "dagster asset materialize --select feasible_motions" in capsys.readouterr().err
    assert main(["inspect", "--robot", "k1", "mine/stand@0-99"]) == 1
    assert "dagster asset materialize --select k1/feasible_motions" in capsys.readouterr().err
