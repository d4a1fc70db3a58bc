"""Rows of a manifest in shards: Parquet tables of about a hundred rows, each named by the digest of its bytes.

Shard boundaries are determined by the clips' names, so that an added clip changes only its own shard.
A column is a number of the clips, or one of `clip, blob, record` (kept clips) and `clip, pieces, reasons`
(findings). The type of numbers is preserved: int or float, None or missing.
"""

from __future__ import annotations

import hashlib
import json
import math
import operator
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Generic, overload

import pyarrow as pa
import pyarrow.parquet as pq

from pipeline.batch.rows import Entry, Judged, Row
from pipeline.errors import FileError
from pipeline.files import digest
from pipeline.files.blob_store import BlobStore

CUT_EVERY = 128
"""A shard ends after a clip whose name's digest is divisible by this number, the mean number of rows."""
MOST_ROWS = 1024
"""Most rows of a shard."""

OWN = {Entry: ("clip", "blob", "record"), Judged: ("clip", "pieces", "reasons")}
"""Columns that are not numbers, by kind of row."""
MISSING = object()
"""Value of a number that a row does not have."""

_JSON, _NONE = {b"values": b"json"}, {b"null": b"none"}
"""Metadata of a column: values are JSON texts; nulls are None (otherwise nulls are missing numbers)."""
_INT64 = 2**63


@dataclass(frozen=True)
class Shard(Generic[Row]):
    """Some rows of one kind, in memory as the bytes of a Parquet file or in a store."""

    kind: type[Row]
    digest: str
    count: int
    """Number of rows."""
    place: bytes | BlobStore

    def data(self) -> bytes:
        """Bytes of the file. Raises FileError if it is missing or damaged in the store."""
        return self.place if isinstance(self.place, bytes) else self.place.get(self.digest)

    def columns(self, names: Sequence[str] | None = None) -> dict[str, list[Any]]:
        """Values of the named columns that exist (None: all columns); `MISSING` for missing values."""
        table = self._table(names)
        return {field.name: _values(table.column(index), field) for index, field in enumerate(table.schema)}

    def rows(self) -> list[Row]:
        """The rows, in order."""
        columns = self.columns()
        own = {name: columns.pop(name) for name in OWN[self.kind]}
        numbers = [
            {name: value for name, value in zip(columns, row, strict=True) if value is not MISSING}
            for row in (zip(*columns.values(), strict=True) if columns else ((),) * self.count)
        ]
        for name in ("record", "pieces", "reasons"):
            if name in own:
                own[name] = [tuple(value) for value in own[name]]
        return [
            self.kind(**dict(zip(own, row, strict=True)), numbers=found)
            for row, found in zip(zip(*own.values(), strict=True), numbers, strict=True)
        ]

    def with_numbers(self, numbers: Mapping[str, Mapping[str, Any]]) -> Shard[Row]:
        """The shard with further numbers for some of its clips, by name; other columns are not decoded."""
        table = self._table(None)
        clips = _values(table.column("clip"), table.schema.field("clip"))
        names = sorted({name for clip in clips for name in numbers.get(clip, ())})
        if not names:
            return self
        fields = {field.name: (field, table.column(index)) for index, field in enumerate(table.schema)}
        for name in names:
            _check_name(name, self.kind)
            old = _values(fields[name][1], fields[name][0]) if name in fields else [MISSING] * len(clips)
            values = [numbers.get(clip, {}).get(name, before) for clip, before in zip(clips, old, strict=True)]
            fields[name] = _column(name, values)
        return _shard(self.kind, fields, self.count)

    def without_number(self, name: str) -> Shard[Row]:
        """The shard without a number of its clips; no column is decoded."""
        table = self._table(None)
        fields = {field.name: (field, table.column(index)) for index, field in enumerate(table.schema)}
        return _shard(self.kind, fields, self.count) if fields.pop(name, None) else self

    def _table(self, names: Sequence[str] | None) -> pa.Table:
        try:
            with pq.ParquetFile(pa.py_buffer(self.data())) as file:
                there = set(file.schema_arrow.names)
                wanted = None if names is None else [name for name in dict.fromkeys(names) if name in there]
                return file.read(columns=wanted, use_threads=False)
        except pa.ArrowException as error:
            where = self.place.path(self.digest) if isinstance(self.place, BlobStore) else self.digest
            raise FileError(where, f"it is no shard of a manifest ({error}).", "Materialize again.") from error


class NotFiniteError(ValueError):
    """Raised for a number of a row that is not finite."""

    def __init__(self, name: str, row: int):
        super().__init__(f"the number '{name}' of row {row} is not finite")
        self.name, self.row = name, row


def shard_of(kind: type[Row], rows: Sequence[Row]) -> Shard[Row]:
    """The rows as a shard in memory; equal rows give equal bytes. Raises ValueError for a number that is not finite."""
    own = {name: [getattr(row, name) for row in rows] for name in OWN[kind]}
    names = sorted({name for row in rows for name in row.numbers})
    for name in names:
        _check_name(name, kind)
    numbers = {name: [row.numbers.get(name, MISSING) for row in rows] for name in names}
    try:
        columns = {name: _column(name, values) for name, values in (own | numbers).items()}
    except NotFiniteError as error:
        raise ValueError(f"clip '{rows[error.row].clip}': the number '{error.name}' is not finite") from error
    return _shard(kind, columns, len(rows))


def cut(clips: Sequence[str]) -> Iterator[slice]:
    """Slices of sorted clip names that are shards: each within one source, with boundaries determined by the names."""
    start = 0
    for stop, clip in enumerate(clips, 1):
        ends = stop == len(clips) or source_of(clips[stop]) != source_of(clip)
        if ends or stop - start == MOST_ROWS or _cuts(clip):
            yield slice(start, stop)
            start = stop


def source_of(clip: str) -> str:
    """Name of a clip's source: the part of its name before the first `/`."""
    source, slash, _ = clip.partition("/")
    return source if slash else ""


def _cuts(clip: str) -> bool:
    name = hashlib.sha256(clip.encode(errors="surrogatepass")).digest()
    return int.from_bytes(name[:4], "big") % CUT_EVERY == 0


class Rows(Generic[Row]):
    """Sequence of the rows of several shards, with one shard at a time in memory."""

    def __init__(self, shards: Sequence[Shard[Row]]):
        self.shards = tuple(shards)

    def __len__(self) -> int:
        return sum(shard.count for shard in self.shards)

    def __iter__(self) -> Iterator[Row]:
        for shard in self.shards:
            yield from shard.rows()

    @overload
    def __getitem__(self, index: int) -> Row: ...
    @overload
    def __getitem__(self, index: slice) -> tuple[Row, ...]: ...
    def __getitem__(self, index: int | slice) -> Row | tuple[Row, ...]:
        if isinstance(index, slice):
            return tuple(self)[index]
        place = range(len(self))[index]
        for shard in self.shards:
            if place < shard.count:
                return shard.rows()[place]
            place -= shard.count
        raise IndexError(index)

    def __eq__(self, other: object) -> bool:
        if isinstance(other, Rows):
            return [each.digest for each in self.shards] == [each.digest for each in other.shards] or (
                tuple(self) == tuple(other)
            )
        return isinstance(other, tuple) and tuple(self) == other

    def __repr__(self) -> str:
        return f"Rows({len(self)} in {len(self.shards)} shards)"


def rows_of(shards: Iterable[Shard[Row]], clips: Collection[str]) -> Iterator[Row]:
    """Rows of the named clips; only their shards are decoded."""
    for shard in shards if clips else ():
        if not set(shard.columns(["clip"])["clip"]).isdisjoint(clips):
            yield from (row for row in shard.rows() if row.clip in clips)


def changed(kind: type[Row], rows: Rows[Row] | Sequence[Row], change: Callable[[Row], Row | None]) -> Rows[Row]:
    """Apply `change` to all rows and drop those that become None; shards without changes are reused."""
    found: list[Shard[Row]] = []
    for shard in rows.shards if isinstance(rows, Rows) else shards_of(kind, rows):
        before = shard.rows()
        after = [row for row in map(change, before) if row is not None]
        same = len(after) == len(before) and all(map(operator.is_, after, before))
        found += [shard] if same else [shard_of(kind, after)] if after else []
    return Rows(found)


def shards_of(kind: type[Row], rows: Sequence[Row], whole_up_to: int = 0) -> tuple[Shard[Row], ...]:
    """The shards of rows; a single one of up to `whole_up_to` rows."""
    groups = [slice(None)] if 0 < len(rows) <= whole_up_to else cut([row.clip for row in rows])
    return tuple(shard_of(kind, rows[group]) for group in groups)


def _shard(kind: type[Row], fields: Mapping[str, tuple[pa.Field, Any]], count: int) -> Shard[Row]:
    names = [*OWN[kind], *sorted(set(fields) - set(OWN[kind]))]
    schema = pa.schema([fields[name][0] for name in names])
    table = pa.table([fields[name][1] for name in names], schema=schema)
    sink = pa.BufferOutputStream()
    texts = [field.name for field in schema if pa.types.is_string(field.type)]
    options: dict[str, Any] = {"use_dictionary": texts, "write_statistics": False}
    pq.write_table(table, sink, compression="zstd", **options)
    data = sink.getvalue().to_pybytes()
    return Shard(kind, digest.of_bytes(data), count, data)


def _check_name(name: str, kind: type[Any]) -> None:
    if name in OWN[kind]:
        raise ValueError(f"a number of a clip may not be named {name!r}")


def _column(name: str, values: list[Any]) -> tuple[pa.Field, pa.Array]:
    """A column of one kind of value as such, of others as JSON texts. Raises ValueError for a number not finite."""
    kinds = {type(value) for value in values if value is not MISSING}
    lacks = any(value is MISSING for value in values)
    nothing = kinds - {type(None)}
    kind = _PLAIN.get(next(iter(nothing))) if len(nothing) == 1 else None
    if float in kinds:
        bad = [row for row, value in enumerate(values) if isinstance(value, float) and not math.isfinite(value)]
        if bad:
            raise NotFiniteError(name, bad[0])
    if kind is not None and not (lacks and type(None) in kinds):
        given = [None if value is MISSING else value for value in values]
        fits, made = kind
        if fits(given):
            metadata = _NONE if type(None) in kinds else None
            return pa.field(name, made, metadata=metadata), pa.array(given, type=made)
    texts = [None if value is MISSING else _text(value) for value in values]
    return pa.field(name, pa.string(), metadata=_JSON), pa.array(texts, type=pa.string())


def _in_range(values: list[Any]) -> bool:
    return all(value is None or -_INT64 <= value < _INT64 for value in values)


def _is_utf8(values: list[Any]) -> bool:
    try:
        "".join(value for value in values if value is not None).encode()
    except UnicodeEncodeError:
        return False
    return True


_PLAIN: dict[type, tuple[Callable[[list[Any]], bool], pa.DataType]] = {
    float: (lambda values: True, pa.float64()),
    int: (_in_range, pa.int64()),
    bool: (lambda values: True, pa.bool_()),
    str: (_is_utf8, pa.string()),
}


def _text(value: Any) -> str:
    return json.dumps(value, sort_keys=True, allow_nan=False)


def _values(column: pa.ChunkedArray | pa.Array, field: pa.Field) -> list[Any]:
    found, metadata = column.to_pylist(), field.metadata or {}
    if metadata.get(b"values") == b"json":
        known: dict[str, Any] = {}
        return [MISSING if text is None else _parsed(text, known) for text in found]
    if metadata.get(b"null") == b"none":
        return found
    return [MISSING if value is None else value for value in found] if column.null_count else found


def _parsed(text: str, known: dict[str, Any]) -> Any:
    """The value of a JSON text. Rows share equal values, which must not be modified."""
    if text not in known:
        known[text] = json.loads(text)
    return known[text]
