"""The table of criteria: complete, true to the verdicts, with unit and source, and the same bytes every time."""

import dataclasses
import errno
import logging
import os
from functools import partial
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pandas as pd
import pyarrow.parquet as pq
import pytest

from assets import robot_motions
from assets.plan import robot_plans
from pipeline.batch import ClipPool, Entry, Manifest, Stage, Store, run_stage
from pipeline.clips.robot_clip import RobotClip
from pipeline.errors import FileError
from pipeline.feasibility import FeasibilitySettings, assess, criteria_table, process
from pipeline.feasibility.clip_criteria import TOO_SHORT
from pipeline.feasibility.criteria_table import by_criterion, worst_margins
from pipeline.feasibility.criterion import REGISTERED, codes, groups
from pipeline.feasibility.judgement import NUMBER, from_text, to_text
from pipeline.feasibility.motion import motion_of
from pipeline.feasibility.tracking_criteria import followed
from pipeline.files import settings
from pipeline.files.sourced import SOURCES, Origin, origins
from pipeline.robot import Robot
from tests.factories.robot_clips import standing, wandering
from tests.factories.simulated_clip import simulated_standing

FILE = Path(__file__).resolve().parents[2] / "data" / "feasibility.yaml"
LIMITS = settings.read(FILE, FeasibilitySettings)
ORIGINS = origins(settings.read_yaml(FILE))
FIGURES = groups()["likeness to the person"]
NEAR = {name: 0.001 for name in FIGURES}


def _bent(clip: RobotClip, robot: Robot) -> RobotClip:
    """An arm joint .2 rad past its limit in the middle."""
    joint, frames = robot.joint("Left_Elbow_Yaw"), np.arange(clip.frame_count)
    level = np.interp(frames, [115, 140, 159, 184], [0.0, 1.0, 1.0, 0.0])
    joints = clip.joint_pos.copy()
    joints[:, joint] += level * (robot.joint_upper[joint] + 0.2 - joints[:, joint])
    return dataclasses.replace(clip, joint_pos=joints)


def _sunk(clip: RobotClip) -> RobotClip:
    return dataclasses.replace(clip, root_pos_w=clip.root_pos_w - np.array([0.0, 0.0, 0.05]))


def _judged(folder: Path, robot: Robot) -> Manifest:
    """KP5 on six clips."""
    holes = standing(robot).joint_pos.copy()
    holes[7, 3] = np.nan
    clips = {
        "good": (standing(robot), NEAR),
        "bent": (_bent(standing(robot, 6.0), robot), NEAR),
        "sunk, of the robot": (dataclasses.replace(_sunk(standing(robot)), contacts=None), {}),
        "unlike": (standing(robot), {**NEAR, "limb_error_deg": 60.0, "trunk_error_deg": None}),
        "short": (standing(robot, 0.3), NEAR),
        "holes": (dataclasses.replace(standing(robot), joint_pos=holes), NEAR),
    }
    store = Store(root=folder)
    entries = tuple(
        Entry(clip=name, blob=store.put_clip(clip), numbers=dict(numbers)) for name, (clip, numbers) in clips.items()
    )
    function = partial(process, settings=LIMITS, robot=robot)
    stage = Stage(name="feasible_motions", version="1", function=function, settings=settings.plain(LIMITS))
    previous = Manifest(stage="motion_variants", entries=entries, judged=())
    return run_stage(stage, previous, store, ClipPool(backend="sequential"), logging.getLogger("test"))


@pytest.fixture(scope="module")
def manifest(tmp_path_factory: pytest.TempPathFactory, robot: Robot) -> Manifest:
    return _judged(tmp_path_factory.mktemp("store"), robot)


@pytest.fixture(scope="module")
def table(manifest: Manifest) -> pd.DataFrame:
    return criteria_table.split(manifest, ORIGINS)[1]


def _rows(table: pd.DataFrame, clip: str) -> dict[str, dict]:
    """Criterion -> row, of the first stretch of a clip."""
    own = table[table["clip"] == clip]
    return {row["criterion"]: row for row in own[own["stop_s"] == own["stop_s"].max()].to_dict("records")}


def test_every_verdict_there_is_has_its_place_and_the_unit_of_its_threshold(robot: Robot):
    bare = dataclasses.replace(wandering(robot), contacts=None)
    verdicts = [
        verdict
        for clip in (standing(robot), bare, simulated_standing(robot, 0.5))
        for verdict in assess(motion_of(clip, robot, LIMITS, clip), LIMITS).verdicts
    ]
    verdicts += followed({"followed_share": 0.9}, LIMITS.tracking)
    assert {verdict.code for verdict in verdicts} | {*FIGURES, TOO_SHORT} == set(codes())
    for verdict in verdicts:
        assert ORIGINS[REGISTERED[verdict.code].limit].unit == verdict.unit, verdict.code


def test_the_groups_are_all_that_is_asked_for():
    asked = {
        "tracking stability",
        "root motion",
        "joint and speed limits",
        "torque",
        "contact consistency",
        "foot slip",
    }
    asked |= {"penetration", "self-collision", "contact forces", "smoothness"}
    assert asked | {"likeness to the person", "length"} == set(groups())


def test_every_stretch_has_every_criterion_with_number_threshold_unit_source_and_verdict(table: pd.DataFrame):
    judged = table[table["clip"] != "holes"]
    for _, own in judged.groupby(["clip", "start_s", "stop_s"]):
        assert list(own["criterion"]) == codes()
    asked = judged[judged["verdict"] != "not applicable"]
    assert asked[["number", "threshold", "margin"]].notna().all(axis=None)
    assert set(judged["verdict"]) == {"holds", "broken", "not applicable"}
    assert set(judged["source"]) <= set(SOURCES)
    assert (judged[["unit", "why", "setting"]].map(len) > 0).all(axis=None)
    assert ((asked["margin"] < 0.0) == (asked["verdict"] == "broken")).all()


def test_accepted_and_rejected_clips_and_every_stretch_are_there(table: pd.DataFrame, manifest: Manifest):
    stretches = table.drop_duplicates(["clip", "start_s", "stop_s"])
    assert set(stretches["clip"]) == {row.clip for row in manifest.judged}
    pieces = stretches[stretches["piece"] != ""]
    assert set(pieces["piece"]) == {entry.clip for entry in manifest.entries}
    assert (stretches["clip"] == "bent").sum() == 3, "the whole and both ends"
    for entry in manifest.entries:
        row = pieces[pieces["piece"] == entry.clip].iloc[0]
        assert (row["start_s"], row["stop_s"]) == (entry.numbers["stretch_start_s"], entry.numbers["stretch_stop_s"])
        own = table[table["piece"] == entry.clip]
        assert not (own["verdict"] == "broken").any()


def test_numbers_and_reasons_are_those_of_the_manifest(table: pd.DataFrame, manifest: Manifest):
    for judged in manifest.judged:
        rows = table[(table["clip"] == judged.clip) & (table["verdict"] == "broken")]
        assert set(rows["criterion"]) == {reason["code"] for reason in judged.reasons}
        for reason in judged.reasons:
            (limit,) = {row["threshold"] for row in rows.to_dict("records") if row["criterion"] == reason["code"]} or {
                0
            }
            if "limit" in reason:
                assert limit == pytest.approx(reason["limit"], rel=1e-5)
    numbers = next(row.numbers for row in manifest.judged if row.clip == "good")
    for code, row in _rows(table, "good").items():
        if code in numbers:
            assert row["number"] == pytest.approx(numbers[code], rel=1e-5), code


def test_what_is_wrong_is_said_all_of_it(table: pd.DataFrame):
    rows = _rows(table, "sunk, of the robot")
    for code in ("penetration_max", "penetration_p95"):
        assert rows[code]["verdict"] == "broken"
        assert "below the ground" in rows[code]["message"]
    assert _rows(table, "unlike")["limb_error_deg"]["message"] == "limbs point 60.0 deg away from the human's"
    assert _rows(table, "short")[TOO_SHORT]["margin"] == pytest.approx(-0.25)
    (holes,) = table[table["clip"] == "holes"].to_dict("records")
    assert (holes["criterion"], holes["verdict"], holes["piece"]) == ("not_finite", "broken", "")
    assert "frame 7: joint_pos" in holes["message"]


def test_what_does_not_apply_says_why_and_does_not_hold(table: pd.DataFrame):
    rows = _rows(table, "sunk, of the robot")
    assert rows["contact_disagreement"]["message"] == rows["foot_slip_mean"]["message"] == "no contact labels"
    assert rows["foot_glide_s"]["verdict"] == rows["foot_inferred_slip_mean"]["verdict"] == "holds"
    assert _rows(table, "good")["foot_slip_mean"]["verdict"] == "holds"
    assert _rows(table, "good")["foot_inferred_slip_mean"]["verdict"] == "holds"
    assert _rows(table, "good")["foot_glide_s"]["message"] == "contacts are labelled"
    assert rows["limb_error_deg"]["message"] == "no figure of retargeting: the robot's own recording"
    assert _rows(table, "unlike")["trunk_error_deg"]["message"] == "no figure of retargeting: KP3 had no sample of it"
    tracked = table[table["group"] == "tracking stability"]
    assert set(tracked["verdict"]) == {"not applicable"}
    assert set(tracked["message"]) == {"no tracked rollout"}
    assert tracked["number"].isna().all()
    assert set(tracked.loc[tracked["criterion"] == "tracking_gravity", "threshold"]) == {0.8}


def test_judgements_do_not_stay_in_the_manifest(manifest: Manifest):
    bare, _ = criteria_table.split(manifest, ORIGINS)
    assert NUMBER in manifest.judged_table() and not any(NUMBER in entry.numbers for entry in manifest.entries)
    assert NUMBER not in bare.judged_table()
    assert bare.entries == manifest.entries
    assert [row.reasons for row in bare.judged] == [row.reasons for row in manifest.judged]


def test_judgements_come_back_from_their_text(manifest: Manifest):
    text = next(str(row.numbers[NUMBER]) for row in manifest.judged if row.clip == "bent")
    assert to_text(from_text(text)) == text


def test_equal_tables_are_equal_bytes_and_belong_to_their_manifest(manifest: Manifest, robot: Robot, tmp_path: Path):
    files = []
    for name, made in (("a", manifest), ("b", _judged(tmp_path / "store", robot))):
        bare, table = criteria_table.split(made, ORIGINS)
        (tmp_path / f"{name}.json").write_text(bare.to_text())
        files.append(criteria_table.path_beside(tmp_path / f"{name}.json"))
        criteria_table.write(files[-1], table, bare)
    assert files[0].read_bytes() == files[1].read_bytes()
    found = criteria_table.read(files[0], tmp_path / "a.json")
    assert list(found.columns) == list(criteria_table.COLUMNS)
    assert len(found) == len(table)
    (tmp_path / "a.json").write_text(bare.to_text() + " ")
    with pytest.raises(FileError, match="is not of what is stored"):
        criteria_table.read(files[0], tmp_path / "a.json")
    files[1].write_bytes(b"no table")
    assert not criteria_table.belongs(files[1], tmp_path / "b.json")
    with pytest.raises(FileError, match="there is no table of criteria"):
        criteria_table.read(tmp_path / "none", tmp_path / "b.json")


def test_a_text_that_many_rows_have_is_kept_once(table: pd.DataFrame):
    """A row has 16 cells, most of them texts, some of them sentences."""
    texts = table.select_dtypes(exclude=float)
    assert (
        texts.memory_usage(index=False).sum() < 5 * texts.size < texts.astype(str).memory_usage(index=False).sum() / 3
    )


def test_a_table_written_part_by_part_is_the_same(
    table: pd.DataFrame, manifest: Manifest, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    path, tables = tmp_path / "a.json", []
    path.write_text(manifest.to_text())
    for rows in (criteria_table.ROWS_AT_A_TIME, 7, len(table)):
        monkeypatch.setattr(criteria_table, "ROWS_AT_A_TIME", rows)
        criteria_table.write(criteria_table.path_beside(path), table, manifest)
        tables.append(criteria_table.read(criteria_table.path_beside(path), path))
    assert tables[0].equals(tables[1]) and tables[0].equals(tables[2])
    assert tables[0]["why"].tolist() == table["why"].tolist()
    criteria_table.write(criteria_table.path_beside(path), table.iloc[:0], manifest)
    assert criteria_table.read(criteria_table.path_beside(path), path).empty


def test_texts_of_several_row_groups_are_read_as_sorted_categories(
    table: pd.DataFrame, manifest: Manifest, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    """Each row group has a dictionary of its own; the rows are in reverse, so a category's first row says nothing."""
    path = tmp_path / "a.json"
    path.write_text(manifest.to_text())
    turned = table.iloc[::-1].reset_index(drop=True)
    monkeypatch.setattr(criteria_table, "ROWS_AT_A_TIME", 7)
    criteria_table.write(criteria_table.path_beside(path), turned, manifest)
    assert pq.read_metadata(criteria_table.path_beside(path)).num_row_groups == -(-len(table) // 7) > 1
    found = criteria_table.read(criteria_table.path_beside(path), path)
    pd.testing.assert_frame_equal(found, turned)  # also the order of the categories
    assert worst_margins(found)["clip"].tolist() == worst_margins(turned)["clip"].tolist()
    some = criteria_table.read(criteria_table.path_beside(path), path, columns=["margin", "clip"])
    pd.testing.assert_frame_equal(some, turned[["margin", "clip"]])


@pytest.fixture
def stored(table: pd.DataFrame, manifest: Manifest, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The manifest of the references in a project's store, its table of criteria beside it."""
    monkeypatch.setattr(robot_motions, "PROJECT", SimpleNamespace(store=Store(root=tmp_path)))
    path = tmp_path / "manifests" / "reference_motions.json"
    path.parent.mkdir()
    path.write_text(manifest.to_text())
    criteria_table.write(criteria_table.path_beside(path), table, manifest)
    return path


def test_a_table_with_damaged_pages_is_named_and_kp5_evaluates_again(stored: Path):
    references, path = robot_plans("t1")["reference_motions"], criteria_table.path_beside(stored)
    assert robot_motions.criteria_of_references(references) is not None
    data = path.read_bytes()
    path.write_bytes(data[:4] + bytes(400) + data[404:])
    assert criteria_table.belongs(path, stored), "its footer is whole"
    with pytest.raises(FileError, match=r"not a table of criteria that can be read.*--select feasible_motions"):
        criteria_table.read(path, stored)
    assert robot_motions.criteria_of_references(references) is None


@pytest.mark.parametrize("shortage", [MemoryError(), OSError(errno.EIO, os.strerror(errno.EIO))])
def test_a_shortage_is_not_reported_as_a_damaged_table(stored: Path, monkeypatch, shortage: Exception):
    def fail(*_, **__):
        raise shortage

    monkeypatch.setattr(criteria_table.pq, "read_table", fail)
    with pytest.raises(type(shortage)) as raised:
        robot_motions.criteria_of_references(robot_plans("t1")["reference_motions"])
    assert raised.value is shortage


def test_from_afar_each_criterion_has_its_counts_and_what_came_nearest(table: pd.DataFrame):
    seen = {row["criterion"]: row for row in by_criterion(table).to_dict("records")}
    excess = seen["joint_limit_excess"]
    assert (excess["clips"], excess["broken"], excess["not applicable"]) == (5, 1, 0)
    assert seen["tracking_growth"]["not applicable"] == 5
    assert seen["limb_error_deg"]["broken"] == 1
    kept = table[(table["criterion"] == "joint_limit_excess") & (table["piece"] != "")]
    assert excess["closest margin"] == kept["margin"].min()
    assert seen["not_finite"]["broken"] == 1


def test_from_afar_a_threshold_is_told_with_where_it_comes_from(table: pd.DataFrame):
    rows = {row["criterion"]: row for row in by_criterion(table).to_dict("records")}
    for code in ("joint_limit_excess", "foot_slip_p95", "force_residual"):
        setting = REGISTERED[code].limit
        assert (rows[code]["setting"], rows[code]["why"]) == (setting, ORIGINS[setting].why)


def test_the_worst_margins_come_first(table: pd.DataFrame):
    seen = worst_margins(table)
    margins = seen["margin"].dropna()
    assert margins.is_monotonic_increasing
    assert (seen["verdict"] != "not applicable").all()
    assert seen.iloc[0]["clip"] == "holes", "what could not be judged at all has no margin"


def test_another_sentence_is_another_table_and_no_other_question(tmp_path: Path, manifest: Manifest):
    text = FILE.read_text()
    (tmp_path / "feasibility.yaml").write_text(text.replace("A fall is 60 degrees.", "A fall is more."))
    assert settings.read(tmp_path / "feasibility.yaml", FeasibilitySettings) == LIMITS
    other: dict[str, Origin] = origins(settings.read_yaml(tmp_path / "feasibility.yaml"))
    bare, table = criteria_table.split(manifest, other)
    assert set(table.loc[table["criterion"] == "root_tilt_deg", "why"]) == {"A fall is more."}
    assert bare.digest == criteria_table.split(manifest, ORIGINS)[0].digest
