"""Files with damage at random places end in a clip or in one sentence, never in another exception."""

import warnings

import numpy as np
import pytest

from pipeline.errors import FileError
from pipeline.hardware_logs import write_mcap
from pipeline.readers import read_motion
from tests.factories import c3d_files, robot_files
from tests.factories import motion_files as files
from tests.factories.mcap_writer import FASTWRITE
from tests.factories.robot_logs import robot_log
from tests.readers.test_read_npz_humans import amp_npz

MUTATIONS = 150


def seeds(folder):
    (folder / "07.asf").write_text(files.asf())
    (folder / "robot.csv").write_text(
        "# fps: 50\n" + "\n".join(",".join(["0.1"] * 3 + ["0.0"] * 3 + ["1.0"] + ["0.1"] * 23) for _ in range(5))
    )
    (folder / "bvh.bvh").write_text(files.bvh(files.upright(4, seed=1)))
    (folder / "07_01.amc").write_text(files.amc([{}] * 3, [[0.0, 17.0, 0.0, 0.0, 0.0, 0.0]] * 3))
    files.write_deepmimic(folder / "text.txt", files.deepmimic(5))
    files.smpl_npz(folder / "smpl.npz", frames=4)
    (folder / "whole.bvh").write_text(files.bvh(files.upright(4, seed=1)))
    person = read_motion(folder / "whole.bvh", "clip").clip
    c3d_files.write_c3d(folder / "markers.c3d", c3d_files.markers(person), 100.0, analog=2)
    names = ("bvh.bvh", "07_01.amc", "text.txt", "robot.csv", "smpl.npz", "markers.c3d")
    return {name: folder / name for name in names}


ARCHIVES = {
    "smpl": lambda path: files.smpl_npz(path, frames=12),
    "isaac_amp": amp_npz,
    "robot_amp": robot_files.amp_robot,
    "robot_npz": robot_files.npz,
    "robot_qpos": lambda path: robot_files.qpos_npz(path, 50.0, frequency=np.array(50.0)),
    "robot_gmr": lambda path: robot_files.gmr_npz(path),
}
"""Format -> writer of an archive of it."""


def mutated(data: bytes, random: np.random.Generator) -> bytes:
    """Bytes changed, a stretch left out, doubled, or the end cut off."""
    start, length = int(random.integers(len(data))), int(random.integers(1, 40))
    kind = random.integers(5)
    if kind == 0:
        return data[:start]
    if kind == 1:
        return data[:start] + data[start + length :]
    if kind == 2:
        return data[: start + length] + data[start:]
    if kind == 3:
        return data[:start] + random.bytes(length) + data[start + length :]
    return (
        data[:start] + random.choice([b"nan", b"1e999", b"-", b"{", b"}", b",", b"\n", b"\0", b"9" * 30]) + data[start:]
    )


@pytest.mark.parametrize("name", ["bvh.bvh", "07_01.amc", "07.asf", "text.txt", "robot.csv", "smpl.npz", "markers.c3d"])
def test_a_mutated_file_is_read_or_refused_in_a_sentence(tmp_path, name):
    """Of archives (`ARCHIVES`) the check sums find nearly all of it: their arrays are mutated below."""
    paths = seeds(tmp_path)
    changed = tmp_path / name
    read = paths.get(name, paths["07_01.amc"])
    data, random, refused = changed.read_bytes(), np.random.default_rng(7), 0
    for _ in range(MUTATIONS):
        changed.write_bytes(mutated(data, random))
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore", RuntimeWarning)
                clip = read_motion(read, "clip").clip
            assert clip.frame_count >= 2
        except FileError as error:
            refused += 1
            assert len(str(error)) < 2_000
    assert 0.3 * MUTATIONS < refused < MUTATIONS


@pytest.mark.filterwarnings("ignore::RuntimeWarning")
def test_a_mutated_log_gives_what_is_whole_of_it_or_is_refused_in_a_sentence(tmp_path):
    path, random, refused = tmp_path / "log.mcap", np.random.default_rng(7), 0
    write_mcap(path, robot_log(robot_files.ROBOT), FASTWRITE)
    data, whole = path.read_bytes(), read_motion(path, "clip").clip.frame_count
    for _ in range(MUTATIONS // 3):
        path.write_bytes(mutated(data, random))
        try:
            clip = read_motion(path, "clip").clip
            assert 2 <= clip.frame_count <= whole + 1
            assert np.isfinite(clip.joint_pos).all() and np.isfinite(clip.root_quat_w).all()
        except FileError as error:
            refused += 1
            assert len(str(error)) < 2_000
    assert refused < MUTATIONS // 3


def mutated_arrays(arrays: dict[str, np.ndarray], random: np.random.Generator) -> dict[str, np.ndarray]:
    """An array left out, renamed, cut, doubled, turned, of another type, or with other values or names in it."""
    name = str(random.choice(sorted(arrays)))
    value, rest = arrays[name], {key: each for key, each in arrays.items() if key != name}
    kind = random.integers(9)
    if kind == 0:
        return rest
    if kind == 1:
        return {**rest, f"{name}_2": value}
    if value.ndim == 0 or kind == 2:
        odd = [np.array(np.nan), np.array(-1.0), np.array(1e300), np.array("50"), np.zeros((3, 0)), np.array(b"x")]
        return {**rest, name: odd[random.integers(len(odd))]}
    if kind == 3:
        return {**rest, name: value[: random.integers(len(value))]}
    if kind == 4:
        return {**rest, name: np.concatenate([value, value])}
    if kind == 5:
        return {**rest, name: value.T}
    changed = value.copy()
    place = random.integers(len(changed))
    if value.dtype.kind == "U":
        changed[place] = random.choice(["", "x", str(changed[place - 1]), "<b>", "a" * 300])
        return {**rest, name: changed}
    if kind == 6:
        return {**rest, name: value.astype(random.choice(["i1", "U8", "c8", "f2", "?"]))}
    if kind == 7:
        changed = changed.astype(float)
        changed[place:] = random.choice([np.nan, np.inf, -1e30, 1e3])
        return {**rest, name: changed}
    axis = int(random.integers(value.ndim))
    return {**rest, name: random.permutation(value, axis=axis)}


@pytest.mark.parametrize("name", ARCHIVES)
@pytest.mark.filterwarnings("ignore::RuntimeWarning")
def test_an_archive_of_mutated_arrays_is_read_or_refused_in_a_sentence(tmp_path, name):
    path, random, refused = tmp_path / "clip.npz", np.random.default_rng(11), 0
    ARCHIVES[name](path)
    assert read_motion(path, "clip").clip.frame_count >= 12
    with np.load(path) as whole:
        arrays = dict(whole)
    for _ in range(MUTATIONS):
        np.savez(path, **mutated_arrays(arrays, random))
        try:
            clip = read_motion(path, "clip").clip
            assert clip.frame_count >= 2
        except FileError as error:
            refused += 1
            assert str(path) in str(error) and len(str(error)) < 2_000
    assert 0.3 * MUTATIONS < refused < MUTATIONS
