"""The stage for one file."""

import csv
import dataclasses
import shutil
from pathlib import Path

import numpy as np
import pytest

from pipeline.catalog import CatalogSettings, catalogue, catalogue_file
from pipeline.clips.outcome import Reason
from pipeline.errors import FileError
from pipeline.files import digest
from pipeline.files import settings as settings_file
from pipeline.readers import ReadMotion, Source, Statement, read_motion
from tests.conftest import ROOT
from tests.factories.gliding import gliding_robot
from tests.factories.human_clips import Gait, walker
from tests.factories.runner import runner

SETTINGS = settings_file.read(ROOT / "data" / "catalog.yaml", CatalogSettings)
MISMATCH = Reason(code="skeleton_mismatch", text="another person's bones", effect="rejected")


def as_read(clip, *notes):
    return ReadMotion(
        clip=clip,
        format="bvh",
        skeleton="test",
        declared_fps=clip.fps,
        unit="cm",
        metres_per_unit=0.01,
        up_axis="y",
        files=(Path("walk.bvh"),),
        notes=notes,
    )


def test_a_sound_clip_goes_on_unchanged_with_its_numbers():
    clip = walker(seconds=10.0, gait=Gait(speed_m_s=1.2, stride_s=1.1))
    outcome = catalogue(as_read(clip), settings=SETTINGS)
    (piece,) = outcome.pieces
    assert piece.clip is clip
    assert outcome.reasons == ()
    numbers = piece.numbers
    assert {name: numbers[name] for name in ("kind", "format", "unit", "fps", "declared_fps", "frames", "notes")} == {
        "kind": "human",
        "format": "bvh",
        "unit": "cm",
        "fps": 60.0,
        "declared_fps": 60.0,
        "frames": 600,
        "notes": "",
    }
    assert numbers["seconds"] == pytest.approx(10.0)
    assert numbers["missing_frames"] == 0
    assert numbers["speed_mean"] == pytest.approx(1.2, abs=0.03)
    assert numbers["cadence_per_min"] == pytest.approx(120.0 / 1.1, rel=0.04)
    assert numbers["leg_length"] == pytest.approx(0.89, abs=0.01)
    assert numbers["flight_share"] == 0.0
    assert numbers["stance_foot_speed"] < 0.02


def test_feet_that_slide_show_in_the_numbers():
    clip = walker(seconds=10.0, gait=Gait(slide_m_s=0.3))
    assert catalogue(as_read(clip), settings=SETTINGS).numbers["stance_foot_speed"] == pytest.approx(0.3, abs=0.05)


def test_a_wrong_rate_is_corrected_and_said():
    outcome = catalogue(as_read(dataclasses.replace(runner(120.0), fps=25.0)), settings=SETTINGS)
    (piece,) = outcome.pieces
    (reason,) = outcome.reasons
    assert piece.clip.fps == 120.0
    assert (reason.code, reason.effect) == ("time_base", "repaired")
    assert "the motion was made at 120 Hz" in reason.text
    assert piece.numbers["declared_fps"] == 25.0
    assert piece.numbers["fps"] == 120.0
    assert piece.numbers["speed_mean"] == pytest.approx(2.8, abs=0.05)
    assert piece.numbers["notes"] == "time_base"


def test_a_wrong_rate_that_several_rates_explain_is_rejected_with_what_to_do():
    outcome = catalogue(as_read(dataclasses.replace(runner(108.0), fps=25.0)), settings=SETTINGS)
    assert outcome.pieces == ()
    (reason,) = outcome.reasons
    assert (reason.code, reason.effect) == ("time_base", "rejected")
    assert "100 Hz or 120 Hz would explain it; state `fps:`" in reason.text
    assert outcome.numbers["frames"] > 0


def test_a_stated_rate_stays_and_the_doubt_is_noted():
    clip = dataclasses.replace(runner(120.0), fps=25.0)
    outcome = catalogue(as_read(clip), settings=SETTINGS, rate_is_stated=True)
    assert outcome.pieces[0].clip.fps == 25.0
    assert [reason.effect for reason in outcome.reasons] == ["noted"]


def test_frames_stored_twice_are_kept_once_and_the_speed_stays():
    clip = walker(seconds=6.0, fps=30.0)
    twice = dataclasses.replace(
        clip,
        fps=60.0,
        body_pos_w=np.repeat(clip.body_pos_w, 2, axis=0),
        body_quat_w=np.repeat(clip.body_quat_w, 2, axis=0),
        contacts=None,
    )
    outcome = catalogue(as_read(twice), settings=SETTINGS)
    (piece,) = outcome.pieces
    np.testing.assert_array_equal(piece.clip.body_pos_w, clip.body_pos_w)
    assert piece.clip.fps == 30.0
    assert [(reason.code, reason.effect) for reason in outcome.reasons] == [("doubled_frames", "repaired")]
    assert piece.numbers["seconds"] == pytest.approx(6.0)


def test_a_note_that_rejects_stops_the_clip_and_is_kept_beside_others():
    note = Reason(code="assumed_rate", text="no rate in the file", effect="noted")
    outcome = catalogue(as_read(walker(), MISMATCH, note), settings=SETTINGS)
    assert outcome.pieces == ()
    assert outcome.reasons == (MISMATCH, note)
    assert outcome.numbers["notes"] == "assumed_rate,skeleton_mismatch"
    assert outcome.numbers["speed_mean"] > 0.0


def test_a_robot_is_measured_but_its_rate_is_not_judged():
    outcome = catalogue(as_read(gliding_robot([(4.0, 0.8, 0.0, 0.5)])), settings=SETTINGS)
    numbers = outcome.pieces[0].numbers
    assert numbers["kind"] == "robot"
    assert numbers["speed_mean"] == pytest.approx(0.8, abs=0.01)
    assert numbers["yaw_rate_mean"] == pytest.approx(0.5, abs=0.01)
    assert "fps_by_gravity" not in numbers


def test_missing_samples_are_counted_and_do_not_stop_the_measuring():
    clip = walker(seconds=6.0)
    pos = clip.body_pos_w.copy()
    pos[50:60, 4] = np.nan
    pos[100:110] = np.nan
    numbers = catalogue(as_read(dataclasses.replace(clip, body_pos_w=pos)), settings=SETTINGS).numbers
    assert numbers["missing_frames"] == 20
    assert numbers["speed_mean"] == pytest.approx(1.2, abs=0.05)


def test_a_clip_without_any_sample_is_measured_as_unknown():
    clip = walker(seconds=2.0)
    empty = dataclasses.replace(
        clip, body_pos_w=np.full_like(clip.body_pos_w, np.nan), body_quat_w=np.full_like(clip.body_quat_w, np.nan)
    )
    numbers = catalogue(as_read(empty), settings=SETTINGS).numbers
    assert numbers["missing_frames"] == 120
    assert (numbers["speed_mean"], numbers["leg_length"], numbers["stance_foot_speed"]) == (None, None, None)


@pytest.mark.parametrize("frames", [1, 2, 3])
def test_clips_of_few_frames_are_measured(frames):
    outcome = catalogue(as_read(walker().cut(0, frames, "few")), settings=SETTINGS)
    assert outcome.numbers["frames"] == frames


def test_a_file_brings_its_source_licence_and_hash():
    path = ROOT / "data" / "motions" / "walk.bvh"
    source = Source(name="shipped", folder=path.parent, licence="CC0-1.0", credit="made here")
    outcome = catalogue_file(path, "shipped/walk", source, "walk.bvh", settings=SETTINGS)
    numbers = outcome.pieces[0].numbers
    assert outcome.pieces[0].clip.name == "shipped/walk"
    assert (numbers["source"], numbers["file"], numbers["licence"]) == ("shipped", "walk.bvh", "CC0-1.0")
    assert numbers["file_sha256"] == digest.of_file(path)


@pytest.mark.shared
def test_of_the_real_files_only_those_with_such_a_defect_are_touched(mocap):
    touched, rejected = {}, set()
    with (mocap / "index.csv").open() as stream:
        rows = list(csv.DictReader(stream))
    for row in rows:
        file = row["file"]
        read = read_motion(mocap / file, file, Statement(fps=120.0 if file.endswith(".amc") else None))
        outcome = catalogue(read, settings=SETTINGS)
        codes = {reason.code for reason in outcome.reasons} & {"time_base", "doubled_frames"}
        if codes:
            touched[file] = (*codes, outcome.pieces[0].clip.fps)
        if not outcome.pieces:
            rejected.add(file)
        elif file not in ("cmu_bvh/02_03.bvh", "pfnn/LocomotionFlat04_000.bvh"):
            assert outcome.numbers["speed_mean"] == pytest.approx(float(row["speed_mean"]), rel=0.1, abs=0.05), file
    assert touched == {
        "cmu_bvh/02_03.bvh": ("time_base", 120.0),
        "isaaclab_amp/humanoid_walk.npz": ("doubled_frames", 30.0),
    }
    assert rejected == {"cmu_asfamc/02_01.amc"}


def test_a_file_that_is_a_link_out_of_its_source_is_not_read(tmp_path):
    folder = tmp_path / "motions"
    folder.mkdir()
    (folder / "walk.bvh").symlink_to(ROOT / "data" / "motions" / "walk.bvh")
    with pytest.raises(FileError, match="leaves the source's folder"):
        catalogue_file(folder / "walk.bvh", "walk", Source(name="m", folder=folder), "walk.bvh", settings=SETTINGS)


def test_a_broken_sidecar_is_among_the_reasons_and_the_notes(tmp_path):
    shutil.copy(ROOT / "data" / "motions" / "stand.bvh", tmp_path)
    (tmp_path / "stand.yaml").write_text("licence: [1")
    source = Source(name="mine", folder=tmp_path)
    outcome = catalogue_file(tmp_path / "stand.bvh", "stand", source, "stand.bvh", settings=SETTINGS)
    assert "broken_sidecar" in {reason.code for reason in outcome.reasons}
    assert "broken_sidecar" in str(outcome.pieces[0].numbers["notes"])
    assert outcome.numbers["licence"] == "unknown"
