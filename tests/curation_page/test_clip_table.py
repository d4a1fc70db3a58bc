"""The gallery's rows: every clip once, where it ended and why, with the motions that show it."""

import dataclasses

import pytest

from pipeline.batch import Store
from pipeline.curation_page.clip_details import ancestors, clip_details
from pipeline.curation_page.clip_table import made_from, read_table
from pipeline.curation_page.columns import columns
from pipeline.curation_page.motion_sources import MotionSources
from pipeline.errors import PipelineError
from tests.factories import curated_project as made


@pytest.fixture(scope="module")
def store(root, robot, tmp_path_factory):
    folder = made.curated_project(root, tmp_path_factory.mktemp("curated") / "project", robot)
    return Store(root=folder / "data/store")


@pytest.fixture(scope="module")
def table(store):
    return read_table(store, "t1")


def test_each_clip_has_one_row_at_the_stage_where_it_ended(table):
    assert {row.clip: (row.stage, row.verdict) for row in table.rows} == {
        made.KEPT: ("feasible_motions", "accepted"),
        made.CUT: ("feasible_motions", "partly"),
        made.SLIPPING: ("feasible_motions", "rejected"),
        made.SKATING: ("repaired_motions", "rejected"),
        made.NOT_TAKEN: ("selected_motions", "rejected"),
    }
    assert [row.clip for row in table.rows] == sorted(row.clip for row in table.rows)


def test_a_row_is_found_by_the_names_of_its_pieces(table):
    assert table.row(f"{made.CUT}+1").clip == made.CUT
    assert table.row("nobody") is None


def test_weights_of_pieces_add_up_and_figures_are_those_of_the_whole_clip(table):
    assert table.row(made.CUT).numbers["weight"] == pytest.approx(0.5)
    assert table.row(made.CUT).numbers["foot_slip_p95"] == 0.5
    assert table.row(made.KEPT).numbers["family"] == made.WINDOW


def test_a_window_that_was_not_selected_has_its_reason_and_its_frames(table):
    row = table.row(made.NOT_TAKEN)
    assert row.reasons[0]["text"] == "the 600 s of walk are filled by other windows"
    assert (row.numbers["start_frame"], row.numbers["stop_frame"]) == (100, 200)


def test_a_graph_that_stopped_half_way_shows_what_waits(store, robot, tmp_path):
    half = Store(root=tmp_path)
    for stage in ("motion_catalog", "selected_motions"):
        half.save(stage, store.load(stage).at_hand())
    verdicts = {row.clip: row.verdict for row in read_table(half, "t1").rows}
    assert verdicts == {made.WINDOW: "waiting", made.SKATING: "waiting", made.NOT_TAKEN: "rejected"}


def test_no_store_is_an_empty_table(tmp_path):
    assert read_table(Store(root=tmp_path), "t1").rows == ()


def test_the_person_of_a_variant_is_mirrored_or_slowed_as_the_robot_is(table, store, robot):
    sources = MotionSources(table)
    shown = {name: sources.of(table.row(name)) for name in (made.KEPT, made.SLIPPING, made.SKATING, made.NOT_TAKEN)}
    assert shown[made.KEPT].human.mirrored and not shown[made.SLIPPING].human.mirrored
    assert shown[made.SLIPPING].human.load(store, "x").fps == pytest.approx(54.0)
    assert shown[made.SKATING].human.load(store, "x").frame_count == 100, "only the window of the recording"
    assert shown[made.NOT_TAKEN].human.load(store, "x").frame_count == 100
    loaded = shown[made.KEPT].load(store, robot)
    assert loaded.reference.frame_count == loaded.robot_clip.frame_count == 150


def test_columns_have_a_value_for_each_row_and_nan_is_none(table):
    found = columns(table, None, ())
    count = len(table.rows)
    assert {len(each["values"]) for each in found["figures"]} == {count}
    assert {len(each["codes"]) for each in found["texts"].values()} == {count}
    slip = next(each for each in found["figures"] if each["name"] == "foot_slip_p95")
    by_clip = dict(zip(found["clip"], slip["values"], strict=True))
    assert by_clip[made.SLIPPING] == 0.6 and by_clip[made.SKATING] is None
    names, codes = found["texts"]["verdict"].values()
    assert [names[code] for code in codes] == [row.verdict for row in table.rows]


def test_details_say_what_each_stage_did_and_where_the_pieces_are(table):
    details = clip_details(table, None, (), "t1", made.CUT)
    assert [(each["start_s"], each["stop_s"]) for each in details["pieces"]] == [(0.0, 1.0), (2.0, 3.0)]
    assert details["names"] == [made.CUT, made.WINDOW, made.RECORDING]
    stages = {step["stage"]: step["clip"] for step in details["lineage"]}
    assert stages["motion_catalog"] == made.RECORDING and stages["retargeted_motions"] == made.WINDOW
    assert stages["feasible_motions"] == made.CUT
    assert clip_details(table, None, (), "t1", made.SKATING)["starts_s"] == 0.0
    kept = table.row(made.KEPT)
    assert kept is not None
    related = dataclasses.replace(kept, numbers={**kept.numbers, "family": made.SKATING})
    assert ancestors(related) == ancestors(kept), "its family is no ancestor"
    with pytest.raises(PipelineError, match="there is no clip 'nobody'"):
        clip_details(table, None, (), "t1", "nobody")


def test_a_clip_of_which_one_piece_is_left_has_its_own_figures_and_the_place_of_the_piece(root, robot, tmp_path):
    store = Store(root=made.curated_project(root, tmp_path / "project", robot) / "data/store")
    manifest = store.load("feasible_motions").at_hand()
    late = made.entry(f"{made.CUT}+0", manifest.entries[0].blob, {"seconds": 1.0, "weight": 0.3})
    late = dataclasses.replace(late, numbers={**late.numbers, "stretch_start_s": 2.0, "foot_slip_p95": 0.1})
    cut = dataclasses.replace(made.judged(made.CUT, late.clip, foot_slip_p95=0.5), reasons=())
    store.save("feasible_motions", dataclasses.replace(manifest, entries=(late,), judged=(cut,)))
    table = read_table(store, "t1")
    details = clip_details(table, None, (), "t1", made.CUT)
    assert [(each["start_s"], each["stop_s"]) for each in details["pieces"]] == [(2.0, 3.0)]
    assert (details["numbers"]["foot_slip_p95"], details["numbers"]["seconds"]) == (0.5, 3.0)
    assert details["numbers"]["weight"] == 0.3


@pytest.mark.parametrize(
    ("clip", "window", "recording"),
    [
        ("lab/walk@0-99~mirror~rollout1+0", "lab/walk@0-99", "lab/walk"),
        ("lab/walk@0-99+1~x0.9~rollout", "lab/walk@0-99", "lab/walk"),  # a repaired piece: KP1 knows its window alone
        ("lab/walk@0-99+1", "lab/walk@0-99", "lab/walk"),
        ("lab/a~b+1@home@0-99~mirror", "lab/a~b+1@home@0-99", "lab/a~b+1@home"),
        ("lab/a~b+1@home", "lab/a~b+1@home", "lab/a~b+1@home"),
    ],
)
def test_window_and_recording_of_a_clip_are_those_that_kp1_knows(clip, window, recording):
    assert made_from(clip) == (window, recording)
