"""Archives of `torch.save` and `torch.jit.save`: sizes and checksums are compared before torch reads them.

torch inflates whatever size is claimed, and does not compare the checksums of what it maps into memory.
"""

from __future__ import annotations

import zipfile
from pathlib import Path

from pipeline.errors import FileError
from pipeline.files.npz import DAMAGED_NPZ, NpzCaps, check_sizes, raise_fault_of_disk


def check_torch_archive(path: Path, caps: NpzCaps) -> tuple[str, ...]:
    """Names of an archive's members.

    Raises FileError for what is no zip archive (torch wrote others before 1.6; their pickles claim sizes for which
    torch takes memory before it reads), is damaged, or is too large when inflated; OSError for a fault of the disk.
    """
    size = path.stat().st_size
    if size > caps.total_bytes:
        raise FileError(path, f"has {size} bytes, more than the {caps.total_bytes} allowed.")
    try:
        with zipfile.ZipFile(path) as archive:
            members = archive.infolist()
            check_sizes(path, members, caps)
            damaged = archive.testzip()
    except DAMAGED_NPZ as error:
        raise_fault_of_disk(error)
        raise FileError(path, f"is no archive of torch that can be read ({str(error)[:120]}).") from error
    if damaged is not None:
        raise FileError(path, f"is damaged: '{damaged[:60]}' has another checksum than the archive states.")
    return tuple(info.filename for info in members)
