"""What reading an npz may raise where the file is damaged."""

import errno
import lzma
import zipfile
import zlib

DAMAGED_NPZ = (
    zipfile.BadZipFile,
    zlib.error,
    lzma.LZMAError,
    EOFError,
    OSError,
    ValueError,
    RuntimeError,
)
"""Of zipfile, the decompressors that it uses and NumPy, for archives that are broken, encrypted or packed in a way of
their own; none of them is a FileError."""

OF_THE_FILE = (None, errno.EINVAL)
"""Error numbers of an OSError that a damaged archive causes: bz2 states none, a seek to before the start is invalid."""


def raise_fault_of_disk(error: Exception) -> None:
    """Raise an error again if it comes from the disk or the system and not from the file: EIO, EACCES, EMFILE."""
    if isinstance(error, OSError) and error.errno not in OF_THE_FILE:
        raise error
