"""DeepMimic text against poses worked out by hand."""

import numpy as np
import pytest

from pipeline.errors import FileError
from pipeline.readers import Statement, read_motion
from tests.factories import motion_files as files

RIGHT_KNEE, LEFT_ELBOW = 1 + 3 + 4 + 4 + 4 + 4, 43
"""Columns of two hinges, counted from the documented layout."""


def read(path, motion):
    return read_motion(files.write_deepmimic(path / "clip.txt", motion), "clip")


def test_the_figure_stands_in_metres_with_z_up_and_glides_ahead(tmp_path):
    result = read(tmp_path, files.deepmimic())
    clip = result.clip
    assert (result.format, result.unit, result.up_axis, clip.fps) == ("deepmimic", "m", "y", 30.0)
    np.testing.assert_allclose(clip.pos("pelvis")[:, 2], 0.9, atol=1e-9)
    drop = clip.pos("pelvis")[0, 2] - clip.pos("left_ankle")[0, 2]
    assert drop == pytest.approx(0.421546 + 0.409870, abs=1e-9)
    ahead = clip.pos("pelvis")[-1] - clip.pos("pelvis")[0]
    side = clip.pos("left_hip")[0] - clip.pos("right_hip")[0]
    np.testing.assert_allclose(
        np.cross([0, 0, 1], ahead / np.linalg.norm(ahead)), side / np.linalg.norm(side), atol=1e-9
    )


def test_a_knee_bends_back_and_an_elbow_ahead(tmp_path):
    motion = files.deepmimic()
    for row in motion["Frames"]:
        row[RIGHT_KNEE], row[LEFT_ELBOW] = -0.8, 0.9
    clip = read(tmp_path, motion).clip
    ahead = clip.pos("pelvis")[-1] - clip.pos("pelvis")[0]
    ahead /= np.linalg.norm(ahead)
    shank = clip.pos("right_ankle")[0] - clip.pos("right_knee")[0]
    forearm = clip.pos("left_wrist")[0] - clip.pos("left_elbow")[0]
    assert shank @ ahead == pytest.approx(-0.409870 * np.sin(0.8), abs=1e-9)
    assert forearm @ ahead == pytest.approx(0.258947 * np.sin(0.9), abs=1e-9)


def test_the_duration_of_the_last_frame_does_not_count(tmp_path):
    motion = files.deepmimic(frame_s=0.02)
    motion["Frames"][-1][0] = 0.0
    assert read(tmp_path, motion).clip.fps == 50.0


def damaged(change):
    motion = files.deepmimic()
    change(motion["Frames"])
    return motion


@pytest.mark.parametrize(
    ("motion", "match"),
    [
        ({"Loop": "wrap"}, "no list 'Frames'"),
        ({"Frames": []}, "no list 'Frames', or it is empty"),
        (damaged(lambda rows: rows[3].pop()), "frame 3 has 43 numbers, expected 44"),
        (damaged(lambda rows: rows.__setitem__(2, "row")), "frame 2 has str numbers"),
        (damaged(lambda rows: rows[4].__setitem__(9, "1.0")), "frame 4 holds something that is not a number"),
        (damaged(lambda rows: rows[5].__setitem__(8, 2.0)), "the quaternion of 'chest' at frame 5 has norm 2"),
        (damaged(lambda rows: rows[5].__setitem__(0, 0.1)), "one rate is expected"),
        (damaged(lambda rows: [row.__setitem__(0, 0.0) for row in rows]), "a frame lasts 0 s"),
        (damaged(lambda rows: rows.__delitem__(slice(1, None))), "1 frame"),
    ],
)
def test_a_damaged_motion_is_refused(tmp_path, motion, match):
    with pytest.raises(FileError, match=match):
        read(tmp_path, motion)


@pytest.mark.parametrize("text", ["{", "[" * 100_000, "not json"])
def test_what_is_no_json_is_refused(tmp_path, text):
    path = tmp_path / "clip.txt"
    path.write_text(text)
    with pytest.raises(FileError, match="not DeepMimic JSON"):
        read_motion(path, "clip")


@pytest.mark.parametrize("frame_s", [0.0, 2.0])
def test_a_rate_that_the_durations_do_not_give_can_be_stated(tmp_path, frame_s):
    path = files.write_deepmimic(tmp_path / "clip.txt", files.deepmimic(frame_s=frame_s))
    with pytest.raises(FileError, match=r"State `fps:` for it in data/sources\.yaml"):
        read_motion(path, "clip")
    assert read_motion(path, "clip", Statement(fps=40.0)).clip.fps == 40.0
