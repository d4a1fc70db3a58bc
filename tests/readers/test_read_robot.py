"""Robot trajectories: columns found by name, quaternions wxyz, rates stated, derived or refused."""

import numpy as np
import pytest

from pipeline.errors import AmbiguousFileError, FileError
from pipeline.readers import Statement, read_motion
from pipeline.robot import Kinematics, load_robot

ROBOT = load_robot("t1")
HEADER = ["root_x", "root_y", "root_z", "quat_x", "quat_y", "quat_z", "quat_w", *ROBOT.joint_names]
FRAMES = 40


def truth():
    """Root positions, wxyz and joints in which every column is its own: walks along x, turned by .4 rad."""
    time = np.arange(FRAMES) / 50.0
    root = np.stack([0.8 * time, 0.1 * np.sin(time), 0.66 + 0.01 * np.cos(3 * time)], axis=1)
    quat = np.tile([np.cos(0.2), 0.0, 0.0, np.sin(0.2)], (FRAMES, 1))
    joints = ROBOT.default_joint_pos + 0.1 * np.sin(time[:, None] * 4 + np.arange(23))
    return root, quat, joints


def csv_rows(order="xyzw"):
    root, quat, joints = truth()
    return np.concatenate([root, quat[:, ["wxyz".index(letter) for letter in order]], joints], axis=1)


def write_csv(path, rows, header=None, comment=""):
    lines = [*([comment] if comment else []), *([",".join(header)] if header else [])]
    path.write_text("\n".join([*lines, *(",".join(repr(float(value)) for value in row) for row in rows)]) + "\n")
    return path


def assert_truth(clip, atol=1e-12):
    root, quat, joints = truth()
    assert (clip.robot, clip.joint_names) == ("t1", ROBOT.joint_names)
    np.testing.assert_allclose(clip.root_pos_w, root, atol=atol)
    np.testing.assert_allclose(clip.root_quat_w, quat, atol=atol)
    np.testing.assert_allclose(clip.joint_pos, joints, atol=atol)


def test_our_own_csv_is_read(tmp_path):
    read = read_motion(write_csv(tmp_path / "clip.csv", csv_rows(), HEADER, "# fps: 50"), "clip")
    assert (read.format, read.skeleton, read.clip.fps, read.declared_fps) == ("robot_csv", "t1", 50.0, 50.0)
    assert_truth(read.clip)


def test_joints_and_quaternion_are_found_by_name(tmp_path):
    pick = [0, 1, 2, 6, 3, 4, 5, *range(29, 6, -1)]
    path = write_csv(tmp_path / "clip.csv", csv_rows()[:, pick], [HEADER[index] for index in pick], "# fps: 50")
    assert_truth(read_motion(path, "clip").clip)


def test_a_column_of_times_states_the_rate(tmp_path):
    rows = np.concatenate([np.arange(FRAMES)[:, None] / 50.0, csv_rows()], axis=1)
    clip = read_motion(write_csv(tmp_path / "clip.csv", rows, ["time_s", *HEADER]), "clip").clip
    assert clip.fps == 50.0
    assert_truth(clip)


def test_a_csv_without_header_and_rate_is_ambiguous_until_the_rate_is_stated(tmp_path):
    path = write_csv(tmp_path / "clip.csv", csv_rows())
    with pytest.raises(AmbiguousFileError, match=r"State `fps:` for it in data/sources.yaml"):
        read_motion(path, "clip")
    clip = read_motion(path, "clip", Statement(fps=30.0)).clip
    assert clip.fps == 30.0
    assert_truth(clip)


@pytest.mark.parametrize(
    ("change", "match"),
    [
        (lambda rows, header: (rows[:, :29], header[:29]), "missing: Right_Ankle_Roll"),
        (lambda rows, header: (rows, [*header[:29], "Tail"]), "missing: Right_Ankle_Roll; extra: Tail"),
        (lambda rows, header: (rows, ["a", *header[1:]]), "the first seven columns are a, root_y"),
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
    ("row", "match"), [("1,2,3", "the row has 3 numbers, wanted 30"), (",".join(["x"] * 30), "not a number: 'x'")]
)
def test_a_damaged_row_is_refused_with_its_line(tmp_path, row, match):
    path = write_csv(tmp_path / "clip.csv", csv_rows(), HEADER, "# fps: 50")
    lines = path.read_text().split("\n")
    lines[5] = row
    path.write_text("\n".join(lines))
    with pytest.raises(FileError, match=match) as caught:
        read_motion(path, "clip")
    assert caught.value.line == 6


def npz(path, **change):
    """An mjlab archive with the world poses of all links."""
    root, quat, joints = truth()
    poses = Kinematics(ROBOT).forward(root, quat, joints)
    arrays = {
        "fps": np.array([50]),
        "joint_pos": joints,
        "joint_names": np.array(ROBOT.joint_names),
        "body_pos_w": poses.pos_w,
        "body_quat_w": poses.quat_w,
        "body_names": np.array(ROBOT.link_names),
    }
    np.savez(path, **{name: value for name, value in {**arrays, **change}.items() if value is not None})
    return path


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
    with pytest.raises(AmbiguousFileError, match="the joints' order can't be told"):
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
        ({"joint_names": None, "joint_pos": np.zeros((FRAMES, 12))}, FileError, "12 joints without names fit no robot"),
    ],
)
def test_an_archive_that_is_no_t1_is_refused(tmp_path, change, error, match):
    with pytest.raises(error, match=match):
        read_motion(npz(tmp_path / "clip.npz", **change), "clip")


def qpos_npz(path, fps, **extra):
    root, quat, joints = truth()
    qpos = np.concatenate([root, quat, joints], axis=1)
    qvel = np.gradient(np.delete(qpos, 6, axis=1), 1.0 / fps, axis=0)
    np.savez(path, qpos=qpos, qvel=qvel, **extra)
    return path


@pytest.mark.parametrize("fps", [25.0, 50.0, 100.0, 500.0])
def test_the_rate_of_a_qpos_archive_is_where_its_velocities_agree(tmp_path, fps):
    read = read_motion(qpos_npz(tmp_path / "clip.npz", fps), "clip")
    assert (read.format, read.clip.fps) == ("robot_qpos", fps)
    assert_truth(read.clip)


def test_a_qpos_archive_may_name_its_rate_and_its_free_joint(tmp_path):
    names = np.array(["root", *ROBOT.joint_names])
    clip = read_motion(qpos_npz(tmp_path / "clip.npz", 80.0, frequency=np.array(80.0), joint_names=names), "clip").clip
    assert clip.fps == 80.0
    assert_truth(clip)


def test_a_rate_that_the_velocities_do_not_tell_is_ambiguous(tmp_path):
    path = qpos_npz(tmp_path / "clip.npz", 77.0)
    with pytest.raises(AmbiguousFileError, match="does not say its frame rate"):
        read_motion(path, "clip")
