"""`index.parquet`: a row a clip, its own facts first, then the numbers of the stages."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import pandas as pd
import pyarrow as pa
import pyarrow.parquet as pq

from pipeline.errors import FileError
from pipeline.expert import manifest
from pipeline.expert.licence import classify_licence
from pipeline.files import digest
from pipeline.files.csv_json import read_json
from pipeline.files.swap import current


def database_version(folder: Path) -> str:
    """Digest of the manifest. Raises FileError where a file is missing, changed or not stated."""
    folder = current(folder)
    path = folder / manifest.FILE
    if not path.is_file():
        raise FileError(path, "there is no database here.", "Materialize expert_db.")
    head = read_json(path, "a database's manifest", "Materialize expert_db again.")
    try:
        stated, broken = head["files"], manifest.broken_seal(head)
    except (ValueError, KeyError, TypeError) as error:
        raise FileError(path, f"not a database's manifest ({error}).", "Materialize expert_db again.") from error
    if broken is not None:
        raise FileError(path, f"it {broken}.", "Materialize expert_db again.")
    files = [each for each in folder.iterdir() if each.name != manifest.FILE]
    found = digest.of_each(files)
    if dict(zip((each.name for each in files), found, strict=True)) != stated:
        raise FileError(folder, "its files are not those its manifest states.", "Materialize expert_db again.")
    return digest.of_file(path)


FILE = "index.parquet"

OWN_COLUMNS = {
    "clip": pa.string(),
    "file": pa.string(),
    "sha256": pa.string(),
    "frames": pa.int64(),
    "seconds": pa.float64(),
    "weight": pa.float64(),
    "skill": pa.string(),
    "licence": pa.string(),
    "licence_class": pa.string(),
    "loop_mode": pa.string(),
    "stages": pa.string(),
}
"""Columns every index has. `file` and `sha256` are those of the clip's JSON, `stages` is JSON."""

RENAMED = {"file": "source_file", "file_sha256": "source_sha256"}
"""Numbers of the catalog that describe the source's file, and their names in the index."""

MAX_ROWS, MAX_BYTES = 1_000_000, 2_000_000_000
"""Clips of a database; bytes of its columns before they are decoded. A few kilobytes may claim any number."""


def read_table(path: Path, read_dictionary: Sequence[str] = ()) -> pd.DataFrame:
    """The table in a file. Raises FileError: larger than allowed, or no Parquet; OSError of the disk."""
    try:
        with pq.ParquetFile(path) as file:
            groups = [file.metadata.row_group(index) for index in range(file.metadata.num_row_groups)]
            rows, size = sum(each.num_rows for each in groups), sum(each.total_byte_size for each in groups)
        if max(rows, file.metadata.num_rows) > MAX_ROWS or size > MAX_BYTES:
            problem = f"it claims {rows} rows and {size} bytes, more than the {MAX_ROWS} and {MAX_BYTES} allowed."
            raise FileError(path, problem, "Write the database again.")
        return pd.read_parquet(path, read_dictionary=list(read_dictionary))
    except (pa.ArrowException, ValueError) as error:
        raise FileError(path, f"it is no Parquet table ({error}).", "Write the database again.") from error


def row(numbers: Mapping[str, Any], **own: Any) -> dict[str, Any]:
    """A clip's row. Its own facts win over numbers of the same name."""
    found = {RENAMED.get(name, name): value for name, value in numbers.items()}
    return {**found, **own, "licence_class": classify_licence(own["licence"]).label}


def encode(rows: list[dict[str, Any]]) -> bytes:
    """Parquet bytes of the rows; equal rows give equal bytes. Columns a row lacks are null there."""
    others = sorted({name for entry in rows for name in entry} - set(OWN_COLUMNS))
    arrays = {name: pa.array([entry[name] for entry in rows], type=kind) for name, kind in OWN_COLUMNS.items()}
    arrays |= {name: _column([entry.get(name) for entry in rows]) for name in others}
    sink = pa.BufferOutputStream()
    pq.write_table(pa.table(arrays), sink, compression="zstd")
    return sink.getvalue().to_pybytes()


def _column(values: list[Any]) -> pa.Array:
    """Whole numbers as int64, others as float64, truth values and texts as such; a mixture becomes text.

    Null where a row has none: a reader that knows no null integers (pandas' default) makes such a column float.
    """
    kinds = {type(value) for value in values if value is not None}
    if kinds == {int}:
        return pa.array(values, type=pa.int64())
    if kinds <= {int, float} and kinds:
        return pa.array([None if value is None else float(value) for value in values], type=pa.float64())
    if kinds == {bool}:
        return pa.array(values, type=pa.bool_())
    return pa.array([None if value is None else str(value) for value in values], type=pa.string())
