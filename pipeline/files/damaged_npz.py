"""What reading an npz may raise where the file is damaged."""

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
