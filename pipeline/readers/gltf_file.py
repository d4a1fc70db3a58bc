"""glTF 2.0 files (`.gltf`, `.glb`): the JSON and its accessors, with every offset checked before it is followed."""

from __future__ import annotations

import base64
import json
import struct
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from pipeline.errors import FileError
from pipeline.files.array_file import known_numbers
from pipeline.readers.text_file import MAX_NUMBERS, check_size

COMPONENTS = {5120: "i1", 5121: "u1", 5122: "<i2", 5123: "<u2", 5125: "<u4", 5126: "<f4"}
"""glTF's component types."""
WIDTHS = {"SCALAR": 1, "VEC3": 3, "VEC4": 4, "MAT4": 16}

_MAGIC, _JSON, _BIN = 0x46546C67, 0x4E4F534A, 0x004E4942


@dataclass(frozen=True, kw_only=True)
class GltfFile:
    """A glTF file's JSON and its buffers."""

    path: Path
    json: dict[str, Any]
    buffers: tuple[bytes, ...]

    def items(self, name: str) -> list[dict[str, Any]]:
        """A list of objects of the file's root. Raises FileError for what is none."""
        value = self.json.get(name, [])
        if not isinstance(value, list) or not all(isinstance(each, dict) for each in value):
            raise FileError(self.path, f"'{name}' is not a list of objects.")
        return value

    def item(self, name: str, index: Any) -> dict[str, Any]:
        """One of them. Raises FileError for an index that is none."""
        items = self.items(name)
        if not isinstance(index, int) or isinstance(index, bool) or not 0 <= index < len(items):
            raise FileError(self.path, f"there is no {name}[{str(index)[:20]}].")
        return items[index]

    def numbers(self, index: Any) -> np.ndarray:
        """The values (n, width) of an accessor. Raises FileError."""
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
        raw = np.lib.stride_tricks.as_strided(
            np.frombuffer(data, dtype="u1")[start:], (count, size), (stride, 1), writeable=False
        )
        with np.errstate(invalid="ignore"):  # signalling NaN
            values = np.ascontiguousarray(raw).view(kind).astype(float)
        if accessor.get("normalized") and kind != "<f4":
            values = np.maximum(values / float(np.iinfo(kind).max), -1.0)
        return known_numbers(values)


def _whole(value: Any) -> int:
    return value if isinstance(value, int) and not isinstance(value, bool) else -1


def open_gltf(path: Path) -> GltfFile:
    """The file with its buffers. Raises FileError."""
    check_size(path)
    data = path.read_bytes()
    text, inner = _chunks(path, data) if data[:4] == struct.pack("<I", _MAGIC) else (data, None)
    try:
        value = json.loads(text.decode("utf-8-sig"))
    except (ValueError, RecursionError) as error:
        raise FileError(path, f"it is not glTF: {str(error)[:100]}.") from error
    if not isinstance(value, dict) or not isinstance(value.get("asset"), dict):
        raise FileError(path, "it is not glTF: 'asset' is missing.")
    if not str(value["asset"].get("version", "")).startswith("2"):
        raise FileError(path, "it is not glTF 2.0.", "Export it again from a current program.")
    bare = GltfFile(path=path, json=value, buffers=())
    buffers = tuple(_buffer(path, each, inner, number) for number, each in enumerate(bare.items("buffers")))
    return GltfFile(path=path, json=value, buffers=buffers)


def _chunks(path: Path, data: bytes) -> tuple[bytes, bytes | None]:
    """JSON and binary chunk of a GLB."""
    found: dict[int, bytes] = {}
    at = 12
    while at + 8 <= len(data):
        length, kind = struct.unpack_from("<II", data, at)
        if at + 8 + length > len(data):
            raise FileError(path, "a chunk reaches beyond the end of the file.", "The file was cut off.")
        found.setdefault(kind, data[at + 8 : at + 8 + length])
        at += 8 + length
    if _JSON not in found:
        raise FileError(path, "it is not glTF: there is no JSON chunk.")
    return found[_JSON], found.get(_BIN)


def _buffer(path: Path, buffer: dict[str, Any], inner: bytes | None, number: int) -> bytes:
    uri = buffer.get("uri")
    if uri is None:
        if number or inner is None:
            raise FileError(path, f"buffers[{number}] has no data.", "The file was cut off.")
        return inner
    if not isinstance(uri, str):
        raise FileError(path, f"buffers[{number}] has no address.")
    if uri.startswith("data:"):
        try:
            return base64.b64decode(uri.partition(",")[2], validate=True)
        except ValueError as error:
            raise FileError(path, f"buffers[{number}] is not base64.") from error
    beside = path.parent / uri
    if "/" in uri or "\\" in uri or "\0" in uri or beside.is_symlink() or not beside.is_file():
        problem = f"buffers[{number}] is in '{uri[:60]}', which is not a file beside it."
        raise FileError(path, problem, "Put it there, or export as GLB.")
    check_size(beside)
    return beside.read_bytes()
