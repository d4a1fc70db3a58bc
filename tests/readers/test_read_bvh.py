"""BVH against 4x4 matrices and scipy's Euler angles: any order, unit, axes and layout is the same motion."""

import subprocess
import sys
import time

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from pipeline.clips.human_clip import BODIES, body
from pipeline.readers import Statement, read_motion
from pipeline.readers.bvh import read_bvh
from tests.factories import motion_files as files

Y_UP_TO_Z_UP = np.array([[0.0, 0, 1], [1, 0, 0], [0, 1, 0]])
KEEP_X_Z_UP = np.array([[1.0, 0, 0], [0, 0, -1], [0, 1, 0]])
X_UP = np.array([[0.0, 1, 0], [0, 0, 1], [1, 0, 0]]).T @ Y_UP_TO_Z_UP
ORDERS = ("XYZ", "XZY", "YXZ", "YZX", "ZXY", "ZYX")

BODY_OF_JOINT = {
    "Hips": "pelvis",
    "Spine": "spine",
    "Chest": "chest",
    "Neck": "neck",
    "Head": "head",
    **{
        f"{side}{joint}": f"{side.lower()}_{part}"
        for side in ("Left", "Right")
        for joint, part in (
            ("UpLeg", "hip"),
            ("Leg", "knee"),
            ("Foot", "ankle"),
            ("Toe", "toe"),
            ("Arm", "shoulder"),
            ("ForeArm", "elbow"),
            ("Hand", "wrist"),
        )
    },
}


def write(folder, poses, style=None, name="clip.bvh"):
    path = folder / name
    path.write_bytes(files.bvh(poses, style or files.BvhStyle()).encode())
    return path


def test_positions_and_orientations_are_those_of_chained_matrices(tmp_path):
    poses = files.upright(12, seed=3)
    motion = read_bvh(write(tmp_path, poses, files.BvhStyle(orders=ORDERS, metres_per_unit=1.0)))
    pos, turn = files.world(poses)
    order = [files.NAMES.index(name) for name in motion.joint_names]
    np.testing.assert_allclose(motion.joint_pos_w, pos[:, order], atol=1e-7)
    found = Rotation.from_quat(np.roll(motion.joint_quat_w.reshape(-1, 4), -1, axis=1)).as_matrix()
    np.testing.assert_allclose(found.reshape(turn.shape), turn[:, order], atol=1e-7)


def test_canonical_positions_are_the_joints_in_metres_with_z_up(tmp_path):
    poses = files.upright(12, seed=4)
    clip = read_motion(write(tmp_path, poses), "clip").clip
    pos, _ = files.world(poses)
    for joint, name in BODY_OF_JOINT.items():
        expected = pos[:, files.NAMES.index(joint)] @ Y_UP_TO_Z_UP.T
        np.testing.assert_allclose(clip.pos(name), expected, atol=1e-6, err_msg=name)


def test_an_upright_figure_has_identity_everywhere_but_in_its_stretched_arms(tmp_path):
    clip = read_motion(write(tmp_path, files.upright(5)), "clip").clip
    arms = [name for name in BODIES if name.endswith(("shoulder", "elbow", "wrist"))]
    for name in BODIES:
        forward, left, up = Rotation.from_quat(np.roll(clip.quat(name)[0], -1)).as_matrix().T
        expected = np.eye(3)
        if name in arms:  # arms out to the sides: the limb, canonical -z, points to its side
            side = 1.0 if name.startswith("left") else -1.0
            expected = np.array([[1.0, 0, 0], [0, 0, side], [0, -side, 0]])
        np.testing.assert_allclose([forward, left, up], expected, atol=1e-6, err_msg=name)


@settings(max_examples=25, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(
    orders=st.permutations(ORDERS).map(tuple),
    position_order=st.permutations("XYZ").map("".join),
    all_positions=st.booleans(),
    metres_per_unit=st.sampled_from([1.0, 0.01, 0.001, 0.0254, 0.0254 / 0.45]),
    axes=st.sampled_from(["y", "world z", "world x", "frames z", "frames z, other x"]),
    layout=st.sampled_from([("\n", "", "  "), ("\r\n", "", "\t"), ("\r", "\ufeff", " ")]),
)
def test_the_way_a_file_is_written_does_not_change_the_clip(
    tmp_path, orders, position_order, all_positions, metres_per_unit, axes, layout
):
    poses = files.upright(6, seed=9)
    truth = read_motion(write(tmp_path, poses, name="plain.bvh"), "clip").clip
    turns = {
        "y": {},
        "world z": {"root_turn": Y_UP_TO_Z_UP},
        "world x": {"root_turn": X_UP},
        "frames z": {"frame_turn": Y_UP_TO_Z_UP},
        "frames z, other x": {"frame_turn": KEEP_X_Z_UP},
    }[axes]
    style = files.BvhStyle(
        orders=orders,
        position_order=position_order,
        all_positions=all_positions,
        metres_per_unit=metres_per_unit,
        line_end=layout[0],
        start=layout[1],
        indent=layout[2],
        **turns,
    )
    read = read_motion(write(tmp_path, poses, style, name="other.bvh"), "clip")
    assert read.up_axis == {"y": "y", "world x": "x"}.get(axes, "z")
    assert read.metres_per_unit == pytest.approx(metres_per_unit)
    expected = truth.body_pos_w
    if axes == "frames z, other x":  # its z-up world looks along -y
        expected = expected @ Rotation.from_euler("z", -90, degrees=True).as_matrix().T
    np.testing.assert_allclose(read.clip.body_pos_w, expected, atol=1e-6)
    if axes != "frames z, other x":
        dots = np.abs(np.sum(read.clip.body_quat_w * truth.body_quat_w, axis=-1))
        np.testing.assert_allclose(dots, 1.0, atol=1e-9)


def test_offsets_stay_where_a_joint_has_only_some_position_channels(tmp_path):
    text = files.bvh(files.upright(3), files.BvhStyle(metres_per_unit=1.0))
    text = text.replace("CHANNELS 6 Xposition Yposition Zposition", "CHANNELS 4 Yposition", 1)
    head, rows = text.split("Frame Time")
    values = [line.split() for line in rows.split("\n")[1:] if line]
    rows = [" ".join([row[1], *row[3:]]) for row in values]
    path = tmp_path / "clip.bvh"
    path.write_text(head + "Frame Time" + text.split("Frame Time")[1].split("\n")[0] + "\n" + "\n".join(rows) + "\n")
    motion = read_bvh(path)
    np.testing.assert_allclose(motion.joint_pos_w[:, 0], [[0.0, 0.95, 0.0]] * 3, atol=1e-9)


def test_samples_that_are_no_numbers_become_missing(tmp_path):
    path = write(tmp_path, files.upright(6, seed=1))
    lines = path.read_text().split("\n")
    lines[-4] = " ".join(["nan"] * len(lines[-4].split()))
    path.write_text("\n".join(lines))
    clip = read_motion(path, "clip").clip
    missing = ~np.isfinite(clip.body_pos_w).all(axis=(1, 2))
    assert missing.tolist() == [False, False, False, True, False, False]
    assert np.isfinite(clip.body_quat_w[[0, 1, 2, 4, 5]]).all()


@pytest.mark.parametrize(
    ("printed", "fps"),
    [
        ("0.033333", 30.0),
        ("0.016667", 60.0),
        ("0.0083333", 120.0),
        ("0.03", 30.0),
        ("0.033", 30.0),
        ("0.017", 60.0),
        ("0.0167", 60.0),
        ("0.0083", 120.0),
        ("0.020", 50.0),
        ("0.05", 20.0),
    ],
)
def test_a_rounded_frame_time_is_the_rate_that_was_meant(tmp_path, printed, fps):
    path = write(tmp_path, files.upright(3))
    path.write_text(path.read_text().replace("Frame Time: 0.0166667", f"Frame Time: {printed}"))
    read = read_motion(path, "clip")
    assert (read.clip.fps, read.notes) == (fps, ())


@pytest.mark.parametrize(
    ("printed", "fps", "choice"),
    [("0.02", 50.0, "50 Hz and 60 Hz"), ("0.04", 25.0, "24 Hz and 25 Hz"), ("0.008", 125.0, "120 Hz and 125 Hz")],
)
def test_a_frame_time_that_several_rates_are_printed_as_is_noted(tmp_path, printed, fps, choice):
    path = write(tmp_path, files.upright(3))
    path.write_text(path.read_text().replace("Frame Time: 0.0166667", f"Frame Time: {printed}"))
    read = read_motion(path, "clip")
    (note,) = read.notes
    assert (read.clip.fps, note.code, note.effect) == (fps, "rounded_rate", "noted")
    assert choice in note.text
    assert read_motion(path, "clip", Statement(fps=60.0)).clip.fps == 60.0


def test_a_rate_of_television_is_not_rounded(tmp_path):
    clip = read_motion(write(tmp_path, files.upright(3), files.BvhStyle(fps=30000 / 1001)), "clip").clip
    assert clip.fps == pytest.approx(29.97, abs=1e-3)


def test_reading_keeps_up_with_20000_frames_a_second(tmp_path):
    path = write(tmp_path, files.upright(4000, seed=2))
    _seconds(path)
    best = min(_seconds(path) for _ in range(3))
    assert best < 4000 / 20_000


def _seconds(path):
    start = time.process_time()
    assert read_bvh(path).joint_pos_w.shape == (4000, 21, 3)
    return time.process_time() - start


def test_bodies_of_the_clip_are_sign_continuous(tmp_path):
    clip = read_motion(write(tmp_path, files.upright(30, seed=5)), "clip").clip
    assert (np.sum(clip.body_quat_w[1:] * clip.body_quat_w[:-1], axis=-1) > 0).all()
    assert np.linalg.norm(clip.body_quat_w[:, body("pelvis")], axis=-1) == pytest.approx(1.0)


MEASURE = """
import re, sys
from pathlib import Path
from pipeline.readers import read_motion
read_motion(Path(sys.argv[1]), "small")
clip = read_motion(Path(sys.argv[2]), "large").clip
print(clip.frame_count, 1024 * int(re.search(r"VmHWM:\\s+(\\d+)", Path("/proc/self/status").read_text())[1]))
"""
"""Prints the peak of this process alone: `ru_maxrss` begins with that of the process that started it."""


def test_a_file_of_s_bytes_takes_less_than_200_mb_and_four_s(tmp_path, root):
    """Forty megabytes of rows in a process of its own; what Python and the libraries take is in the 200 MB."""
    small = write(tmp_path, files.upright(60, seed=6), name="small.bvh")
    head, rows = small.read_text().split("MOTION\n")
    _, frame_time, *lines = rows.splitlines()
    lines = [" ".join(f"{float(value):.2f}" for value in line.split()) for line in lines]
    times = 40_000_000 // sum(len(line) + 1 for line in lines)
    large = tmp_path / "large.bvh"
    with large.open("w") as stream:
        stream.write(f"{head}MOTION\nFrames: {times * len(lines)}\n{frame_time}\n")
        for _ in range(times):
            stream.write("\n".join(lines) + "\n")
    command = [sys.executable, "-c", MEASURE, str(small), str(large)]
    out = subprocess.run(command, capture_output=True, text=True, check=True, cwd=root)
    count, peak = map(int, out.stdout.split())
    assert count == times * len(lines)
    assert peak < 200e6 + 4 * large.stat().st_size
