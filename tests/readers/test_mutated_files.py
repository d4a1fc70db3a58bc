"""Files with damage at random places end in a clip or in one sentence, never in another exception."""

import warnings

import numpy as np
import pytest

from pipeline.errors import FileError
from pipeline.readers import read_motion
from tests.factories import c3d_files
from tests.factories import motion_files as files

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
