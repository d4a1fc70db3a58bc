"""The commands as they are typed, on the motions that ship with the project and on broken files."""

import json
import re

import numpy as np
import pytest

from pipeline.cli.main import main
from pipeline.readers import read_motion
from tests.factories.robot_files import csv_rows, qpos_npz, write_csv

INSPECTION_KEYS = {
    "file": str,
    "kind": str,
    "format": str,
    "skeleton": str,
    "unit": str,
    "up_axis": str,
    "licence": str,
    "declared_fps": float,
    "fps": float,
    "frames": int,
    "seconds": float,
    "leg_length": float,
    "speed_mean": float,
    "speed_max": float,
    "usable_seconds": float,
    "usable_pieces": int,
    "windows": list,
    "reasons": list,
}


@pytest.fixture
def motions(root):
    return root / "data" / "motions"


def _frames_kept(path, tmp_path, count: int, name: str):
    """The first frames of a BVH, for speed."""
    lines = path.read_text().splitlines()
    start = next(index for index, line in enumerate(lines) if line.startswith("Frame Time")) + 1
    head = [f"Frames: {count}" if line.startswith("Frames:") else line for line in lines[:start]]
    short = tmp_path / name
    short.write_text("\n".join([*head, *lines[start : start + count]]) + "\n")
    return short


@pytest.fixture
def walk(motions, tmp_path):
    """Three seconds of the shipped walk, outside of any source."""
    return _frames_kept(motions / "walk.bvh", tmp_path, 180, "walk3.bvh")


def test_retarget_writes_a_motion_of_the_robot_that_the_reader_reads(walk, tmp_path, capsys):
    out = tmp_path / "new folder" / "out.csv"
    assert main(["retarget", str(walk), "--out", str(out)]) == 0
    clip = read_motion(out, "out").clip
    assert clip.fps == 30.0 and clip.robot == "t1"
    assert clip.duration_s == pytest.approx(3.0, abs=0.05)
    assert np.isfinite(clip.joint_pos).all()
    # the robot's legs are .6 of a person's: so is its way, along +x from near the origin
    human = read_motion(walk, "walk").clip.pos("pelvis")
    way = clip.root_pos_w[-1] - clip.root_pos_w[0]
    assert 0.5 < way[0] / np.linalg.norm(human[-1] - human[0]) < 0.75 and abs(way[1]) < 0.15
    assert np.abs(clip.root_pos_w[0, :2]).max() < 0.15
    assert 0.6 < clip.root_pos_w[:, 2].mean() < 0.72
    said = capsys.readouterr().out
    assert "3.00 s in (bvh, booster_lab)" in said and "in 1 piece, on t1 at 30 Hz" in said and str(out) in said


def test_retarget_twice_writes_the_same_bytes(walk, tmp_path):
    files = [tmp_path / "a.csv", tmp_path / "b.csv"]
    for out in files:
        assert main(["retarget", str(walk), "--out", str(out)]) == 0
    assert files[0].read_bytes() == files[1].read_bytes()


def test_a_motion_cut_in_two_gives_the_longest_piece_and_the_other_beside_it(motions, tmp_path, capsys):
    out = tmp_path / "out.csv"
    assert main(["retarget", str(motions / "defect_dropout.bvh"), "--out", str(out)]) == 0
    first, second = read_motion(out, "a").clip, read_motion(tmp_path / "out.1.csv", "b").clip
    assert not (tmp_path / "out.2.csv").exists()
    assert first.duration_s >= second.duration_s > 3.0
    said = capsys.readouterr().out
    assert "rejected 5.00 to 5.60 s" in said and "in 2 pieces" in said


def test_what_the_robot_did_itself_passes_and_is_resampled(walk, tmp_path):
    once, again = tmp_path / "once.csv", tmp_path / "again.csv"
    assert main(["retarget", str(walk), "--out", str(once)]) == 0
    assert main(["retarget", str(once), "--fps", "25", "--out", str(again)]) == 0
    first, second = read_motion(once, "a").clip, read_motion(again, "b").clip
    assert second.fps == 25.0
    assert second.duration_s == pytest.approx(first.duration_s, abs=0.05)


def test_nothing_usable_is_one_sentence_with_its_reason_and_no_file(motions, tmp_path, capsys):
    out = tmp_path / "out.csv"
    assert main(["retarget", str(motions / "defect_foot_skate.bvh"), "--out", str(out)]) == 1
    said = capsys.readouterr()
    assert not out.exists() and said.out == ""
    assert "no part of it can be retargeted" in said.err and said.err.count("\n") == 1


def test_inspect_tells_a_file_in_a_table(motions, capsys):
    assert main(["inspect", str(motions / "walk.bvh")]) == 0
    said = capsys.readouterr().out
    lines = dict(line.split("  ", 1) for line in said.splitlines() if line[:1].strip() and "  " in line)
    facts = {name.strip(): value.strip() for name, value in lines.items()}
    assert facts["format"] == "bvh" and facts["skeleton"] == "booster_lab" and facts["licence"] == "CC0-1.0"
    assert facts["declared rate"] == "60 Hz" and facts["true rate"] == "60 Hz"
    assert "found: no defects" in said and "walk" in said


def test_inspect_json_has_its_keys_and_types(motions, capsys):
    assert main(["inspect", "--json", str(motions / "defect_dropout.bvh")]) == 0
    found = json.loads(capsys.readouterr().out)
    assert {name: type(value) for name, value in found.items()} == INSPECTION_KEYS
    assert found["windows"] and {"start_s", "stop_s", "skill", "forward_m_s"} <= set(found["windows"][0])
    assert found["windows"][-1]["stop_s"] == pytest.approx(found["seconds"])
    for reason in found["reasons"]:
        assert {"stage", "code", "text", "effect"} <= set(reason)
        assert reason["effect"] in ("rejected", "repaired", "noted")


@pytest.mark.parametrize(
    ("file", "code"),
    [
        ("defect_dropout", "dropout"),
        ("defect_foot_skate", "foot_skate"),
        ("defect_frozen", "frozen"),
        ("defect_teleport", "teleport"),
        ("defect_time_base", "time_base"),
    ],
)
def test_inspect_names_the_planted_defect(motions, capsys, file, code):
    assert main(["inspect", "--json", str(motions / f"{file}.bvh")]) == 0
    found = json.loads(capsys.readouterr().out)
    assert code in {reason["code"] for reason in found["reasons"]}


def test_inspect_of_a_folder_is_a_line_a_file_and_an_unreadable_one_has_its_reason(walk, tmp_path, capsys):
    (tmp_path / "broken.bvh").write_text("HIERARCHY\nROOT\n")
    assert main(["inspect", str(tmp_path)]) == 0
    header, broken, whole = capsys.readouterr().out.splitlines()
    assert header.startswith("file") and header.endswith("found")
    assert re.match(r"broken\.bvh .* 0\.00  line \d+: ", broken), "the file is named once"
    assert whole.startswith("walk3.bvh") and "booster_lab" in whole and whole.endswith("nothing")
    assert main(["inspect", "--json", str(tmp_path)]) == 0
    values = json.loads(capsys.readouterr().out)
    assert [set(value) == {"file", "error"} for value in values] == [True, False]


def test_a_stated_rate_goes_before_the_declared_one(walk, capsys):
    assert main(["inspect", "--json", "--source-fps", "50", str(walk)]) == 0
    found = json.loads(capsys.readouterr().out)
    assert found["declared_fps"] == pytest.approx(60.0, rel=1e-3)
    assert found["fps"] == 50.0


def test_view_writes_a_picture(walk, tmp_path, capsys):
    out = tmp_path / "walk.png"
    assert main(["view", str(walk), "--picture", str(out), "--poses", "4"]) == 0
    assert out.read_bytes().startswith(b"\x89PNG")
    assert "1 of 1 clips" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        (["inspect", "{tmp}/none.bvh"], "the file does not exist"),
        (["inspect", "{tmp}/notes.doc"], "'.doc' is not a motion file"),
        (["inspect", "{tmp}/empty"], "it has no motion files"),
        (
            ["view", "{walk}", "--picture", "{tmp}/walk.jpg"],
            "walk.jpg: a picture is a .png. Name a file with that suffix.",
        ),
        (["inspect", "--write-map", "{tmp}/empty"], "it is a folder. Name one motion file for --write-map."),
        (["inspect", "--write-map", "{tmp}/none.bvh"], "the file does not exist"),
        (["inspect", "--unit", "parsec", "{walk}"], "'parsec' is not a unit"),
        (["inspect", "--unit", "m", "{walk}"], "with the stated unit 'm' a leg is"),
        (["inspect", "--unit", "m", "{walk}"], "`unit:` in data/sources.yaml. For this command only: --unit."),
        (["inspect", "{tmp}/rows.csv"], "data/sources.yaml. For this command only: --source-fps."),
        (["score", "{tmp}/rows.csv", "--human", "{walk}"], "data/sources.yaml. For this command only: --fps."),
        (["inspect", "--skeleton", "octopus", "{walk}"], "octopus"),
        (["retarget", "{tmp}/none.bvh", "--out", "{tmp}/o.csv"], "the file does not exist"),
        (
            ["retarget", "{tmp}/odd.npz", "--out", "{tmp}/o.csv"],
            "as `fps:` in data/sources.yaml. For this command only: --source-fps.",
        ),
        (["retarget", "{walk}", "--out", "{tmp}/o.bvh"], "ends in .csv"),
        (["retarget", "{walk}", "--robot", "k9", "--out", "{tmp}/o.csv"], "unknown robot 'k9'; there are: k1, t1"),
        (["view", "{tmp}"], "it is a folder"),
        (["view", "{tmp}/none.bvh"], "the file does not exist"),
        (["view", "{tmp}/other.json"], "not a clip of an expert database"),
    ],
)
def test_an_error_is_one_sentence_on_stderr_and_exit_code_1(walk, tmp_path, capsys, arguments, sentence):
    (tmp_path / "empty").mkdir()
    (tmp_path / "notes.doc").write_text("hello")
    (tmp_path / "other.json").write_text("{}")
    write_csv(tmp_path / "rows.csv", csv_rows())
    qpos_npz(tmp_path / "odd.npz", 80.0, frequency=np.array(64.0))
    assert main([each.format(tmp=tmp_path, walk=walk) for each in arguments]) == 1
    said = capsys.readouterr()
    assert said.out == ""
    assert said.err.startswith("booster-lab: ") and sentence in said.err and said.err.count("\n") == 1


def test_inspect_writes_a_skeleton_map(root, capsys):
    assert main(["inspect", str(root / "data/motions/walk.bvh"), "--write-map"]) == 0
    assert "  left_hip: {joint: LeftUpLeg, left: x, down: LeftLeg}" in capsys.readouterr().out
