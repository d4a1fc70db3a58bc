"""glTF 2.0 files (`.gltf`, `.glb`): the JSON and its accessors, with all offsets checked before use."""

import base64
import json
import struct
from dataclasses import dataclass
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np

from pipeline.errors import FileError
from pipeline.files import page_memory
from pipeline.files.array_file import finite_rows
from pipeline.readers.text_file import MAX_NUMBERS, check_size

COMPONENTS = {5120: "i1", 5121: "u1", 5122: "<i2", 5123: "<u2", 5125: "<u4", 5126: "<f4"}
"""glTF's component types."""
PIECE = 4 << 18
"""Characters of base64 that are decoded at once, a multiple of four."""
WIDTHS = {"SCALAR": 1, "VEC3": 3, "VEC4": 4, "MAT4": 16}

_MAGIC, _JSON, _BIN = 0x46546C67, 0x4E4F534A, 0x004E4942


@dataclass(frozen=True, kw_only=True)
class GltfFile:
    """A glTF file's JSON and its buffers."""

    path: Path
    json: dict[str, Any]
    buffers: tuple[np.ndarray, ...]
    """Bytes."""

    def items(self, name: str) -> list[dict[str, Any]]:
        """A list of objects of the file's root. Raises FileError if it is not one."""
        value = self.json.get(name, [])
        if not isinstance(value, list) or not all(isinstance(each, dict) for each in value):
            raise FileError(self.path, f"'{name}' is not a list of objects.")
        return value

    def item(self, name: str, index: Any) -> dict[str, Any]:
        """An object of such a list. Raises FileError for an invalid index."""
        items = self.items(name)
        if not isinstance(index, int) or isinstance(index, bool) or not 0 <= index < len(items):
            raise FileError(self.path, f"there is no {name}[{str(index)[:20]}].")
        return items[index]

    def numbers(self, index: Any) -> np.ndarray:
        """The values (n, width) of an accessor as float64. Raises FileError."""
        return finite_rows(values := self.stored(index), 0, len(values))

    def stored(self, index: Any) -> np.ndarray:
        """The values (n, width) of an accessor as stored, without a copy if contiguous. Raises FileError."""
        accessor = self.item("accessors", index)
        kind, width = COMPONENTS.get(accessor.get("componentType", 0)), WIDTHS.get(str(accessor.get("type")))
        count = accessor.get("count")
        if kind is None or width is None or not isinstance(count, int) or count < 1 or "sparse" in accessor:
            raise FileError(self.path, f"accessors[{index}] is of a kind that is not read.")
        if count * width > MAX_NUMBERS:
            raise FileError(self.path, f"accessors[{index}] claims {count} values, more than are allowed.")
        view = self.item("bufferViews", accessor.get("bufferView"))
        buffer = view.get("buffer")
        if not isinstance(buffer, int) or not 0 <= buffer < len(self.buffers):
            raise FileError(self.path, f"accessors[{index}] is in a buffer that is not there.")
        data, size = self.buffers[buffer], np.dtype(kind).itemsize * width
        stride = view.get("byteStride", size)
        start = _whole(view.get("byteOffset", 0)) + _whole(accessor.get("byteOffset", 0))
        stop = start + _whole(stride) * (count - 1) + size
        if not isinstance(stride, int) or stride < size or start < 0 or stop > len(data):
            raise FileError(self.path, f"accessors[{index}] reaches beyond its buffer.", "The file was cut off.")
        if stride == size:
            values = data[start:stop].view(kind).reshape(count, width)
        else:
            raw = np.lib.stride_tricks.as_strided(data[start:], (count, size), (stride, 1), writeable=False)
            values = np.ascontiguousarray(raw).view(kind)
        if accessor.get("normalized") and kind != "<f4":
            values = np.maximum(values / np.float32(np.iinfo(kind).max), np.float32(-1.0))
        return values


def _whole(value: Any) -> int:
    return value if isinstance(value, int) and not isinstance(value, bool) else -1


def open_gltf(path: Path) -> GltfFile:
    """Open a file with its buffers. Raises FileError."""
    bare, inner = _without_buffers(path)
    buffers = tuple(_buffer(path, each, inner, number) for number, each in enumerate(bare.items("buffers")))
    return GltfFile(path=path, json=bare.json, buffers=buffers)


def files_beside(path: Path) -> tuple[Path, ...]:
    """External buffer files of a glTF in its folder; none if it can't be read."""
    try:
        bare, _ = _without_buffers(path)
        named = [each.get("uri") for each in bare.items("buffers")]
        uris = [uri for uri in named if isinstance(uri, str) and not uri.startswith("data:")]
        return tuple(path.parent / uri for uri in uris if _is_beside(path, uri))
    except (FileError, OSError):
        return ()


def _is_beside(path: Path, uri: str) -> bool:
    """Whether a URI is a file in the folder of `path`."""
    beside = path.parent / uri
    return not any(each in uri for each in "/\\\0") and not beside.is_symlink() and beside.is_file()


def _without_buffers(path: Path) -> tuple[GltfFile, np.ndarray | None]:
    """The file with only its JSON, and the binary chunk of a GLB. Raises FileError."""
    check_size(path)
    with path.open("rb") as stream:
        binary = stream.read(4) == struct.pack("<I", _MAGIC)
        text, inner = _chunks(path, stream) if binary else (path.read_bytes(), None)
    try:
        value = json.loads(text.decode("utf-8-sig"))
    except (ValueError, RecursionError) as error:
        raise FileError(path, f"it is not glTF: {str(error)[:100]}.") from error
    if not isinstance(value, dict) or not isinstance(value.get("asset"), dict):
        raise FileError(path, "it is not glTF: 'asset' is missing.")
    if not str(value["asset"].get("version", "")).startswith("2"):
        raise FileError(path, "it is not glTF 2.0.", "Export it again from a current program.")
    return GltfFile(path=path, json=value, buffers=()), inner


def _chunks(path: Path, stream: BinaryIO) -> tuple[bytes, np.ndarray | None]:
    """JSON and binary chunk of a GLB."""
    size, text, inner, at = path.stat().st_size, None, None, 12
    while at + 8 <= size:
        stream.seek(at)
        head = stream.read(8)
        if len(head) < 8:
            raise FileError(path, "a chunk reaches beyond the end of the file.", "The file was cut off.")
        length, kind = struct.unpack("<II", head)
        if at + 8 + length > size:
            raise FileError(path, "a chunk reaches beyond the end of the file.", "The file was cut off.")
        if kind == _JSON and text is None:
            text = stream.read(length)
        elif kind == _BIN and inner is None:
            inner = page_memory.empty((length,), "u1")
            page_memory.fill(inner, stream)
        at += 8 + length
    if text is None:
        raise FileError(path, "it is not glTF: there is no JSON chunk.")
    return text, inner


def _buffer(path: Path, buffer: dict[str, Any], inner: np.ndarray | None, number: int) -> np.ndarray:
    """The bytes of a buffer. A data URI is removed from the JSON."""
    uri = buffer.pop("uri", None)
    if uri is None:
        if number or inner is None:
            raise FileError(path, f"buffers[{number}] has no data.", "The file was cut off.")
        return inner
    if not isinstance(uri, str):
        raise FileError(path, f"buffers[{number}] has no address.")
    if uri.startswith("data:"):
        return _decoded(path, uri, number)
    beside = path.parent / uri
    if not _is_beside(path, uri):
        problem = f"buffers[{number}] is in '{uri[:60]}', which is not a file beside it."
        raise FileError(path, problem, "Put it there, or export as GLB.")
    check_size(beside)
    data = page_memory.empty((beside.stat().st_size,), "u1")
    with beside.open("rb") as stream:
        page_memory.fill(data, stream)
    return data


def _decoded(path: Path, uri: str, number: int) -> np.ndarray:
    """The bytes of a data URI, decoded in pieces. Raises FileError if it is not base64."""
    start = uri.find(",") + 1
    data, count = page_memory.empty((3 * (len(uri) - start) // 4 + 3,), "u1"), 0
    try:
        for at in range(start, len(uri), PIECE):
            part = base64.b64decode(uri[at : at + PIECE], validate=True)
            data[count : count + len(part)] = np.frombuffer(part, "u1")
            count += len(part)
    except ValueError as error:
        raise FileError(path, f"buffers[{number}] is not base64.") from error
    return data[:count]
