"""C3D files written by ezc3d: joints from Plug-in Gait's markers and bones, units, gaps, damage."""

import dataclasses

import numpy as np
import pytest

from pipeline import rotation
from pipeline.clips.human_clip import BODIES
from pipeline.errors import FileError
from pipeline.files import settings
from pipeline.readers import Statement, read_motion
from pipeline.repair import RepairSettings
from pipeline.repair.process import process as repair
from tests.factories.c3d_files import bones, markers, write_c3d

LIMBS = [body for body in BODIES if body.startswith(("left", "right"))]
Y_UP = np.array([[0.0, 1, 0], [0, 0, 1], [1, 0, 0]])
FRAMES = 120


@pytest.fixture(scope="module")
def walk(root):
    """Two seconds of the project's own walk, hands along their forearms."""
    clip = read_motion(root / "data/motions/walk.bvh", "walk").clip.cut(100, 100 + FRAMES, "walk")
    quat = clip.body_quat_w.copy()
    for side in ("left", "right"):
        quat[:, BODIES.index(f"{side}_wrist")] = clip.quat(f"{side}_elbow")
    return dataclasses.replace(clip, body_quat_w=quat)


def off(clip, walk, bodies=LIMBS):
    """Largest distance [m] of each body from where it is in the walk, without a change of heading or origin."""
    columns = [BODIES.index(body) for body in bodies]
    return np.linalg.norm(clip.body_pos_w[:, columns] - walk.body_pos_w[:, columns], axis=2).max(axis=0)


def turned(clip, walk, bodies):
    columns = [BODIES.index(body) for body in bodies]
    return np.rad2deg(rotation.angle_between(clip.body_quat_w[:, columns], walk.body_quat_w[:, columns])).max(axis=0)


@pytest.mark.parametrize(("kind", "unit"), [(markers, "mm"), (markers, "m"), (bones, "mm"), (bones, "cm")])
def test_joints_of_limbs_are_where_the_model_puts_them(tmp_path, walk, kind, unit):
    write_c3d(tmp_path / "walk.c3d", kind(walk), walk.fps, unit=unit, analog=3)
    found = read_motion(tmp_path / "walk.c3d", "clip")
    assert (found.format, found.skeleton, found.unit, found.up_axis) == ("c3d", "plug_in_gait", unit, "z")
    assert (found.clip.fps, found.clip.frame_count, found.notes) == (60.0, FRAMES, ())
    assert off(found.clip, walk).max() < 1e-3
    assert off(found.clip, walk, ["neck", "head"]).max() < 1e-3
    assert off(found.clip, walk, ["pelvis", "spine", "chest"]).max() < 0.08  # conventions of where the spine bends


@pytest.mark.parametrize("kind", [markers, bones])
def test_axes_of_the_segments_are_the_canonical_ones(tmp_path, walk, kind):
    write_c3d(tmp_path / "walk.c3d", kind(walk), walk.fps)
    clip = read_motion(tmp_path / "walk.c3d", "clip").clip
    assert turned(clip, walk, ["pelvis", "chest", "head"]).max() < 0.1
    assert turned(clip, walk, [f"{side}_{part}" for side in ("left", "right") for part in ("hip", "knee")]).max() < 1.0
    assert turned(clip, walk, ["left_ankle", "right_ankle", "left_wrist", "right_wrist"]).max() < 5.0
    assert turned(clip, walk, ["left_shoulder", "right_shoulder", "left_elbow", "right_elbow"]).max() < 12.0


def test_stretched_arms_and_legs_leave_no_joint_in_doubt(tmp_path, walk):
    pos, quat = walk.body_pos_w.copy(), walk.body_quat_w.copy()
    for side in ("left", "right"):
        for upper, middle, lower in (("hip", "knee", "ankle"), ("shoulder", "elbow", "wrist")):
            first, second, third = (BODIES.index(f"{side}_{part}") for part in (upper, middle, lower))
            bone = pos[:, second] - pos[:, first]
            moved = pos[:, second] + 0.9 * bone - pos[:, third]
            pos[:, third] += moved
            quat[:, second] = quat[:, first]
            if lower == "ankle":
                pos[:, BODIES.index(f"{side}_toe")] += moved
    straight = dataclasses.replace(walk, body_pos_w=pos, body_quat_w=quat)
    write_c3d(tmp_path / "straight.c3d", markers(straight), walk.fps)
    read = read_motion(tmp_path / "straight.c3d", "clip").clip
    joints = [f"{side}_{part}" for side in ("left", "right") for part in ("hip", "knee", "shoulder", "elbow", "wrist")]
    assert off(read, straight, joints).max() < 2e-3


@pytest.mark.parametrize(
    "change",
    [
        {"prefix": "Patient 3:"},
        {"further": 300},
        {"world": Y_UP},
        {"unit": "m", "declared": "mm"},
        {"declared": ""},
    ],
)
def test_names_axes_units_and_further_points_do_not_change_the_motion(tmp_path, walk, change):
    write_c3d(tmp_path / "walk.c3d", markers(walk), walk.fps, **change)
    found = read_motion(tmp_path / "walk.c3d", "clip")
    assert found.up_axis == ("y" if "world" in change else "z")
    assert [note.code for note in found.notes] == (["unit"] if change.get("declared") else [])
    assert off(found.clip, walk).max() < 1e-3


@pytest.mark.parametrize("left_out", [("LTHI", "RTHI", "LTIB", "RTIB"), ("LFIN", "RFIN"), ("LPSI", "RPSI")])
def test_markers_that_can_be_spared(tmp_path, walk, left_out):
    points = markers(walk)
    points["SACR"] = 0.5 * (points["LPSI"] + points["RPSI"])
    for name in left_out:
        del points[name]
    write_c3d(tmp_path / "walk.c3d", points, walk.fps)
    limit = 0.03 if "LTHI" in left_out else 1e-3  # without wands the knees are taken to face ahead
    assert off(read_motion(tmp_path / "walk.c3d", "clip").clip, walk).max() < limit


def test_a_gap_of_a_marker_is_missing_in_what_depends_on_it_and_filled_by_kp2(root, tmp_path, walk):
    points = markers(walk)
    points["LKNE"][40:46] = np.nan
    points["RWRA"][70:73] = 0.0  # as programs without residuals write a missing point
    write_c3d(tmp_path / "walk.c3d", points, walk.fps)
    clip = read_motion(tmp_path / "walk.c3d", "clip").clip
    missing = np.isnan(clip.body_pos_w).any(axis=2)
    assert set(np.flatnonzero(missing.any(axis=1))) == {*range(40, 46), *range(70, 73)}
    assert {BODIES[body] for body in np.flatnonzero(missing[40])} >= {"left_knee", "left_ankle"}
    assert {BODIES[body] for body in np.flatnonzero(missing[71])} <= {"right_elbow", "right_wrist", "right_shoulder"}
    values = settings.read(root / "data/repair.yaml", RepairSettings)
    outcome = repair(clip, {"start_frame": 0, "stop_frame": FRAMES}, settings=values)
    (piece,) = outcome.pieces
    assert piece.clip.frame_count == FRAMES and np.isfinite(piece.clip.body_pos_w).all()
    assert {reason.code for reason in outcome.reasons} >= {"missing"}


def test_a_marker_that_is_never_seen_is_named_by_what_it_leaves_out(tmp_path, walk):
    points = markers(walk)
    points["RANK"][:] = np.nan
    write_c3d(tmp_path / "walk.c3d", points, walk.fps)
    with pytest.raises(FileError, match="no frame has all points from which the right knee is worked out"):
        read_motion(tmp_path / "walk.c3d", "clip")


def test_other_marker_sets_are_refused_with_what_is_missing_and_what_to_do(tmp_path, walk):
    points = markers(walk)
    for name in ("LASI", "C7"):
        del points[name]
    write_c3d(tmp_path / "few.c3d", points, walk.fps)
    with pytest.raises(FileError, match=r"not those of Plug-in Gait \(CGM\): LASI, C7 are missing.*export BVH"):
        read_motion(tmp_path / "few.c3d", "clip")
    write_c3d(tmp_path / "none.c3d", {"Marker1": np.ones((5, 3)), "Marker2": np.ones((5, 3))}, 100.0)
    with pytest.raises(FileError, match=r"and \d+ more are missing; it holds Marker1, Marker2"):
        read_motion(tmp_path / "none.c3d", "clip")


def test_two_people_are_refused_and_one_beside_props_is_read(tmp_path, walk):
    one = {f"Ann:{name}": place for name, place in markers(walk).items()}
    other = {f"Bob:{name}": place + 1.0 for name, place in markers(walk).items()}
    write_c3d(tmp_path / "two.c3d", one | other, walk.fps)
    with pytest.raises(FileError, match=r"it holds 2 people \('Ann', 'Bob'\)"):
        read_motion(tmp_path / "two.c3d", "clip")
    write_c3d(tmp_path / "one.c3d", one | {"Ball:LASI": np.ones((FRAMES, 3))}, walk.fps)
    assert off(read_motion(tmp_path / "one.c3d", "clip").clip, walk).max() < 1e-3


def test_a_file_without_a_rate_is_refused(tmp_path, walk):
    path = tmp_path / "walk.c3d"
    write_c3d(path, markers(walk), 77.0)
    path.write_bytes(path.read_bytes().replace(np.float32(77.0).tobytes(), bytes(4)))
    with pytest.raises(FileError, match="POINT:RATE is 0 Hz"):
        read_motion(path, "clip")


def test_another_rate_can_be_stated(tmp_path, walk):
    write_c3d(tmp_path / "walk.c3d", markers(walk), 119.88)
    assert read_motion(tmp_path / "walk.c3d", "clip").clip.fps == pytest.approx(119.88)
    assert read_motion(tmp_path / "walk.c3d", "clip", Statement(fps=60.0)).clip.fps == 60.0


def test_a_file_that_was_cut_off_is_refused_as_one(tmp_path, walk):
    path = tmp_path / "walk.c3d"
    write_c3d(path, markers(walk), walk.fps)
    data = path.read_bytes()
    for end, says in ((400, "not a C3D file"), (len(data) // 2, "more than its bytes hold"), (0, "the file is empty")):
        path.write_bytes(data[:end])
        with pytest.raises(FileError, match=says):
            read_motion(path, "clip")
    path.write_bytes(b"HIERARCHY\n" * 200)
    with pytest.raises(FileError, match="not a C3D file"):
        read_motion(path, "clip")
