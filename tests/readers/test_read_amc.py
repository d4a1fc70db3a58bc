"""ASF/AMC against the figure's geometry and a chain of matrices."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from pipeline.errors import AmbiguousFileError, FileError
from pipeline.readers import Statement, read_motion
from tests.factories import motion_files as files

UNIT = 0.0254 / 0.45
ROOT = [[0.0, 17.0, 0.5 * frame, 0.0, 0.0, 0.0] for frame in range(4)]


def write(folder, frames=None, root=ROOT, stem="07_01", asf="07.asf"):
    (folder / asf).write_text(files.asf())
    path = folder / f"{stem}.amc"
    path.write_text(files.amc(frames or [{}] * len(root), root))
    return path


def chain(values, root, bone):
    """World rotation of a bone and its joint's position [file units], by matrices."""
    parents = {"lfemur": "lhipjoint", "ltibia": "lfemur", "lfoot": "ltibia", "lhipjoint": "root"}
    table = {
        name: (np.array(direction.split(), float), length, axis, dof)
        for name, direction, length, axis, dof in files.asf_bones()
    }
    turn, pos = Rotation.from_euler("xyz", root[3:], degrees=True).as_matrix(), np.array(root[:3])
    path = [bone]
    while parents.get(path[0], "root") != "root":
        path.insert(0, parents[path[0]])
    for name in path:
        _, _, axis, dof = table[name]
        if name != path[0]:
            above, above_length = table[parents[name]][:2]
            pos = pos + turn @ (above / np.linalg.norm(above) * above_length)
        frame = Rotation.from_euler("xyz", [float(value) for value in axis.split()], degrees=True).as_matrix()
        angles = dict(zip(dof.split(), values.get(name, [0.0] * 3), strict=False))
        local = Rotation.from_euler("xyz", [angles.get(f"r{a}", 0.0) for a in "xyz"], degrees=True).as_matrix()
        turn = turn @ frame @ local @ frame.T
    return pos, turn


def test_a_leg_with_all_its_angles_is_where_the_matrices_put_it(tmp_path):
    values = {"lfemur": [-30.0, 12.0, 25.0], "ltibia": [40.0], "lfoot": [-10.0, 5.0]}
    root = [[1.0, 17.0, frame, 5.0, 30.0 + frame, -4.0] for frame in range(4)]
    read = read_motion(write(tmp_path, [values] * 4, root), "clip")
    assert (read.format, read.skeleton, read.unit, read.up_axis) == ("amc", "cmu_asf", "cmu", "y")
    for bone, body in (("lfemur", "left_hip"), ("ltibia", "left_knee"), ("lfoot", "left_ankle")):
        expected = np.array([chain(values, place, bone)[0] for place in root])[:, [2, 0, 1]] * UNIT
        np.testing.assert_allclose(read.clip.pos(body), expected, atol=1e-9, err_msg=bone)


def test_the_knee_bends_the_shank_back(tmp_path):
    straight = read_motion(write(tmp_path), "clip").clip
    bent = read_motion(write(tmp_path, [{"ltibia": [50.0]}] * 4), "clip").clip
    assert bent.pos("left_ankle")[0, 0] < straight.pos("left_ankle")[0, 0] - 0.2


def test_the_rate_of_cmu_is_assumed_and_noted_unless_stated(tmp_path):
    path = write(tmp_path)
    read = read_motion(path, "clip")
    assert (read.clip.fps, read.declared_fps) == (120.0, None)
    assert [note.code for note in read.notes] == ["assumed_rate"]
    stated = read_motion(path, "clip", Statement(fps=60.0))
    assert (stated.clip.fps, stated.notes) == (60.0, ())


def test_another_persons_skeleton_is_noted_as_a_rejection_and_the_clip_is_there(tmp_path):
    read = read_motion(write(tmp_path, stem="07_01", asf="12.asf"), "clip")
    mismatch = next(note for note in read.notes if note.code == "skeleton_mismatch")
    assert mismatch.effect == "rejected"
    assert "07_01.amc is of subject 07, 12.asf of subject 12" in mismatch.text
    assert read.clip.frame_count == 4
    assert [path.name for path in read.files] == ["07_01.amc", "12.asf"]


def test_the_skeleton_of_the_subject_is_chosen_among_several(tmp_path):
    (tmp_path / "12.asf").write_text("damaged")
    assert read_motion(write(tmp_path), "clip").files[1].name == "07.asf"


def test_a_stated_skeleton_goes_first(tmp_path):
    path = write(tmp_path, asf="person.asf")
    (tmp_path / "07.asf").write_text("damaged")
    assert read_motion(path, "clip", Statement(asf="person.asf")).files[1].name == "person.asf"
    with pytest.raises(FileError, match=r"the stated ASF 'nobody.asf' does not exist"):
        read_motion(path, "clip", Statement(asf="nobody.asf"))


def test_a_motion_without_its_skeleton_is_ambiguous(tmp_path):
    path = write(tmp_path)
    (tmp_path / "07.asf").rename(tmp_path / "a.asf")
    (tmp_path / "b.asf").write_text("other")
    with pytest.raises(AmbiguousFileError, match=r"needs its skeleton, an ASF file; beside it: a.asf, b.asf"):
        read_motion(path, "clip")


@pytest.mark.parametrize(
    ("old", "new", "match"),
    [
        ("ltibia 0.0\n", "", "frame 1 lacks: ltibia"),
        ("ltibia 0.0\n", "ltibia 0.0 1.0\n", "'ltibia' has 2 numbers, expected 1"),
        ("ltibia 0.0\n", "ltibia 0.0\nltibia 0.0\n", "once a frame"),
        ("ltibia 0.0\n", "ltail 0.0\n", "'ltail' does not move in the ASF"),
        ("ltibia 0.0\n", "ltibia nan\n", "ltibia is 'nan', expected a finite number"),
        ("\n2\n", "\n3\n", "frame 3 follows frame 1"),
        (":DEGREES", ":RADIANS", "radians are not supported"),
        ("\n1\n", "\n", "begins with its frame 1"),
    ],
)
def test_a_damaged_motion_is_refused_with_its_line(tmp_path, old, new, match):
    path = write(tmp_path)
    text = path.read_text()
    assert old in text
    path.write_text(text.replace(old, new, 1))
    with pytest.raises(FileError, match=match) as caught:
        read_motion(path, "clip")
    assert caught.value.line is not None


@pytest.mark.parametrize(
    ("old", "new", "match"),
    [
        ("lfemur ltibia\n", "lfemur\n", "bones that hang on nothing: lfoot, ltibia, ltoes"),
        ("ltibia lfoot\n", "ltibia lfoot lfemur\n", "'lfemur' has two parents"),
        ("root lhipjoint", "root ltail", "'ltail', which has no data"),
        ("order TX TY TZ RX RY RZ", "order TX TY TZ", "the root's order is 'TX TY TZ'"),
        ("axis 0 0 20 XYZ", "axis 0 0 20 XYY", "the axis order is 'xyy'"),
        ("length 7.4", "length inf", "length is 'inf'"),
        ("dof rx ry rz", "dof rx rx", "degrees of freedom 'rx rx'"),
        ("name rtibia", "name ltibia", "'ltibia' is there twice"),
        ("position 0 0 0", "position 0 1 0", "a root position other than zero"),
        (":bonedata", ":nodata", "the bone 'lhipjoint', which has no data"),
    ],
)
def test_a_damaged_skeleton_is_refused(tmp_path, old, new, match):
    path = write(tmp_path)
    text = (tmp_path / "07.asf").read_text()
    assert old in text
    (tmp_path / "07.asf").write_text(text.replace(old, new, 1))
    with pytest.raises(FileError, match=match):
        read_motion(path, "clip")
