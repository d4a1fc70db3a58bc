"""KP5's evidence: the table of criteria beside the manifest, and what of it the asset's page shows."""

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
    from pipeline.feasibility.criteria_summary import BY_CRITERION, MARGINS, by_criterion, worst_margins

    path = criteria_table.path_beside(PROJECT.store.manifest_path(plan.key.to_user_string()))
    criteria_table.write(path, table, manifest)
    return {
        "table of criteria": dg.MetadataValue.path(str(path)),
        "criteria": table_of(by_criterion(table), BY_CRITERION),
        "margins, the worst first": table_of(worst_margins(table), MARGINS),
    }
