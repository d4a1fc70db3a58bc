"""`index.parquet`: one row per clip with its own columns, then the numbers of the stages."""

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
    """Digest of the manifest. Raises FileError if a file is missing, changed or not listed."""
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
"""Columns of every index. `file` and `sha256` describe the clip's JSON, `stages` is JSON."""

RENAMED = {"file": "source_file", "file_sha256": "source_sha256"}
"""Numbers of the catalog that describe the source's file, and their names in the index."""

MAX_ROWS, MAX_BYTES = 1_000_000, 2_000_000_000
"""Most clips of a database, and most decoded bytes of its columns; a small file may claim any number of them."""


def read_table(path: Path, read_dictionary: Sequence[str] = ()) -> pd.DataFrame:
    """Read a table. Raises FileError if it is too large or not Parquet, OSError on disk errors."""
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
    """A clip's row; its own columns override numbers of the same name."""
    found = {RENAMED.get(name, name): value for name, value in numbers.items()}
    return {**found, **own, "licence_class": classify_licence(own["licence"]).label}


def encode(rows: list[dict[str, Any]]) -> bytes:
    """Parquet bytes of the rows; equal rows give equal bytes. Missing values are null."""
    others = sorted({name for entry in rows for name in entry} - set(OWN_COLUMNS))
    arrays = {name: pa.array([entry[name] for entry in rows], type=kind) for name, kind in OWN_COLUMNS.items()}
    arrays |= {name: _column([entry.get(name) for entry in rows]) for name in others}
    sink = pa.BufferOutputStream()
    pq.write_table(pa.table(arrays), sink, compression="zstd")
    return sink.getvalue().to_pybytes()


def _column(values: list[Any]) -> pa.Array:
    """Integers as int64, other numbers as float64, booleans and strings as such; a mixture becomes strings.

    Missing values are null; readers without nullable integers (pandas' default) convert such a column to float.
    """
    kinds = {type(value) for value in values if value is not None}
    if kinds == {int}:
        return pa.array(values, type=pa.int64())
    if kinds <= {int, float} and kinds:
        return pa.array([None if value is None else float(value) for value in values], type=pa.float64())
    if kinds == {bool}:
        return pa.array(values, type=pa.bool_())
    return pa.array([None if value is None else str(value) for value in values], type=pa.string())
