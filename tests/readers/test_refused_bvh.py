"""Damaged and hostile BVH files: one error, with the line, before memory is taken."""

import re

import numpy as np
import pytest

from pipeline.errors import AmbiguousFileError, FileError
from pipeline.readers import Statement, read_motion
from pipeline.readers.bvh import MAX_DEPTH, read_bvh
from pipeline.readers.human_motion import METRES
from tests.factories import motion_files as files

GOOD = files.bvh(files.upright(4, seed=1))
ROWS = GOOD.split("\n")[-5:-1]
LEG = 0.85
"""Thigh and shank of the figure [m]."""


def refuse(tmp_path, text, match, line=None, error=FileError):
    path = tmp_path / "clip.bvh"
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    with pytest.raises(error, match=match) as caught:
        read_motion(path, "clip")
    if line is not None:
        assert caught.value.line == line
    return caught.value


def line_of(needle):
    return next(number for number, line in enumerate(GOOD.split("\n"), start=1) if needle in line)


@pytest.mark.parametrize(
    ("old", "new", "match"),
    [
        ("Frames: 4", "Frames: 5", "declares 5 frames, the file holds 4"),
        ("Frames: 4", "Frames: 1e9", "Frames is 1e9"),
        ("Frames: 4", "Frames: 2.5", "Frames is 2.5"),
        ("Frames: 4", "Frames: -4", "Frames is -4"),
        ("Frames: 4", "Frames: many", "Frames is 'many', expected a finite number"),
        ("Frame Time: 0.0166667", "Frame Time: 0", "Frame Time is '0', expected"),
        ("Frame Time: 0.0166667", "Frame Time: -0.01", "Frame Time is '-0.01', expected"),
        ("Frame Time: 0.0166667", "Frame Time: nan", "Frame Time is 'nan'"),
        ("Frame Time: 0.0166667", "Frame Time: 1e-300", "expected 0.0001 to 1"),
        ("Frame Time: 0.0166667\n", "", "followed by"),
        ("JOINT Chest", "JOINT Spine", "'Spine' is used twice"),
        ("Zrotation", "Wrotation", "unknown channel 'Wrotation'"),
        ("Zrotation Xrotation", "Xrotation Xrotation", "a channel is named twice"),
        ("CHANNELS 3", "CHANNELS 4", "CHANNELS says '4' and names 3"),
        ("HIERARCHY", "HIERARCHIE", "begins with HIERARCHY"),
        ("OFFSET 0.000000000 10.000000000", "OFFSET nan 10.000000000", "the offset is 'nan'"),
        ("OFFSET 0.000000000 10.000000000", "OFFSET 10.000000000", "OFFSET wants three numbers"),
        ("OFFSET 0.000000000 10.000000000 -1.000000000\n", "", "joint 'Spine' has no OFFSET"),
        ("MOTION", "}\nMOTION", "without its '{'"),
        ("}\nMOTION", "MOTION", "a '}' is missing"),
        ("MOTION", "", "is not part of a BVH hierarchy"),
        ("JOINT Chest\n", "JOINT Chest\n JOINT Chest2\n", "where a '{' was expected"),
        ("JOINT Spine", "ROOT Spine", "a second ROOT"),
        ("JOINT Spine", "JOINT", "JOINT without a name"),
    ],
)
def test_a_damaged_header_is_refused_with_its_line(tmp_path, old, new, match):
    assert GOOD.count(old) >= 1
    error = refuse(tmp_path, GOOD.replace(old, new, 1), re.escape(match))
    assert error.line is not None


@pytest.mark.parametrize("rows", [0, 3])
def test_frames_that_are_missing_are_told_with_the_line_that_declares_them(tmp_path, rows):
    head, number = GOOD.split("\n")[:-5], line_of("Frames: 4")
    text = "\n".join([*head, *ROWS[:rows]]).replace("Frames: 4", f"Frames: {4 if rows else 0}")
    refuse(tmp_path, text, "the file holds 3" if rows else "no frames", line=number)


def test_more_numbers_than_allowed_are_refused_before_they_are_read(tmp_path):
    refuse(tmp_path, GOOD.replace("Frames: 4", "Frames: 1999999"), "1999999 frames of 66 numbers are more than")


def test_a_row_that_was_cut_off_is_refused_with_its_line(tmp_path):
    text = GOOD.rstrip("\n")[: -len(ROWS[-1]) // 2]
    refuse(tmp_path, text, "It is the last row: the file was cut off", line=line_of(ROWS[-1]))


def test_a_row_that_is_too_long_is_refused_with_its_line(tmp_path):
    refuse(
        tmp_path,
        GOOD.replace(ROWS[1], ROWS[1] + " 1.0"),
        "the row has 67 numbers, expected 66",
        line=line_of(ROWS[1]),
    )


def test_a_file_cut_off_between_rows_is_refused(tmp_path):
    refuse(tmp_path, GOOD.replace(ROWS[-1] + "\n", ""), "declares 4 frames, the file holds 3")


def test_a_file_without_rows_has_no_frames(tmp_path):
    refuse(tmp_path, GOOD.split("Frames: 4")[0] + "Frames: 0\nFrame Time: 0.0166667\n", "no frames")


@pytest.mark.parametrize("declared", [0, 1, 3])
def test_more_rows_than_declared_are_read_and_noted(tmp_path, declared):
    path = tmp_path / "clip.bvh"
    path.write_text(GOOD)
    truth = read_motion(path, "clip").clip
    path.write_text(GOOD.replace("Frames: 4", f"Frames: {declared}"))
    read = read_motion(path, "clip")
    np.testing.assert_array_equal(read.clip.body_pos_w, truth.body_pos_w)
    (note,) = read.notes
    assert (note.code, note.effect, note.value, note.limit) == ("frame_count", "noted", 4.0, float(declared))


@pytest.mark.parametrize("line", ["Frame Time: 0\n", "Frame Time: nan\n", "Frame Time: 1/60\n", "Frame Time: \n", ""])
def test_a_file_without_a_frame_time_is_read_at_the_stated_rate(tmp_path, line):
    path = tmp_path / "clip.bvh"
    path.write_text(GOOD)
    truth = read_motion(path, "clip").clip
    path.write_text(GOOD.replace("Frame Time: 0.0166667\n", line))
    with pytest.raises(FileError, match=r"Frame Time.*state `fps:`"):
        read_motion(path, "clip")
    read = read_motion(path, "clip", Statement(fps=60.0))
    assert (read.clip.fps, read.declared_fps) == (60.0, None)
    np.testing.assert_array_equal(read.clip.body_pos_w, truth.body_pos_w)


def test_what_is_not_a_number_is_refused_with_its_line(tmp_path):
    bad = ROWS[2].replace(ROWS[2].split()[5], "abc", 1)
    refuse(tmp_path, GOOD.replace(ROWS[2], bad), "not a number: 'abc'", line=line_of(ROWS[2]))


def test_decimal_commas_are_refused_with_advice(tmp_path):
    refuse(tmp_path, GOOD.replace(ROWS[0], ROWS[0].replace(".", ",")), "Write decimals with a point")


@pytest.mark.parametrize(
    ("content", "match"),
    [
        (b"", "the file is empty"),
        (b"HIERARCHY\nROOT Hips\n\0", "zero bytes"),
        ("HIERARCHY\n".encode("utf-16"), "zero bytes. Save it as UTF-8"),
        (b"\n\n", "no MOTION"),
    ],
)
def test_what_is_no_bvh_is_refused(tmp_path, content, match):
    refuse(tmp_path, content, match)


def test_a_deep_hierarchy_is_refused_and_does_not_recurse(tmp_path):
    text = "HIERARCHY\nROOT j0\n{\nOFFSET 0 0 0\n" + "".join(
        f"JOINT j{n}\n{{\nOFFSET 0 0 0\n" for n in range(1, 100_000)
    )
    error = refuse(tmp_path, text, f"deeper than {MAX_DEPTH} joints")
    assert error.line < 1_000


def test_a_crowd_of_joints_is_refused(tmp_path):
    joints = "".join(f"JOINT j{n}\n{{\nOFFSET 0 0 0\nEnd Site\n{{\nOFFSET 0 0 0\n}}\n}}\n" for n in range(1, 1100))
    refuse(tmp_path, f"HIERARCHY\nROOT j0\n{{\nOFFSET 0 0 0\n{joints}}}\nMOTION\n", "more than 1000 joints")


def test_one_frame_is_no_motion(tmp_path):
    refuse(tmp_path, files.bvh(files.upright(1)), "1 frame")


def test_a_missing_file_is_refused(tmp_path):
    with pytest.raises(FileError, match="does not exist"):
        read_bvh(tmp_path / "none.bvh")


def test_an_unknown_suffix_is_refused_with_what_is_known(tmp_path):
    with pytest.raises(FileError, match=r"'.fbx' is not a motion file; known are: .amc, .bvh"):
        read_motion(tmp_path / "clip.fbx", "clip")


def test_an_unknown_skeleton_is_refused_with_what_is_missing_and_what_to_do(tmp_path):
    text = GOOD.replace("LeftHand", "LeftClaw")
    error = refuse(tmp_path, text, "unknown skeleton of 21 joints: .*Closest is 'booster_lab'")
    assert "missing: LeftHand;" in str(error)
    assert "LeftClaw" in str(error)
    assert "--write-map" in str(error)
    assert "docs/sources.md" in str(error)


@pytest.mark.parametrize("leg", [0.58, 1.12, 1.145])
def test_a_leg_of_a_giant_or_a_small_child_in_every_unit_is_ambiguous(tmp_path, leg):
    """A child of 1 m recorded in inches has legs of 1.145 m in CMU's unit."""
    style = files.BvhStyle(metres_per_unit=0.0254 / 0.45 * LEG / leg)
    refuse(tmp_path, files.bvh(files.upright(4), style), rf"{leg:.3g} m in cmu", error=AmbiguousFileError)


@pytest.mark.parametrize("leg", [0.61, 0.85, 1.09])
@pytest.mark.parametrize(("unit", "metres"), METRES.items())
def test_legs_of_people_between_1_24_and_2_22_m_give_the_unit(tmp_path, leg, unit, metres):
    path = tmp_path / "clip.bvh"
    path.write_text(files.bvh(files.upright(4), files.BvhStyle(metres_per_unit=metres * LEG / leg)))
    assert read_motion(path, "clip").unit == unit


def test_a_unit_that_makes_no_human_is_ambiguous(tmp_path):
    text = files.bvh(files.upright(4), files.BvhStyle(metres_per_unit=0.1))
    error = refuse(tmp_path, text, "unit of length can't be inferred: a leg .* is 8.5 units", error=AmbiguousFileError)
    assert "`unit:`" in str(error)
    path = tmp_path / "clip.bvh"
    assert read_motion(path, "clip", Statement(unit="0.1")).metres_per_unit == 0.1
    with pytest.raises(FileError, match=r"with the stated unit 'm' a leg is 8.5 m long"):
        read_motion(path, "clip", Statement(unit="m"))
    with pytest.raises(FileError, match="'furlong' is not a unit"):
        read_motion(path, "clip", Statement(unit="furlong"))


def test_a_person_who_lies_down_has_no_up_axis_until_it_is_stated(tmp_path):
    oblique = np.array([[1.0, 0, 0], [0, 0.7071, -0.7071], [0, 0.7071, 0.7071]])
    text = files.bvh(files.upright(4), files.BvhStyle(root_turn=oblique))
    refuse(tmp_path, text, "the up axis can't be inferred", error=AmbiguousFileError)
    assert read_motion(tmp_path / "clip.bvh", "clip", Statement(up="y")).up_axis == "y"
    with pytest.raises(FileError, match="expected one of z, y, x"):
        read_motion(tmp_path / "clip.bvh", "clip", Statement(up="north"))


def test_a_mirrored_file_is_refused(tmp_path):
    mirrored = GOOD
    for name in ("LeftUpLeg", "LeftLeg", "LeftFoot", "LeftToe", "LeftShoulder", "LeftArm", "LeftForeArm", "LeftHand"):
        right = name.replace("Left", "Right")
        mirrored = (
            mirrored.replace(f" {name}\n", " @\n").replace(f" {right}\n", f" {name}\n").replace(" @\n", f" {right}\n")
        )
    refuse(tmp_path, mirrored, "left and right are swapped")


def test_a_stated_skeleton_has_to_fit(tmp_path):
    path = tmp_path / "clip.bvh"
    path.write_text(GOOD)
    with pytest.raises(FileError, match=r"'lafan1' needs joints that the file lacks: Spine1, Spine2"):
        read_motion(path, "clip", Statement(skeleton="lafan1"))
    with pytest.raises(FileError, match=r"unknown stated skeleton 'martian'; there are: .*lafan1"):
        read_motion(path, "clip", Statement(skeleton="martian"))


def test_a_stated_rate_goes_before_the_declared_one(tmp_path):
    path = tmp_path / "clip.bvh"
    path.write_text(GOOD)
    read = read_motion(path, "clip", Statement(fps=120.0))
    assert (read.clip.fps, read.declared_fps) == (120.0, 60.0)
    with pytest.raises(FileError, match="the frame rate is 0 Hz"):
        read_motion(path, "clip", Statement(fps=0.0))
