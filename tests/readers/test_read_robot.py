"""Robot trajectories as CSV and archives: columns and joints found by name; other robots and damage refused."""

import dataclasses

import numpy as np
import pytest

from pipeline.errors import AmbiguousFileError, FileError
from pipeline.readers import read_motion, robot_motion, robot_npz
from tests.factories.robot_files import FRAMES, HEADER, ROBOT, amp_robot, assert_truth, csv_rows, npz, truth, write_csv


def test_our_own_csv_is_read(tmp_path):
    read = read_motion(write_csv(tmp_path / "clip.csv", csv_rows(), HEADER, "# fps: 50"), "clip")
    assert (read.format, read.skeleton, read.clip.fps, read.declared_fps) == ("robot_csv", "t1", 50.0, 50.0)
    assert_truth(read.clip)


def test_joints_and_quaternion_are_found_by_name(tmp_path):
    pick = [0, 1, 2, 6, 3, 4, 5, *range(29, 6, -1)]
    path = write_csv(tmp_path / "clip.csv", csv_rows()[:, pick], [HEADER[index] for index in pick], "# fps: 50")
    assert_truth(read_motion(path, "clip").clip)


def test_the_columns_of_the_root_may_be_anywhere(tmp_path):
    pick = [12, 6, 2, 29, 0, *range(7, 12), 5, *range(13, 29), 4, 3, 1]
    path = write_csv(tmp_path / "clip.csv", csv_rows()[:, pick], [HEADER[index] for index in pick], "# fps: 50")
    assert_truth(read_motion(path, "clip").clip)


@pytest.mark.parametrize(
    "root",
    ["root_x root_y root_z qx qy qz qw", "X Y Z rot.x rot.y rot.z rot.w", "pos_x pos_y root_z quat_x quat_y quat_z qw"],
)
def test_other_names_of_the_root_are_known_by_their_last_letters(tmp_path, root):
    path = write_csv(tmp_path / "clip.csv", csv_rows(), [*root.split(), *HEADER[7:]], "# fps: 50")
    assert_truth(read_motion(path, "clip").clip)


@pytest.mark.parametrize("header", [HEADER[:3], ["a", *HEADER[1:]]])
def test_a_fault_of_the_header_has_the_line_of_the_header(tmp_path, header):
    path = write_csv(tmp_path / "clip.csv", csv_rows(), header, "# fps: 50\n\n# made by hand\n# today\n")
    with pytest.raises(FileError) as caught:
        read_motion(path, "clip")
    assert caught.value.line == 6


@pytest.mark.parametrize(
    ("change", "match"),
    [
        (lambda rows, header: (rows[:, :29], header[:29]), "missing: Right_Ankle_Roll"),
        (lambda rows, header: (rows, [*header[:29], "Tail"]), "missing: Right_Ankle_Roll; extra: Tail"),
        (lambda rows, header: (rows, ["a", *header[1:]]), r"clip\.csv, line 2: the header has no column root_x\."),
        (
            lambda rows, header: (np.delete(rows, 6, axis=1), [*header[:6], *header[7:]]),
            r"the header has no column quat_w\.",
        ),
        (
            lambda rows, header: (np.delete(rows, 3, axis=1), ["x", "y", "z", "qy", "qz", "qw", *header[7:]]),
            "no column quat_w",
        ),
        (
            lambda rows, header: (np.c_[rows, rows[:, 8]], [*header, header[8]]),
            r"line 2: the header has the column 'Head_pitch' twice",
        ),
        (
            lambda rows, header: (np.c_[rows, rows[:, 0], rows[:, 0]], [*header, "time_s", "time_s"]),
            "the header has the column 'time_s' twice",
        ),
        (lambda rows, header: (rows[:0], header), "no frames"),
        (lambda rows, header: (rows[:1], header), "1 frame"),
        (lambda rows, header: (rows * np.r_[np.ones(7), np.full(23, 57.3)], header), "Convert degrees to radians"),
        (lambda rows, header: (rows * np.r_[np.ones(3), np.full(4, 1.1), np.ones(23)], header), "has norm 1.1"),
    ],
)
def test_a_csv_that_is_no_t1_is_refused(tmp_path, change, match):
    rows, header = change(csv_rows(), HEADER)
    with pytest.raises(FileError, match=match):
        read_motion(write_csv(tmp_path / "clip.csv", rows, header, "# fps: 50"), "clip")


def test_a_csv_with_wxyz_under_names_of_xyzw_lies_on_its_side_and_is_refused(tmp_path):
    rows = csv_rows()
    rows[:, 3:7] = [np.cos(0.7), 0.0, 0.0, np.sin(0.7)]
    with pytest.raises(FileError, match=r"the trunk is tilted by \d+ degrees .* The quaternion's order"):
        read_motion(write_csv(tmp_path / "clip.csv", rows, HEADER, "# fps: 50"), "clip")


@pytest.mark.parametrize(
    ("row", "match"), [("1,2,3", "the row has 3 numbers, expected 30"), (",".join(["x"] * 30), "not a number: 'x'")]
)
def test_a_damaged_row_is_refused_with_its_line(tmp_path, row, match):
    path = write_csv(tmp_path / "clip.csv", csv_rows(), HEADER, "# fps: 50")
    lines = path.read_text().split("\n")
    lines[5] = row
    path.write_text("\n".join(lines))
    with pytest.raises(FileError, match=match) as caught:
        read_motion(path, "clip")
    assert caught.value.line == 6


def test_an_mjlab_archive_is_read_with_the_root_among_its_bodies(tmp_path):
    read = read_motion(npz(tmp_path / "clip.npz"), "clip")
    assert (read.format, read.clip.fps) == ("robot_npz", 50.0)
    assert_truth(read.clip)


def test_the_root_may_stand_before_the_joints(tmp_path):
    root, quat, joints = truth()
    path = npz(tmp_path / "clip.npz", joint_pos=np.concatenate([root, quat, joints], axis=1), body_pos_w=None)
    assert_truth(read_motion(path, "clip").clip)


def test_joints_without_names_are_read_when_the_bodies_prove_their_order(tmp_path):
    assert_truth(read_motion(npz(tmp_path / "clip.npz", joint_names=None, body_names=None), "clip").clip)


def test_joints_whose_order_nothing_proves_are_ambiguous(tmp_path):
    root, quat, joints = truth()
    rows = np.concatenate([root, quat, joints], axis=1)
    path = npz(tmp_path / "clip.npz", joint_pos=rows, joint_names=None, body_pos_w=None)
    with pytest.raises(AmbiguousFileError, match="the joints' order can't be inferred"):
        read_motion(path, "clip")


def test_joints_in_another_order_than_their_bodies_show_are_refused(tmp_path):
    path = npz(tmp_path / "clip.npz", joint_names=None, joint_pos=truth()[2][:, ::-1])
    with pytest.raises(FileError, match=r"would be 0\.\d+ m from any body of the file"):
        read_motion(path, "clip")


@pytest.mark.parametrize(
    ("change", "error", "match"),
    [
        ({"fps": None}, AmbiguousFileError, "does not say its frame rate"),
        ({"body_pos_w": None}, FileError, "there is no root"),
        ({"body_names": np.array(["thing"] * 24)}, FileError, "no body is a robot's root link"),
        ({"joint_names": np.arange(23)}, FileError, "'joint_names' is not a list of names"),
        (
            {"joint_pos": np.zeros((FRAMES, 24)), "joint_names": np.array([*ROBOT.joint_names, ROBOT.joint_names[3]])},
            FileError,
            f"joint '{ROBOT.joint_names[3]}' of t1 is named twice",
        ),
        ({"joint_pos": np.zeros((FRAMES, 24))}, FileError, "it names 23 joints, and a frame has 24"),
        (
            {"joint_names": None, "joint_pos": np.zeros((FRAMES, 12))},
            FileError,
            "another robot: a frame has 12 joints without names",
        ),
    ],
)
def test_an_archive_that_is_no_t1_is_refused(tmp_path, change, error, match):
    with pytest.raises(error, match=match):
        read_motion(npz(tmp_path / "clip.npz", **change), "clip")


def test_joints_of_another_robot_are_not_taken_for_a_root_before_those_of_the_k1(tmp_path):
    """29 columns are a G1's joints, or seven of a root and the K1's 22; the number of bodies decides."""
    frames, bodies = 40, 30
    path = tmp_path / "g1.npz"
    upright = np.tile([1.0, 0.0, 0.0, 0.0], (frames, bodies, 1))
    np.savez(
        path, joint_pos=np.zeros((frames, 29)), body_pos_w=np.ones((frames, bodies, 3)), body_quat_w=upright, fps=50.0
    )
    with pytest.raises(FileError, match="it is of another robot: a frame has 29 joints"):
        read_motion(path, "clip")


@pytest.mark.parametrize(("joints", "named"), [(29, False), (21, False), (29, True), (12, True)])
def test_a_file_of_another_robot_says_so_first(tmp_path, joints, named):
    names = [f"joint_{number}" for number in range(joints)]
    header = [*HEADER[:7], *names] if named else None
    path = write_csv(tmp_path / "clip.csv", np.full((9, 7 + joints), 0.1), header)
    with pytest.raises(
        FileError, match=r"clip.csv: it is of another robot: .*the robots here are k1 \(22\), t1 \(23\)"
    ):
        read_motion(path, "clip")
    arrays = {"joint_pos": np.zeros((9, joints)), "joint_names": np.array(names), "body_pos_w": np.zeros((9, 3, 3))}
    np.savez(tmp_path / "clip.npz", **arrays, body_names=np.array(["pelvis", "a", "b"]))
    with pytest.raises(FileError, match="it is of another robot"):
        read_motion(tmp_path / "clip.npz", "clip")


def test_a_file_states_which_of_two_robots_with_the_same_joints_it_is_of(tmp_path, monkeypatch):
    """A variant of a robot, with other links: the first one's were taken."""
    monkeypatch.setattr(robot_motion, "robots", lambda: (ROBOT, dataclasses.replace(ROBOT, name="t1_tall")))
    for name in ("t1", "t1_tall"):
        path = write_csv(tmp_path / "clip.csv", csv_rows(), HEADER, f"# fps: 50\n# robot: {name}")
        assert read_motion(path, "clip").clip.robot == name
    for header in (HEADER, None):
        with pytest.raises(AmbiguousFileError, match=r"fit several robots: t1, t1_tall\."):
            read_motion(write_csv(tmp_path / "clip.csv", csv_rows(), header, "# fps: 50"), "clip")


def test_the_root_among_bodies_is_that_of_the_robot_with_these_joints(tmp_path, monkeypatch):
    """Another robot's root link may have the name of a link here, such as `torso_link` of the Unitree G1."""
    names = tuple(f"other_{joint}" for joint in ROBOT.joint_names)
    tree = dataclasses.replace(ROBOT.tree, link_names=("Waist", *(f"other_{link}" for link in ROBOT.link_names[1:])))
    other = dataclasses.replace(ROBOT, name="a1", tree=tree, joint_names=names, controlled=names, namings={})
    for module in (robot_motion, robot_npz):
        monkeypatch.setattr(module, "robots", lambda: (other, ROBOT))
    assert_truth(read_motion(npz(tmp_path / "clip.npz"), "clip").clip)
    assert_truth(read_motion(amp_robot(tmp_path / "amp.npz"), "clip").clip)


def test_an_amp_archive_of_the_robot_is_read_by_its_names(tmp_path):
    read = read_motion(amp_robot(tmp_path / "clip.npz"), "clip")
    assert (read.format, read.clip.fps, read.notes) == ("robot_amp", 50.0, ())
    assert_truth(read.clip)


def test_an_amp_archive_of_another_robot_says_so(tmp_path):
    names = np.array([f"left_{number}" for number in range(23)])
    with pytest.raises(FileError, match="it is of another robot"):
        read_motion(amp_robot(tmp_path / "clip.npz", dof_names=names), "clip")


def test_a_huge_number_is_missing_as_infinity_is(tmp_path):
    rows = csv_rows()
    rows[5, 9], rows[6, 9] = -1e308, np.inf
    clip = read_motion(write_csv(tmp_path / "clip.csv", rows, HEADER, "# fps: 50"), "clip").clip
    assert np.flatnonzero(np.isnan(clip.joint_pos).any(axis=1)).tolist() == [5, 6]
