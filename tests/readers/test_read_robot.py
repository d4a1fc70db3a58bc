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
            {"joint_names": None, "joint_pos": np.zeros((FRAMES, 12))},
            FileError,
            "another robot: a frame has 12 joints without names",
        ),
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


def walking(heading, frames=120, speed=0.8):
    """A robot that steps in place of its own accord while its root travels ahead: the lower foot stands still."""
    kinematics, time = Kinematics(ROBOT), np.arange(frames) / 50.0
    joints = np.tile(ROBOT.default_joint_pos, (frames, 1))
    swing = 0.4 * np.sin(2 * np.pi * 0.9 * time)
    for side, sign in (("Left", 1.0), ("Right", -1.0)):
        joints[:, ROBOT.joint(f"{side}_Hip_Pitch")] += sign * swing
        lift = np.clip(-sign * np.cos(2 * np.pi * 0.9 * time), 0.0, None)
        joints[:, ROBOT.joint(f"{side}_Knee_Pitch")] += 0.5 * lift
        joints[:, ROBOT.joint(f"{side}_Ankle_Pitch")] -= sign * swing + 0.5 * lift
    upright = np.tile([1.0, 0.0, 0.0, 0.0], (frames, 1))
    poses = kinematics.forward(np.zeros((frames, 3)), upright, joints)
    soles = kinematics.site_pos_w(poses, ROBOT.feet)
    root = np.zeros((frames, 3))
    root[:, 2] = -soles[..., 2].min(axis=1)
    for frame in range(1, frames):
        lower = int(soles[frame, :, 2].argmin())
        root[frame, :2] = root[frame - 1, :2] - (soles[frame, lower, :2] - soles[frame - 1, lower, :2])
    turn = np.array([np.cos(heading / 2), 0.0, 0.0, np.sin(heading / 2)])
    rotate = np.array([[np.cos(heading), -np.sin(heading)], [np.sin(heading), np.cos(heading)]])
    root[:, :2] = root[:, :2] @ rotate.T
    return root, np.tile(turn, (frames, 1)), joints


@pytest.mark.parametrize("heading_deg", range(-180, 181, 30))
@pytest.mark.parametrize("order", ["wxyz", "xyzw"])
def test_the_order_of_a_quaternion_is_inferred_at_every_heading(tmp_path, order, heading_deg):
    root, quat, joints = walking(np.deg2rad(heading_deg))
    columns = quat[:, ["wxyz".index(letter) for letter in order]]
    path = write_csv(tmp_path / "clip.csv", np.concatenate([root, columns, joints], axis=1), comment="# fps: 50")
    read = read_motion(path, "clip")
    np.testing.assert_allclose(np.abs(np.sum(read.clip.root_quat_w * quat, axis=1)), 1.0, atol=1e-9)
    assert [note.code for note in read.notes] == ([] if order == "xyzw" else ["quaternion_order"])


@pytest.mark.parametrize("heading_deg", range(-180, 181, 60))
@pytest.mark.parametrize("order", ["wxyz", "xyzw"])
@pytest.mark.parametrize("archive", ["qpos", "joint_pos"])
def test_the_order_in_an_archive_without_bodies_is_inferred_too(tmp_path, archive, order, heading_deg):
    root, quat, joints = walking(np.deg2rad(heading_deg))
    columns = quat[:, ["wxyz".index(letter) for letter in order]]
    rows = np.concatenate([root, columns, joints], axis=1)
    names = np.array(ROBOT.joint_names)
    np.savez(tmp_path / "clip.npz", **{archive: rows}, frequency=np.array(50.0), fps=np.array(50.0), joint_names=names)
    read = read_motion(tmp_path / "clip.npz", "clip")
    np.testing.assert_allclose(np.abs(np.sum(read.clip.root_quat_w * quat, axis=1)), 1.0, atol=1e-9)
    assert [note.code for note in read.notes] == ([] if order == "wxyz" else ["quaternion_order"])


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


def test_a_robot_that_stands_is_the_same_motion_under_both_orders_and_needs_no_statement(tmp_path):
    rows = np.tile(np.concatenate([[0, 0, 0.66], [0, 0, 0, 1.0], ROBOT.default_joint_pos]), (20, 1))
    path = write_csv(tmp_path / "clip.csv", rows, comment="# fps: 50")
    np.testing.assert_array_equal(read_motion(path, "clip").clip.root_quat_w[0], [1.0, 0, 0, 0])
    stated = read_motion(path, "clip", Statement(quaternion="wxyz")).clip
    np.testing.assert_array_equal(np.abs(stated.root_quat_w[0]), [0, 0, 0, 1.0])
    with pytest.raises(FileError, match="the stated order of the quaternion is 'zyx', wanted wxyz or xyzw"):
        read_motion(path, "clip", Statement(quaternion="zyx"))


def test_soles_that_slide_with_both_orders_make_the_file_ambiguous(tmp_path):
    root, quat, joints = walking(0.0)
    root[:, 1] += 1.5 * np.arange(len(root)) / 50.0
    rows = np.concatenate([root, np.roll(quat, -1, axis=1), joints], axis=1)
    path = write_csv(tmp_path / "clip.csv", rows, comment="# fps: 50")
    with pytest.raises(
        AmbiguousFileError, match=r"order of the root's quaternion can't be inferred.*State `quaternion:"
    ):
        read_motion(path, "clip")
    assert read_motion(path, "clip", Statement(quaternion="xyzw")).clip.frame_count == len(root)


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


BREADTH_FIRST = [
    *("AAHead_yaw", "Left_Shoulder_Pitch", "Right_Shoulder_Pitch", "Waist", "Head_pitch", "Left_Shoulder_Roll"),
    *("Right_Shoulder_Roll", "Left_Hip_Pitch", "Right_Hip_Pitch", "Left_Elbow_Pitch", "Right_Elbow_Pitch"),
    *("Left_Hip_Roll", "Right_Hip_Roll", "Left_Elbow_Yaw", "Right_Elbow_Yaw", "Left_Hip_Yaw", "Right_Hip_Yaw"),
    *("Left_Knee_Pitch", "Right_Knee_Pitch", "Left_Ankle_Pitch", "Right_Ankle_Pitch", "Left_Ankle_Roll"),
    "Right_Ankle_Roll",
]
"""As Isaac Lab wrote an archive of the T1."""


@pytest.mark.parametrize("order", ["wxyz", "xyzw"])
def test_breadth_first_joints_without_names_are_inferred_from_the_bodies(tmp_path, order):
    joints = truth()[2][:, [ROBOT.joint(name) for name in BREADTH_FIRST]]
    quat = Kinematics(ROBOT).forward(*truth()).quat_w[..., ["wxyz".index(letter) for letter in order]]
    path = npz(tmp_path / "clip.npz", joint_names=None, body_names=None, joint_pos=joints, body_quat_w=quat)
    read = read_motion(path, "clip")
    assert_truth(read.clip)
    expected = ["joint_order"] if order == "wxyz" else ["joint_order", "quaternion_order"]
    assert [(note.code, note.effect) for note in read.notes] == [(code, "noted") for code in expected]


def amp_robot(path, **change):
    poses = Kinematics(ROBOT).forward(*truth())
    arrays = {
        "fps": np.array(50),
        "dof_names": np.array(ROBOT.joint_names)[::-1],
        "dof_positions": truth()[2][:, ::-1],
        "dof_velocities": np.gradient(truth()[2][:, ::-1], 0.02, axis=0),
        "body_names": np.array(ROBOT.link_names),
        "body_positions": poses.pos_w,
        "body_rotations": poses.quat_w,
        "body_linear_velocities": np.gradient(poses.pos_w, 0.02, axis=0),
        "body_angular_velocities": np.zeros_like(poses.pos_w),
    }
    np.savez(path, **{**arrays, **change})
    return path


def test_an_amp_archive_of_the_robot_is_read_by_its_names(tmp_path):
    read = read_motion(amp_robot(tmp_path / "clip.npz"), "clip")
    assert (read.format, read.clip.fps, read.notes) == ("robot_amp", 50.0, ())
    assert_truth(read.clip)


def test_joint_velocities_correct_the_rate_where_those_of_the_links_say_nothing(tmp_path):
    nothing = np.zeros_like(Kinematics(ROBOT).forward(*truth()).pos_w)
    path = amp_robot(tmp_path / "clip.npz", fps=np.array(25), body_linear_velocities=nothing)
    read = read_motion(path, "clip")
    assert read.clip.fps == 50.0 and [note.code for note in read.notes] == ["time_base"]


def test_an_amp_archive_of_another_robot_says_so(tmp_path):
    names = np.array([f"left_{number}" for number in range(23)])
    with pytest.raises(FileError, match="it is of another robot"):
        read_motion(amp_robot(tmp_path / "clip.npz", dof_names=names), "clip")


@pytest.mark.parametrize("factor", [0.5, 2.0, 0.6])
@pytest.mark.parametrize("kind", ["amp", "qpos", "whole body"])
def test_a_rate_that_the_files_own_velocities_contradict_is_corrected_and_named(tmp_path, kind, factor):
    declared = 50.0 * factor
    if kind == "amp":
        path = amp_robot(tmp_path / "clip.npz", fps=np.array(declared))
    elif kind == "qpos":
        path = qpos_npz(tmp_path / "clip.npz", 50.0, frequency=np.array(declared))
    else:
        velocity = np.gradient(truth()[2], 0.02, axis=0)
        path = npz(tmp_path / "clip.npz", fps=np.array([declared]), joint_vel=velocity)
    read = read_motion(path, "clip")
    assert (read.clip.fps, read.declared_fps) == (50.0, declared)
    (note,) = read.notes
    assert (note.code, note.effect) == ("time_base", "repaired")
    assert f"says {declared:g} Hz" in note.text and "50 Hz is taken" in note.text
    stated = read_motion(path, "clip", Statement(fps=declared))
    assert (stated.clip.fps, stated.notes[0].effect) == (declared, "noted")


@pytest.mark.parametrize("noise", [0.0, 0.02])
def test_a_rate_that_the_velocities_agree_with_is_kept_silently(tmp_path, noise):
    velocity = np.gradient(truth()[2], 0.02, axis=0)
    velocity += noise * np.random.default_rng(1).normal(size=velocity.shape)
    read = read_motion(npz(tmp_path / "clip.npz", joint_vel=velocity), "clip")
    assert (read.clip.fps, read.notes) == (50.0, ())


@pytest.mark.parametrize("lost", ["qpos", "qvel"])
def test_velocities_of_another_length_than_the_positions_are_refused(tmp_path, lost):
    path = qpos_npz(tmp_path / "clip.npz", 50.0)
    with np.load(path) as whole:
        arrays = dict(whole)
    np.savez(path, **{**arrays, lost: arrays[lost][1:]})
    with pytest.raises(FileError, match=r"'qvel' has \d+ rows and 'qpos' has \d+\. Frames were lost"):
        read_motion(path, "clip")


def test_a_comment_whose_rate_is_not_that_of_the_times_is_refused(tmp_path):
    rows = np.concatenate([np.arange(FRAMES)[:, None] / 50.0, csv_rows()], axis=1)
    header = ["time_s", *HEADER]
    assert read_motion(write_csv(tmp_path / "a.csv", rows, header, "# fps: 50"), "clip").clip.fps == 50.0
    with pytest.raises(FileError, match=r"its comment states 30 Hz, and its times 'time_s' are 50 Hz apart"):
        read_motion(write_csv(tmp_path / "b.csv", rows, header, "# fps: 30"), "clip")


def test_a_huge_number_is_missing_as_infinity_is(tmp_path):
    rows = csv_rows()
    rows[5, 9], rows[6, 9] = -1e308, np.inf
    clip = read_motion(write_csv(tmp_path / "clip.csv", rows, HEADER, "# fps: 50"), "clip").clip
    assert np.flatnonzero(np.isnan(clip.joint_pos).any(axis=1)).tolist() == [5, 6]
