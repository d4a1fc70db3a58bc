"""SMPL and Isaac Lab archives against poses worked out by hand."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from pipeline import rotation
from pipeline.errors import AmbiguousFileError, FileError
from pipeline.readers import Statement, read_motion
from pipeline.readers.isaac_amp import PARENTS
from pipeline.readers.smpl import JOINTS, MEAN_STATURE, mean_skeleton
from pipeline.readers.smpl import PARENTS as SMPL_PARENTS
from tests.factories import motion_files as files


def smpl_pose(turns, frames=4, columns=72):
    """Poses (t, columns) that stand and look along +x, with rotation vectors [rad] for some joints."""
    poses = np.zeros((frames, columns))
    upright = Rotation.from_matrix([[0.0, 0, 1], [1, 0, 0], [0, 1, 0]])
    poses[:, :3] = upright.as_rotvec()
    for joint, rotvec in turns.items():
        index = JOINTS.index(joint)
        poses[:, 3 * index : 3 * index + 3] = rotvec
    return poses


def test_the_mean_skeleton_has_the_published_segment_lengths():
    rest = dict(zip(JOINTS, mean_skeleton(), strict=True))
    published = {"left_knee": 0.245, "left_ankle": 0.246, "left_elbow": 0.186, "left_wrist": 0.146}
    for joint, share in published.items():
        assert np.linalg.norm(rest[joint]) == pytest.approx(share * MEAN_STATURE, abs=1e-9)
    pelvis_to_shoulder = sum(rest[joint][1] for joint in ("spine1", "spine2", "spine3", "left_collar", "left_shoulder"))
    hip_to_shoulder = pelvis_to_shoulder - rest["left_hip"][1]
    assert hip_to_shoulder == pytest.approx((0.818 - 0.530) * MEAN_STATURE, abs=1e-3)
    half_breadth = sum(rest[joint][0] for joint in ("left_collar", "left_shoulder")) / MEAN_STATURE
    assert half_breadth == pytest.approx(0.129, abs=0.02)


@pytest.mark.parametrize("columns", [72, 156, 165])
def test_a_bent_knee_swings_the_ankle_back(tmp_path, columns):
    angle = 0.7
    path = files.smpl_npz(tmp_path / "clip.npz", poses=smpl_pose({"left_knee": [angle, 0, 0]}, columns=columns))
    read = read_motion(path, "clip")
    clip, shank = read.clip, 0.246 * MEAN_STATURE
    assert (read.format, read.skeleton, read.unit, read.up_axis, clip.fps) == ("smpl", "smpl", "m", "z", 30.0)
    expected = clip.pos("left_knee")[0] + [-shank * np.sin(angle), 0.0, -shank * np.cos(angle)]
    np.testing.assert_allclose(clip.pos("left_ankle")[0], expected, atol=1e-9)
    np.testing.assert_allclose(clip.quat("left_knee")[0], [np.cos(angle / 2), 0, np.sin(angle / 2), 0], atol=1e-9)


def swinging(frames=12):
    """Poses (t, 66) in which every joint of the body turns in its own way."""
    poses, time = smpl_pose({}, frames, 66), np.linspace(0.0, 1.0, frames)[:, None]
    poses[:, 3:] = 0.3 * np.sin(4.0 * time + np.arange(63))
    return poses


def laid_out(layout, poses):
    """The arrays of a program for poses (t, 66); what it adds (hands, face) is noise that is not read."""
    noise = np.random.default_rng(3).normal(size=(len(poses), 99))
    root, body = poses[:, :3], poses[:, 3:]
    if layout.startswith("poses "):
        return {"poses": np.hstack([poses, noise])[:, : int(layout.removeprefix("poses "))]}
    if layout == "joints":
        return {"poses": np.hstack([poses, noise])[:, :72].reshape(-1, 24, 3)}
    if layout == "pose_aa joints":
        return {"pose_aa": poses.reshape(-1, 22, 3).astype("f4")}
    names = {"split": ("root_orient", "pose_body"), "long": ("global_orient", "body_pose")}[layout.split()[0]]
    arrays = {names[0]: root, names[1]: np.hstack([body, noise])[:, : int(layout.split()[1])]}
    hands = {"pose_hand": noise[:, :90], "pose_jaw": noise[:, :3], "pose_eye": noise[:, :6]}
    return {**arrays, **hands} if layout == "split 63" else arrays


@pytest.mark.parametrize(
    "layout",
    [
        *("poses 66", "poses 72", "poses 156", "poses 165", "joints", "pose_aa joints"),
        *("split 63", "split 69", "split 153", "split 162", "long 63", "long 69"),
    ],
)
@pytest.mark.parametrize("rate", ["mocap_framerate", "mocap_frame_rate", "fps"])
def test_one_motion_is_the_same_under_every_layout_of_its_columns(tmp_path, layout, rate):
    poses, trans = swinging(), np.stack([0.02 * np.arange(12), np.zeros(12), np.full(12, 0.9)], axis=1)
    np.savez(tmp_path / "truth.npz", poses=poses, trans=trans, mocap_framerate=120.0)
    move = "transl" if layout.startswith("long") else "trans"
    np.savez(tmp_path / "clip.npz", **laid_out(layout, poses), **{move: trans, rate: 120, "gender": "neutral"})
    truth, read = (read_motion(tmp_path / f"{name}.npz", "clip") for name in ("truth", "clip"))
    assert (read.format, read.clip.fps) == ("smpl", 120.0)
    np.testing.assert_allclose(read.clip.body_pos_w, truth.clip.body_pos_w, atol=1e-6)
    np.testing.assert_allclose(read.clip.body_quat_w, truth.clip.body_quat_w, atol=1e-6)


@pytest.mark.parametrize("lost", ["root_orient", "pose_body"])
def test_a_split_pose_of_which_a_part_is_missing_or_of_another_length_is_refused(tmp_path, lost):
    arrays = {**laid_out("split 63", swinging()), "trans": np.zeros((12, 3)), "fps": 30.0}
    np.savez(tmp_path / "clip.npz", **{name: value for name, value in arrays.items() if name != lost})
    with pytest.raises(FileError, match="no known motion"):
        read_motion(tmp_path / "clip.npz", "clip")
    np.savez(tmp_path / "clip.npz", **{**arrays, lost: arrays[lost][:-1]})
    with pytest.raises(FileError, match="expected the same frames"):
        read_motion(tmp_path / "clip.npz", "clip")


def test_the_root_is_where_trans_says(tmp_path):
    clip = read_motion(files.smpl_npz(tmp_path / "clip.npz"), "clip").clip
    np.testing.assert_allclose(clip.pos("pelvis")[:, 1], -0.02 * np.arange(20), atol=1e-9)


def test_the_shape_needs_a_body_model_and_without_one_it_is_noted(tmp_path):
    read = read_motion(files.smpl_npz(tmp_path / "clip.npz"), "clip")
    assert [(note.code, note.effect) for note in read.notes] == [("mean_skeleton", "noted")]


def body_model(path, scale=1.0, **arrays):
    """A model whose vertices are its joints, so that the regressor is the identity."""
    offsets, joints = mean_skeleton() * scale, np.zeros((24, 3))
    for index, name in enumerate(JOINTS):
        parent = SMPL_PARENTS[name]
        joints[index] = offsets[index] + (joints[JOINTS.index(parent)] if parent else 0.0)
    joints += [0.0, -0.2, 0.0]
    shapes = np.zeros((24, 3, 10))
    shapes[:, :, 0] = 0.1 * (joints - joints[0])
    np.savez(path, **{"v_template": joints, "J_regressor": np.eye(24), "shapedirs": shapes, **arrays})
    return path


def test_an_own_body_model_takes_the_shape_of_the_file(tmp_path):
    model = body_model(tmp_path / "model.npz", scale=1.1)
    path = files.smpl_npz(tmp_path / "clip.npz", poses=smpl_pose({}), betas=np.array([2.0]))
    read = read_motion(path, "clip", Statement(body_model=str(model)))
    thigh = np.linalg.norm(read.clip.pos("left_knee")[0] - read.clip.pos("left_hip")[0])
    assert thigh == pytest.approx(0.245 * MEAN_STATURE * 1.1 * 1.2, abs=1e-9)
    assert read.files == (path, model)
    assert read.notes == ()


def test_a_body_model_without_joints_is_refused(tmp_path):
    np.savez(tmp_path / "model.npz", weights=np.zeros(3))
    with pytest.raises(FileError, match="a body model needs J_template"):
        read_motion(files.smpl_npz(tmp_path / "clip.npz"), "clip", Statement(body_model=str(tmp_path / "model.npz")))


def test_a_body_model_of_joints_alone_is_read(tmp_path):
    model = body_model(tmp_path / "full.npz")
    joints = np.load(model)["v_template"]
    np.savez(tmp_path / "model.npz", J_template=joints)
    path = files.smpl_npz(tmp_path / "clip.npz", poses=smpl_pose({}))
    clip = read_motion(path, "clip", Statement(body_model=str(tmp_path / "model.npz"))).clip
    assert clip.pos("pelvis")[0, 1] - clip.pos("left_hip")[0, 1] == pytest.approx(-0.05 * MEAN_STATURE, abs=1e-9)


@pytest.mark.parametrize(
    ("change", "match"),
    [
        ({"poses": np.zeros((20, 70))}, "expected the same frames and 66, 72, 156 or 165 columns"),
        ({"trans": np.zeros((19, 3))}, "expected the same frames"),
        ({"trans": np.zeros((20, 2))}, "'trans' is of float64 with shape 20×2, expected n×3 numbers"),
        ({"poses": np.full((20, 72), "a")}, "'poses' is of <U1"),
        ({"mocap_framerate": np.nan}, "'mocap_framerate' is not one finite number"),
    ],
)
def test_a_damaged_smpl_archive_is_refused(tmp_path, change, match):
    path = files.smpl_npz(tmp_path / "clip.npz")
    with np.load(path) as archive:
        arrays = dict(archive)
    np.savez(path, **{**arrays, **change})
    with pytest.raises(FileError, match=match):
        read_motion(path, "clip")


def test_an_archive_without_a_rate_is_ambiguous(tmp_path):
    path = files.smpl_npz(tmp_path / "clip.npz", mocap_framerate=None)
    with pytest.raises(AmbiguousFileError, match=r"does not say its frame rate. State `fps:`"):
        read_motion(path, "clip")
    assert read_motion(path, "clip", Statement(fps=120.0)).clip.fps == 120.0


AMP_OFFSETS = {
    "torso": (0, 0, 0.236),
    "head": (0, 0, 0.224),
    "right_upper_arm": (-0.02, -0.183, 0.243),
    "right_lower_arm": (0, 0, -0.275),
    "right_hand": (0, 0, -0.259),
    "left_upper_arm": (-0.02, 0.183, 0.243),
    "left_lower_arm": (0, 0, -0.275),
    "left_hand": (0, 0, -0.259),
    "right_thigh": (0, -0.085, 0),
    "right_shin": (0, 0, -0.42),
    "right_foot": (0, 0, -0.41),
    "left_thigh": (0, 0.085, 0),
    "left_shin": (0, 0, -0.42),
    "left_foot": (0, 0, -0.41),
}


def amp_npz(path, frames=12, yaw=0.6, order="wxyz", reverse=False, **change):
    """The AMP figure, upright, turned by `yaw`, its left knee bending more and more; bodies in any order."""
    names = list(PARENTS)
    pos, quat = np.zeros((frames, len(names), 3)), np.zeros((frames, len(names), 4))
    for frame in range(frames):
        turns = {"pelvis": Rotation.from_euler("z", yaw)}
        for index, name in enumerate(names):
            parent = PARENTS[name]
            if parent is None:
                pos[frame, index] = [0.02 * frame, 0, 0.9]
            else:
                bend = Rotation.from_euler("y", 0.05 * frame if name == "left_shin" else 0.0)
                turns[name] = turns[parent] * bend
                pos[frame, index] = pos[frame, names.index(parent)] + turns[parent].apply(AMP_OFFSETS[name])
            quat[frame, index] = np.roll(turns[name].as_quat(), 1 if order == "wxyz" else 0)
    pick = slice(None, None, -1) if reverse else slice(None)
    arrays = {"body_names": np.array(names)[pick], "body_positions": pos[:, pick], "body_rotations": quat[:, pick]}
    np.savez(path, **{**arrays, "fps": 60, **change})
    return path


@pytest.mark.parametrize("reverse", [False, True])
def test_isaac_lab_bodies_are_found_by_name_and_the_toe_hangs_on_the_foot(tmp_path, reverse):
    read = read_motion(amp_npz(tmp_path / "clip.npz", reverse=reverse), "clip")
    clip = read.clip
    assert (read.format, clip.fps, read.unit, read.up_axis) == ("isaac_amp", 60.0, "m", "z")
    np.testing.assert_allclose(
        clip.pos("left_hip")[0] - clip.pos("right_hip")[0], Rotation.from_euler("z", 0.6).apply([0, 0.17, 0]), atol=1e-9
    )
    bend = rotation.multiply(rotation.conjugate(clip.quat("left_hip")), clip.quat("left_knee"))
    np.testing.assert_allclose(rotation.to_rotvec(bend)[:, 1], 0.05 * np.arange(12), atol=1e-9)
    toe = clip.pos("right_toe")[0] - clip.pos("right_ankle")[0]
    assert np.arctan2(toe[1], toe[0]) == pytest.approx(0.6, abs=1e-6)
    assert 0.08 < np.linalg.norm(toe[:2]) < 0.15


def test_isaac_lab_quaternions_in_another_order_are_refused(tmp_path):
    with pytest.raises(FileError, match=r"which is no bone. Are the quaternions wxyz\?"):
        read_motion(amp_npz(tmp_path / "clip.npz", order="xyzw"), "clip")


def test_isaac_lab_quaternions_that_are_not_unit_are_refused(tmp_path):
    path = amp_npz(tmp_path / "clip.npz", body_rotations=np.full((12, 15, 4), 0.6))
    with pytest.raises(FileError, match=r"quaternion at frame 0 has norm 1.2, expected 0.99 to 1.01"):
        read_motion(path, "clip")


def test_isaac_lab_bodies_that_are_missing_are_named(tmp_path):
    names = np.array([name.replace("left_foot", "left_paw") for name in PARENTS])
    with pytest.raises(FileError, match="bodies are missing: left_foot"):
        read_motion(amp_npz(tmp_path / "clip.npz", body_names=names), "clip")
