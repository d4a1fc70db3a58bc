"""Archives from strangers: no objects, no bombs, no shapes that lie."""

import io
import zipfile

import numpy as np
import pytest

from pipeline.errors import FileError
from pipeline.files.npz import read_npz_header
from pipeline.readers import read_motion


def member(shape, dtype="<f8", data=b""):
    header = io.BytesIO()
    np.lib.format.write_array_header_1_0(header, {"descr": dtype, "fortran_order": False, "shape": shape})
    return header.getvalue() + data


def archive(path, **members):
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as stream:
        for name, data in members.items():
            stream.writestr(f"{name}.npy", data)
    return path


def test_object_arrays_are_known_but_never_loaded(tmp_path):
    path = tmp_path / "clip.npz"
    np.savez(path, qpos=np.zeros((3, 30)), metadata=np.array([{"a": 1}], dtype=object))
    header = read_npz_header(path)
    assert header.objects == ("metadata",)
    assert header.has("qpos")
    with pytest.raises(FileError, match="'metadata' is an array of Python objects, which is never loaded"):
        header.array("metadata")


def test_a_shape_larger_than_its_data_is_refused_before_memory_is_taken(tmp_path):
    path = archive(tmp_path / "clip.npz", poses=member((1 << 38,), data=b"\0" * 64))
    with pytest.raises(FileError, match="'poses' claims shape"):
        read_npz_header(path)


def test_a_bomb_is_refused_before_it_inflates(tmp_path):
    path = archive(tmp_path / "clip.npz", poses=member((20_000_000,), data=bytes(160_000_000 // 16)))
    with pytest.raises(FileError, match=r"'poses.npy' inflates from \d+ to \d+ bytes, not allowed"):
        read_npz_header(path)


def test_archives_that_inflate_beyond_the_total_are_refused(tmp_path):
    path = tmp_path / "clip.npz"
    np.savez(path, a=np.zeros(1000), b=np.zeros(1000))
    with pytest.raises(FileError, match=r"the archive inflates to \d+ bytes, more than the 10000 allowed"):
        read_npz_header(path, most_bytes=10_000)


def test_crowds_of_members_are_refused(tmp_path):
    path = archive(tmp_path / "clip.npz", **{f"m{number}": member((0,)) for number in range(1_100)})
    with pytest.raises(FileError, match="1100 members"):
        read_npz_header(path)


@pytest.mark.parametrize("content", [b"PK\x03\x04 not a zip", b"hello", b"\x93NUMPY\x01\x00"])
def test_what_is_no_archive_is_refused(tmp_path, content):
    path = tmp_path / "clip.npz"
    path.write_bytes(content)
    with pytest.raises(FileError, match="not a NumPy archive"):
        read_npz_header(path)


def test_an_empty_or_missing_archive_is_refused(tmp_path):
    (tmp_path / "clip.npz").touch()
    with pytest.raises(FileError, match="the file is empty"):
        read_npz_header(tmp_path / "clip.npz")
    with pytest.raises(FileError, match="does not exist"):
        read_npz_header(tmp_path / "none.npz")


def test_damaged_data_is_refused(tmp_path):
    path = tmp_path / "clip.npz"
    np.savez(path, poses=np.random.default_rng(0).random((50, 72)), trans=np.zeros((50, 3)))
    data = bytearray(path.read_bytes())
    data[len(data) // 3] ^= 0xFF
    path.write_bytes(bytes(data))
    with pytest.raises(FileError, match="'poses' can't be read: Bad CRC-32"):
        read_motion(path, "clip")


def test_an_archive_of_something_else_is_refused_with_what_it_holds(tmp_path):
    np.savez(tmp_path / "clip.npz", images=np.zeros((2, 4)))
    with pytest.raises(FileError, match=r"no known motion: it holds images; known are poses .*and trans"):
        read_motion(tmp_path / "clip.npz", "clip")
