"""Archives with damaged compression are refused with their file by all that read npz."""

import io
import zipfile

import numpy as np
import pytest

from pipeline.deployment import load_policy
from pipeline.errors import FileError
from pipeline.export.parity import read_golden
from pipeline.files.npz import read_npz_header


@pytest.mark.parametrize("method", [zipfile.ZIP_DEFLATED, zipfile.ZIP_BZIP2, zipfile.ZIP_LZMA])
@pytest.mark.parametrize("share", [0.0, 0.01, 0.5])
@pytest.mark.parametrize("read", [lambda path: read_npz_header(path).array("gyro_b"), load_policy, read_golden])
def test_damaged_compression_is_refused_with_the_file(tmp_path, method, share, read):
    stream, path = io.BytesIO(), tmp_path / "walk.npz"
    np.save(stream, np.random.default_rng(0).normal(size=3000))
    with zipfile.ZipFile(path, "w", method) as archive:
        archive.writestr("gyro_b.npy", stream.getvalue())
        begin, size = 30 + len("gyro_b.npy"), archive.infolist()[0].compress_size
    data = bytearray(path.read_bytes())
    at = begin + int(share * size)
    data[at : at + 16] = b"\xff" * 16
    path.write_bytes(bytes(data))
    with pytest.raises(FileError, match=r"walk\.npz"):
        read(path)
