"""One motion of the T1 as the robot files that others write: CSV, mjlab and MuJoCo archives, Isaac Lab AMP."""

import numpy as np

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


def csv_rows():
    root, quat, joints = truth()
    return np.concatenate([root, quat[:, [1, 2, 3, 0]], joints], axis=1)


def write_csv(path, rows, header=None, comment=""):
    lines = [*([comment] if comment else []), *([",".join(header)] if header else [])]
    path.write_text("\n".join([*lines, *(",".join(repr(float(value)) for value in row) for row in rows)]) + "\n")
    return path


def assert_truth(clip):
    root, quat, joints = truth()
    assert (clip.robot, clip.joint_names) == ("t1", ROBOT.joint_names)
    np.testing.assert_allclose(clip.root_pos_w, root, atol=1e-12)
    np.testing.assert_allclose(clip.root_quat_w, quat, atol=1e-12)
    np.testing.assert_allclose(clip.joint_pos, joints, atol=1e-12)


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


def qpos_npz(path, fps, **extra):
    root, quat, joints = truth()
    qpos = np.concatenate([root, quat, joints], axis=1)
    qvel = np.gradient(np.delete(qpos, 6, axis=1), 1.0 / fps, axis=0)
    np.savez(path, qpos=qpos, qvel=qvel, **extra)
    return path


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


def gmr_npz(path, **change):
    """GMR's arrays in an archive, root xyzw."""
    root, quat, joints = truth()
    arrays = {
        "fps": np.array(50.0),
        "root_pos": root,
        "root_rot": np.roll(quat, -1, axis=1),
        "dof_pos": joints,
        "dof_names": np.array(ROBOT.joint_names),
    }
    np.savez(path, **{**arrays, **change})
    return path
