"""The table of criteria: for each clip, stretch and criterion the number, its threshold with unit and source, a
verdict.

The file is next to the manifest of `feasible_motions` and contains that manifest's digest. Later stages do not get the
table: clips that pass keep one number per criterion.
"""

import dataclasses
import itertools
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pyarrow as pa
import pyarrow.parquet as pq

from pipeline.batch import Judged, Manifest, Rows
from pipeline.batch.shard import MISSING, Shard
from pipeline.errors import FileError
from pipeline.feasibility.criterion import REGISTERED, codes
from pipeline.feasibility.judgement import NUMBER, Found, from_text
from pipeline.files import atomic, digest
from pipeline.files.npz import reported_damage
from pipeline.files.sourced import Origin

HOLDS, BROKEN, NOT_APPLICABLE = "holds", "broken", "not applicable"

COLUMNS = {
    "clip": pa.string(),
    "start_s": pa.float64(),
    "stop_s": pa.float64(),
    "piece": pa.string(),
    "group": pa.string(),
    "criterion": pa.string(),
    "number": pa.float64(),
    "threshold": pa.float64(),
    "sense": pa.string(),
    "unit": pa.string(),
    "verdict": pa.string(),
    "margin": pa.float64(),
    "message": pa.string(),
    "setting": pa.string(),
    "source": pa.string(),
    "why": pa.string(),
}
"""`start_s` to `stop_s` [s] is the evaluated stretch of `clip`, `piece` the name of the clip made from it; `margin` is
the distance to the threshold relative to the threshold; `message` states the violation, or why the criterion does not
apply; `setting` is the key of the threshold in data/feasibility.yaml, `source` and `why` are copied from there."""

TEXTS = tuple(name for name, kind in COLUMNS.items() if kind == pa.string())

OF_STRETCH = ("clip", "start_s", "stop_s", "piece")
OF_ROW = ("facts", "number", "threshold", "sense", "verdict", "message")
"""Values that are read for each row; the other columns are derived from them."""

AT_LEAST, AT_MOST = "at least", "at most"

STRETCHES_AT_A_TIME, ROWS_AT_A_TIME = 512, 10_000
"""Batch sizes of reading (stretches) and writing (rows). In memory, a text that occurs in many rows is stored once."""

_MANIFEST = b"manifest"


BY_CRITERION = (
    *("group", "criterion", "clips", "broken", "not applicable"),
    *("closest margin", "closest number", "threshold", "unit", "closest clip", "setting", "source", "why"),
)
"""Columns of `by_criterion`. The threshold and its source are those of the stretch with the least margin."""

ORIGIN = ("unit", "setting", "source", "why")
"""Columns on the origin of a threshold."""

MARGINS = (
    *("clip", "start_s", "stop_s", "piece", "group", "criterion", "verdict"),
    *("number", "threshold", "unit", "margin", "source", "message"),
)
"""Columns of `worst_margins`."""


def path_beside(manifest: Path) -> Path:
    """Path of the table that belongs to a stored manifest."""
    return manifest.with_suffix(".criteria.parquet")


def split(manifest: Manifest, origins: Mapping[str, Origin]) -> tuple[Manifest, pd.DataFrame]:
    """Split off the stored evaluations: the manifest without them, and the table of criteria (texts as categories).

    Args:
        manifest: KP5's manifest, with the evaluations among the numbers of each clip
        origins: unit and source of each threshold of data/feasibility.yaml, by its name
    """
    facts = {code: _facts(code, origins) for code in REGISTERED}
    stretches = (stretch for shard in manifest.judged_shards for stretch in _stretches_of_shard(shard, facts))
    judged = Rows([shard.without_number(NUMBER) for shard in manifest.judged_shards])
    return dataclasses.replace(manifest, judged=judged), _table(stretches)


def with_origins(table: pd.DataFrame, origins: Mapping[str, Origin]) -> pd.DataFrame:
    """Update the units and sources of the table's thresholds from `origins`; all its criteria must be registered."""
    criterion = table["criterion"].cat
    facts = [_facts(code, origins) for code in criterion.categories]
    texts = {name: [getattr(each, name) for each in facts] for name in ORIGIN}
    return table.assign(**{name: _texts(own, criterion.codes.to_numpy()) for name, own in texts.items()})


def write(path: Path, table: pd.DataFrame, manifest: Manifest) -> None:
    """Write the table of a manifest atomically; equal tables give equal bytes."""
    schema = pa.schema(list(COLUMNS.items()), metadata={_MANIFEST: manifest.digest.encode()})
    texts = {name: pa.array(table[name].cat.categories, type=pa.string()) for name in TEXTS}
    columns = {name: (table[name].cat.codes if name in texts else table[name]).to_numpy() for name in COLUMNS}
    sink = pa.BufferOutputStream()
    with pq.ParquetWriter(sink, schema, compression="zstd") as writer:
        for start in range(0, len(table), ROWS_AT_A_TIME):
            part = {
                name: pa.array(own[start : start + ROWS_AT_A_TIME], from_pandas=True) for name, own in columns.items()
            }
            arrays = [texts[name].take(own) if name in texts else own for name, own in part.items()]
            writer.write_table(pa.table(arrays, schema=schema))
    atomic.write_bytes(path, sink.getvalue().to_pybytes())


def belongs(path: Path, manifest: Path) -> bool:
    """Whether the file `path` exists and is the table of the manifest stored at `manifest`."""
    try:
        found = (pq.read_schema(path).metadata or {}).get(_MANIFEST)
        return found == digest.of_file(manifest).encode()
    except (OSError, pa.ArrowException):
        return False


def read(
    path: Path, manifest: Path, asset: str = "feasible_motions", columns: Sequence[str] | None = None
) -> pd.DataFrame:
    """Read the table at `path`, with texts as alphabetically sorted categories, as from `split`.

    Raises FileError, which names the asset to materialize, if the table is missing, damaged or of another manifest.

    Args:
        path: file of the table
        manifest: file of the manifest that it must belong to
        asset: the asset that writes the table
        columns: names of the columns to read; None: all
    """
    materialize = f"Run: dagster asset materialize --select {asset}"
    if not belongs(path, manifest):
        problem = (
            "the table of criteria is not of what is stored." if path.is_file() else "there is no table of criteria."
        )
        raise FileError(path, problem, materialize)
    wanted = None if columns is None else list(columns)
    with reported_damage(path, "a table of criteria", materialize):
        table = pq.read_table(path, columns=wanted, read_dictionary=list(TEXTS)).to_pandas()
    return table.assign(**{name: _sorted(table[name]) for name in TEXTS if name in table})


def _sorted(texts: pd.Series) -> pd.Series:
    """Sort categories alphabetically; in a file they are in the order of their first rows."""
    return texts.cat.reorder_categories(texts.cat.categories.sort_values())


def by_criterion(table: pd.DataFrame) -> pd.DataFrame:
    """One row per criterion: number of clips, of clips with a stretch that failed it and of clips it did not apply to,
    and the kept stretch with the least margin."""
    clip, (piece, verdict) = pd.factorize(table["clip"])[0], (table[name].to_numpy() for name in ("piece", "verdict"))
    broken, silent, kept = verdict == BROKEN, verdict == NOT_APPLICABLE, (piece != "") & (verdict == HOLDS)
    places = table.groupby("criterion", observed=True).indices
    rows = []
    for code in [*codes(), *sorted(str(code) for code in places if code not in REGISTERED)]:
        if code not in places:
            continue
        own = places[code]
        asked = set(clip[own[~silent[own]]])
        row = {"group": table["group"].iloc[own[0]], "criterion": code, "clips": len(set(clip[own]))}
        row |= {"broken": len(set(clip[own[broken[own]]])), "not applicable": len(set(clip[own[silent[own]]]) - asked)}
        rows.append({**row, **table[list(ORIGIN)].iloc[own[0]], **_closest(table.iloc[own[kept[own]]])})
    return pd.DataFrame(rows, columns=list(BY_CRITERION))


def worst_margins(table: pd.DataFrame) -> pd.DataFrame:
    """Rows sorted by margin, the worst first, without criteria that did not apply."""
    asked = table.loc[table["verdict"] != NOT_APPLICABLE, list(MARGINS)]
    return asked.sort_values(by=["margin", "clip", "start_s", "criterion"], na_position="first")


def _table(stretches: Iterable[tuple[tuple, list[tuple]]]) -> pd.DataFrame:
    """A data frame of stretches (values of `OF_STRETCH`), each with its rows (`OF_ROW`).

    To save memory, rows are read in batches and not kept: a text is stored as the index of its first occurrence and
    becomes a category.
    """
    places: dict[str, dict[Any, int]] = {name: {} for name in ("facts", *TEXTS)}
    parts: dict[str, list[np.ndarray]] = {name: [np.zeros(0)] for name in (*OF_STRETCH, *OF_ROW)}
    rest = iter(stretches)
    while few := list(itertools.islice(rest, STRETCHES_AT_A_TIME)):
        counts = [len(rows) for _, rows in few]
        for name, values in zip(OF_STRETCH, zip(*(stretch for stretch, _ in few), strict=True), strict=True):
            parts[name].append(np.repeat(_coded(values, places.get(name)), counts))
        rows = [row for _, rows in few for row in rows]
        for name, values in zip(OF_ROW, zip(*rows, strict=True), strict=True):
            parts[name].append(_coded(values, places.get(name)))
    columns = {name: np.concatenate(parts.pop(name)) for name in (*OF_STRETCH, *OF_ROW)}
    facts = columns.pop("facts")
    found = {name: _texts(list(places[name]), own) if name in places else own for name, own in columns.items()}
    found |= {name: _texts([getattr(each, name) for each in places["facts"]], facts) for name in OF_CRITERION}
    sign = np.where(columns["sense"] == places["sense"].get(AT_LEAST, -1), 1.0, -1.0)
    limit = np.where(columns["threshold"] == 0.0, np.nan, columns["threshold"])
    found["margin"] = sign * (columns["number"] - limit) / np.abs(limit)
    return pd.DataFrame({name: found[name] for name in COLUMNS})


def _coded(values: Sequence[Any], known: dict[Any, int] | None) -> np.ndarray:
    """Values as floats (None becomes NaN), or, with `known`, the index of each value in it."""
    if known is None:
        return np.array(values, dtype=float)
    return np.array([known.setdefault(value, len(known)) for value in values], dtype=np.int32)


def _texts(texts: Sequence[str], rows: np.ndarray) -> pd.Categorical:
    """Categorical with `texts` as categories; `rows` are the indices of the rows' texts."""
    names = sorted(set(texts))
    place = {text: index for index, text in enumerate(names)}
    order = np.array([place[text] for text in texts], dtype=np.int32)
    return pd.Categorical.from_codes(order[rows.astype(np.int32)], categories=pd.Index(names, dtype="str"))


@dataclass(frozen=True, kw_only=True, eq=False)
class _Facts:
    """Facts of a criterion that are the same in all its rows."""

    criterion: str
    group: str
    unit: str = ""
    setting: str = ""
    source: str = ""
    why: str = ""
    stated: float | None = None
    """The threshold, if it is the same for all clips."""


OF_CRITERION = ("criterion", "group", *ORIGIN)


def _facts(code: str, origins: Mapping[str, Origin]) -> _Facts:
    setting = REGISTERED[code].limit
    origin = origins[setting]
    return _Facts(
        criterion=code,
        group=REGISTERED[code].group,
        unit=origin.unit,
        setting=setting,
        source=origin.source,
        why=origin.why,
        stated=float(origin.value) if isinstance(origin.value, (int, float)) else None,
    )


def _stretches_of_shard(shard: Shard[Judged], facts: Mapping[str, _Facts]) -> Iterator[tuple[tuple, list[tuple]]]:
    columns = shard.columns(["clip", "reasons", NUMBER, "seconds_in"])
    missing = [MISSING] * shard.count
    texts, seconds = (columns.get(name, missing) for name in (NUMBER, "seconds_in"))
    for clip, reasons, text, seconds_in in zip(columns["clip"], columns["reasons"], texts, seconds, strict=True):
        if text is MISSING:  # the clip could not be evaluated: only the reasons are known
            stop_s = 0.0 if seconds_in is MISSING else float(seconds_in or 0.0)
            if reasons:
                yield (clip, 0.0, stop_s, ""), list(map(_row_of_reason, reasons))
            continue
        for judgement in from_text(str(text)):
            place = (clip, judgement.start_s, judgement.stop_s, judgement.piece)
            yield place, [_row(found, facts[code]) for code, found in judgement.found.items()]


def _row(found: Found, facts: _Facts) -> tuple:
    sense = AT_LEAST if found.lower else AT_MOST
    if found.not_applicable:
        return facts, found.value, facts.stated, sense, NOT_APPLICABLE, found.not_applicable
    return facts, found.value, found.limit, sense, BROKEN if found.broken else HOLDS, found.broken


def _row_of_reason(reason: Mapping[str, Any]) -> tuple:
    return _Facts(criterion=reason["code"], group="can be judged"), None, None, "", BROKEN, reason["text"]


def _closest(own: pd.DataFrame) -> dict[str, Any]:
    """The kept stretch with the smallest margin to a criterion; the first by name if margins are equal."""
    kept = own[own["margin"] == own["margin"].min()]
    if kept.empty:
        return {}
    row = kept.loc[kept["piece"].astype(str).idxmin()]
    found = {"closest margin": row["margin"], "closest number": row["number"], "threshold": row["threshold"]}
    return {**found, "closest clip": row["piece"], **row[list(ORIGIN)]}
