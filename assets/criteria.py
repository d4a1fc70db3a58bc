"""KP5's evidence: the table of criteria, what of it the asset's page shows, and what rollouts tracked."""

from typing import Any

import dagster as dg
import pandas as pd

from assets.plan import Plan
from assets.project import PROJECT
from assets.report import table_of
from pipeline.batch import Manifest
from pipeline.files import settings
from pipeline.files.sourced import Origin, origins


def thresholds() -> dict[str, Origin]:
    """Unit and source of each threshold of data/feasibility.yaml, by its name."""
    return origins(settings.read_yaml(PROJECT.settings("feasibility.yaml")))


def write_table(plan: Plan, table: pd.DataFrame, manifest: Manifest) -> dict[str, Any]:
    """Write the table of a manifest that is about to be stored; what of it the asset's page shows."""
    from pipeline.feasibility import criteria_table
    from pipeline.feasibility.criteria_table import BY_CRITERION, MARGINS, by_criterion, worst_margins

    path = criteria_table.path_beside(PROJECT.store.manifest_path(plan.key.to_user_string()))
    criteria_table.write(path, table, manifest)
    return {
        "table of criteria": dg.MetadataValue.path(str(path)),
        "criteria": table_of(by_criterion(table), BY_CRITERION),
        "margins, the worst first": table_of(worst_margins(table), MARGINS),
    }


def references_of(manifest: Manifest, reference_motions: Manifest | None = None) -> Any:
    """The motions that rollouts among the clips of a manifest tracked, from the store, for any process.

    `reference_motions` has those of KP4's own rollouts, by name.
    """
    from pipeline.feasibility.reference import CONTENT, StoredReferences

    wanted = {str(entry.numbers[CONTENT]): entry.numbers for entry in manifest.entries if entry.numbers.get(CONTENT)}
    blobs = {entry.clip: entry.blob for entry in reference_motions.entries} if reference_motions else {}
    for content, numbers in sorted(wanted.items()):
        found = _reference(str(numbers["source"]), str(numbers["file"]))
        if found is not None and found.content == content:
            blobs[content] = PROJECT.store.put_clip(found.clip)
    return StoredReferences(store=PROJECT.store, blobs=blobs)


def _reference(source_name: str, file: str) -> Any:
    """The motion that a source's file names, as it is now; None where it is none any more."""
    from pipeline.errors import PipelineError
    from pipeline.readers.tracked import load_reference, named_reference

    try:
        source = next(source for source in PROJECT.sources().all if source.name == source_name)
        named = named_reference(source.folder / file, source)
        return None if named is None else load_reference(source.folder / file, source, named)
    except (PipelineError, OSError, StopIteration):
        return None
