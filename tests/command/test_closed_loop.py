"""A log is dropped; what failed in it changes the next database, when a person approves. One checkout, one story."""

import json
import shutil
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import dagster as dg
import numpy as np
import pandas as pd
import pytest

from pipeline.feasibility import FeasibilitySettings
from pipeline.feedback.cell_weights import cell_parts
from pipeline.files import digest, settings
from tests.factories.checkout import Checkout
from tests.factories.web_ui import web_ui

pytestmark = pytest.mark.command

CELL = "0.0 m/s, 0.4 m/s, 0.0 rad/s"
PATIENCE_S = 600.0
"""Of a test on a busy machine; on an idle one a log is ingested within a minute."""


def test_what_failed_in_a_dropped_log_weighs_more_in_the_next_database(root, tmp_path):
    checkout = Checkout.make(root, tmp_path / "checkout", ("stand", "side_left"))
    logs = checkout.root / "data/hardware_logs"
    for path in logs.glob("*.mcap"):
        path.unlink()
    checkout.materialize()
    before, counts, database = _index(checkout), checkout.counts(), checkout.database()
    assert _metadata(checkout, "curation_feedback") is None, "the database needs no logs"
    with web_ui(checkout) as page:
        log = logs / "side_left_fall.mcap"
        shutil.copy2(root / "data/hardware_logs" / log.name, log)
        proposed = _wait_for(lambda: _metadata(checkout, "curation_feedback"))
        assert checkout.counts()["expert_db"] == counts["expert_db"], "nothing takes effect unseen"
        assert proposed["changes pending"] > 0
        proposal = proposed["proposal"]
        approval = {"proposal": proposal, "by": "a person", "sections": ["weights"]}
        assert page.launch("approve_feedback", {"ops": {"approve": {"config": approval}}}) == "SUCCESS"
        _wait_for(lambda: checkout.counts()["expert_db"] > counts["expert_db"])
    made = {name for name, count in checkout.counts().items() if count > counts[name]}
    assert made == {"feasible_motions", "expert_db"}, "weights touch nothing else"
    assert checkout.recomputed()["feasible_motions"] == 0
    after = _index(checkout)
    share, raised = _share(checkout, before), _share(checkout, after)
    factor = 1.25  # of one log, data/feedback_rules.yaml
    assert raised == pytest.approx(factor * share / (1.0 + (factor - 1.0) * share), rel=1e-6)
    assert database.keys() == checkout.database().keys(), "the same clips"
    _leads_back_to(checkout, log)


def _index(checkout: Checkout) -> pd.DataFrame:
    return pd.read_parquet(checkout.root / "data/expert_db/t1/index.parquet")


def _share(checkout: Checkout, index: pd.DataFrame) -> float:
    """Share of draws that land in the cell: a clip by its weight, then a time within it."""
    balance = settings.read(checkout.root / "data/feasibility.yaml", FeasibilitySettings).balance
    weight = index["weight"].to_numpy()
    return float(np.sum(weight * cell_parts(index, [CELL], balance)[:, 0]) / np.sum(weight))


def _leads_back_to(checkout: Checkout, log: Path) -> None:
    """The database's manifest names the change, and the log by its bytes."""
    manifest = json.loads((checkout.root / "data/expert_db/t1/manifest.json").read_text())
    (stage,) = [each for each in manifest["stages"].values() if each.get("stage") == "feedback on weights"]
    (change,) = stage["changes"]
    assert (change["what"], change["value"]) == (CELL, 1.25)
    (witness,) = change["witnesses"]
    assert witness["sha256"] == digest.of_file(log)
    assert witness["simulated"] and "fall left" in witness["said"]


def _metadata(checkout: Checkout, name: str) -> dict[str, Any] | None:
    """Of the newest materialization of an asset."""
    with checkout.instance() as instance:
        event = instance.get_latest_materialization_event(dg.AssetKey([name]))
    if event is None or event.asset_materialization is None:
        return None
    return {key: value.value for key, value in event.asset_materialization.metadata.items()}


def _wait_for(found: Callable[[], Any]) -> Any:
    stop = time.monotonic() + PATIENCE_S
    while time.monotonic() < stop:
        value = found()
        if value:
            return value
        time.sleep(1.0)
    raise TimeoutError(f"nothing came of it in {PATIENCE_S:g} s")
