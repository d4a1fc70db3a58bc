"""Restricted reader of untrusted pickles: only NumPy arrays, tensors and plain containers are created.

A pickle is a program that calls named functions. Here, names are looked up in a short list of placeholder classes that
only hold data; any other name raises an error. Files of `pickle.dump`, of joblib (arrays in the stream, zlib or
not) and of `torch.save` are read without joblib and without torch.
"""

import pickle
import re
import shlex
import struct
import zipfile
import zlib
from collections import OrderedDict
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from io import BytesIO
from pathlib import Path
from typing import Any, ClassVar

import numpy as np

from pipeline.errors import FileError
from pipeline.files import page_memory
from pipeline.files.npz import check_sizes, reported_damage
from pipeline.readers.text_file import MAX_BYTES, check_size

MAX_RATIO = 20
"""Largest compression ratio of a pickle."""

_DTYPE = re.compile(r"[<>|=]?(b1|[iu][1248]|f[248]|U\d{1,4})")
_TORCH_TYPES = {
    "DoubleStorage": "<f8",
    "FloatStorage": "<f4",
    "HalfStorage": "<f2",
    "LongStorage": "<i8",
    "IntStorage": "<i4",
    "ShortStorage": "<i2",
    "CharStorage": "i1",
    "ByteStorage": "u1",
    "BoolStorage": "?",
}


class NotAllowedError(Exception):
    """Raised for a pickle that contains anything but plain data."""


@dataclass
class PickledType:
    """Placeholder for a `numpy.dtype`."""

    code: str
    order: str = "<"

    def __setstate__(self, state: tuple) -> None:
        self.order = state[1] if state[1] in ("<", ">", "|", "=") else "<"

    @property
    def dtype(self) -> np.dtype:
        """The dtype. Raises NotAllowedError for object and structured types."""
        if not _DTYPE.fullmatch(self.code):
            raise NotAllowedError(f"arrays of type '{self.code[:20]}'")
        return np.dtype(self.code if self.code[0] in "<>|=" else f"{self.order}{self.code}")


class PickledArray:
    """Placeholder for a NumPy array; `value` is set when it is filled."""

    value: np.ndarray | None = None

    def __setstate__(self, state: Any) -> None:
        _, shape, kind, fortran, raw = state
        if isinstance(raw, list):
            return  # object arrays stay empty
        data = raw.encode("latin-1") if isinstance(raw, str) else bytes(raw)
        self.value = _filled(data, kind, shape, "F" if fortran else "C")


class JoblibArray:
    """Placeholder for joblib's `NumpyArrayWrapper`, followed by the array's bytes in the stream."""

    shape: tuple = ()
    order: str = "C"
    dtype: Any = None
    numpy_array_alignment_bytes: int | None = None

    def __setstate__(self, state: dict) -> None:
        for name in ("shape", "order", "dtype", "numpy_array_alignment_bytes"):
            setattr(self, name, state.get(name, getattr(self, name)))

    def read(self, stream: BytesIO) -> np.ndarray:
        """The array."""
        if self.numpy_array_alignment_bytes is not None:
            stream.read(stream.read(1)[0])
        count = int(np.prod([int(length) for length in self.shape], dtype=object)) * self.dtype.dtype.itemsize
        if count < 0:
            raise EOFError("it was cut off")
        return _filled(stream.read(count), self.dtype, self.shape, self.order)


def _filled(data: bytes, kind: PickledType, shape: tuple, order: str) -> np.ndarray:
    array = page_memory.empty((len(data) // kind.dtype.itemsize,), kind.dtype)
    array[:] = np.frombuffer(data, dtype=kind.dtype)
    return array.reshape(tuple(int(length) for length in shape), order="F" if order == "F" else "C")


def _scalar(kind: PickledType, raw: bytes | bytearray | str) -> Any:
    data = raw.encode("latin-1") if isinstance(raw, str) else raw
    return np.frombuffer(data, dtype=kind.dtype)[0].item()


def _from_buffer(raw: bytes | bytearray, kind: PickledType, shape: tuple, order: str) -> PickledArray:
    array = PickledArray()
    array.value = _filled(bytes(raw), kind, shape, order)
    return array


def _encoded(text: str, encoding: str) -> bytes:
    return text.encode("latin-1" if encoding in ("latin1", "latin-1") else "ascii")


def _tensor(storage: np.ndarray, offset: int, size: tuple, stride: tuple, *_: Any) -> PickledArray:
    """A tensor view of a storage; all elements must be within the storage."""
    if len(size) != len(stride) or min((*size, *stride, offset), default=0) < 0:
        raise ValueError("a tensor with negative sizes")
    last = offset + sum((length - 1) * step for length, step in zip(size, stride, strict=True))
    array = PickledArray()
    if 0 in size:
        array.value = np.zeros(size, dtype=storage.dtype)
    elif last >= len(storage) or int(np.prod(size, dtype=object)) > len(storage):
        raise ValueError("a tensor beyond its storage")
    else:
        strides = tuple(step * storage.itemsize for step in stride)
        part = storage[offset : offset + int(np.prod(size))]
        if strides == part.reshape(size).strides:
            array.value = part.reshape(size)
            return array
        array.value = np.lib.stride_tricks.as_strided(storage[offset:], size, strides, writeable=False)
    return array


_ALLOWED: dict[tuple[str, str], Callable[..., Any]] = {
    ("collections", "OrderedDict"): OrderedDict,
    ("_codecs", "encode"): _encoded,
    ("numpy", "dtype"): lambda code, *_: PickledType(str(code)),
    ("numpy", "ndarray"): PickledArray,
    ("joblib.numpy_pickle", "NumpyArrayWrapper"): JoblibArray,
    ("torch._utils", "_rebuild_tensor_v2"): _tensor,
    **{
        (f"numpy.{core}.{module}", name): function
        for core in ("core", "_core")
        for module, name, function in (
            ("multiarray", "_reconstruct", lambda *_: PickledArray()),
            ("multiarray", "scalar", _scalar),
            ("numeric", "_frombuffer", _from_buffer),
        )
    },
}


class _Unpickler(pickle._Unpickler):  # type: ignore[name-defined]  # pure Python, so that opcodes can be replaced
    """Reads plain data from a stream in memory."""

    dispatch: ClassVar[dict[int, Any]] = dict(pickle._Unpickler.dispatch)  # type: ignore[attr-defined]

    def __init__(self, stream: BytesIO, storage: Callable[[str, str], np.ndarray] | None = None):
        super().__init__(stream)
        self._stream, self._storage = stream, storage

    def find_class(self, module: str, name: str) -> Any:
        """Look up a placeholder. Raises NotAllowedError for any other name."""
        found = _ALLOWED.get((module, name))
        if found is not None:
            return found
        if module == "torch" and name in _TORCH_TYPES:
            return _TORCH_TYPES[name]
        raise NotAllowedError(f"'{module[:60]}.{name[:60]}'")

    def persistent_load(self, pid: Any) -> np.ndarray:
        """A tensor's storage."""
        if self._storage is None or len(pid) != 5 or pid[0] != "storage":
            raise NotAllowedError("a reference to something outside of it")
        return self._storage(str(pid[2]), str(pid[1]))

    def load_build(self) -> None:
        """Fill a placeholder; joblib's is replaced by the array that follows it."""
        if not isinstance(self.stack[-2], (PickledArray, PickledType, JoblibArray)):
            raise NotAllowedError("the state of an object")
        pickle._Unpickler.load_build(self)  # type: ignore[attr-defined]
        if isinstance(self.stack[-1], JoblibArray):
            self.stack[-1] = self.stack[-1].read(self._stream)

    dispatch[pickle.BUILD[0]] = load_build

    def load_bytearray8(self) -> None:
        """Load a bytearray; the read is limited to the stream's length before memory is allocated."""
        (length,) = struct.unpack("<Q", self.read(8))
        self.append(bytearray(self.read(length)))

    dispatch[pickle.BYTEARRAY8[0]] = load_bytearray8


class _Bytes(BytesIO):
    """A stream that limits reads to its own length, whatever the pickle claims."""

    def read(self, size: int | None = -1) -> bytes:
        if size is not None and size > self.getbuffer().nbytes - self.tell():
            raise EOFError("it was cut off")
        return super().read(size)


def load_pickle(path: Path) -> Any:
    """Load plain data from a pickle. Raises FileError for other content or damage, OSError on disk errors."""
    check_size(path)
    data = path.read_bytes()
    with _refused(path, converter(path)), reported_damage(path, "a pickle"):
        if data[:1] == b"\x78":
            inflater, most = zlib.decompressobj(), min(MAX_RATIO * len(data), MAX_BYTES)
            data = inflater.decompress(data, most)
            if inflater.unconsumed_tail:
                raise FileError(path, f"it inflates to more than {most} bytes, not allowed.")
        return _Unpickler(_Bytes(data)).load()


@contextmanager
def _refused(path: Path, do: str) -> Iterator[None]:
    try:
        yield
    except NotAllowedError as error:
        raise FileError(path, f"it holds {error}, which is never loaded.", do) from error


def load_torch(path: Path) -> Any:
    """Load tensors and plain containers from a file of `torch.save`. Raises FileError, or OSError on disk errors."""
    check_size(path)
    tensors = "Save the tensors alone: torch.save({name: tensor, ...}, FILE)."
    older = "Files of torch before 1.6 are not read; save it again."
    with (
        _refused(path, tensors),
        reported_damage(path, "a file of torch.save", older),
        zipfile.ZipFile(path) as archive,
    ):
        check_sizes(path, archive.infolist())
        (head,) = (name for name in archive.namelist() if name.endswith("/data.pkl"))
        folder = head.removesuffix("data.pkl")

        def storage(key: str, kind: str) -> np.ndarray:
            info = archive.getinfo(f"{folder}data/{key}")
            array = page_memory.empty((info.file_size // np.dtype(kind).itemsize,), kind)
            with archive.open(info) as stream:
                page_memory.fill(array, stream)
            return array

        return _Unpickler(_Bytes(archive.read(head)), storage).load()


def converter(path: Path) -> str:
    """Command with which the user converts a trusted pickle or joblib file to an npz archive.

    A dictionary with one entry is unwrapped. An entry that is not an array aborts the command, since an archive would
    pickle it. Names are quoted, because file names are untrusted text.
    """
    names = f"{shlex.quote(path.name)} {shlex.quote(path.stem + '.npz')}"
    code = (
        "import sys, joblib, numpy; d = joblib.load(sys.argv[1]); "
        "d = next(iter(d.values())) if len(d) == 1 else d; a = {k: numpy.asarray(v) for k, v in d.items()}; "
        "bad = [k for k in a if a[k].dtype.hasobject]; "
        "sys.exit(f'no arrays: {bad}') if bad else numpy.savez(sys.argv[2], **a)"
    )
    return f'If you trust it, write its arrays into an archive: python -c "{code}" {names}'
