"""Real recordings through the whole graph: each file has a fate, no noted defect is let in, sound motion is kept."""

import json
import re
from pathlib import Path

import pandas as pd
import pytest

from pipeline.batch import Store
from tests.factories.checkout import Checkout

pytestmark = [pytest.mark.command, pytest.mark.shared]

DEFECTIVE = {
    "cmu_asfamc/02_01.amc",
    "cmu_bvh/02_03.bvh",
    "cmu_bvh/cmu_12_01_walk.bvh",
    "isaaclab_amp/humanoid_walk.npz",
    "misc_bvh/wspr_walk.bvh",
    "pfnn/LocomotionFlat04_000.bvh",
    "t1_arenax/running.npz",
    "t1_arenax/walking2.npz",
}
"""Files with a defect noted in `index.csv`: foreign bones, wrong or doubled time base, bind poses, loss, limits."""


@pytest.fixture(scope="module")
def real(root, mocap, tmp_path_factory) -> Checkout:
    """A checkout without the shipped motions, materialized on the recordings; variants are left out for speed."""
    checkout = Checkout.make(root, tmp_path_factory.mktemp("real"), ())
    (checkout.root / "data/motions").mkdir(exist_ok=True)
    augment = checkout.root / "data/augment.yaml"
    augment.write_text(augment.read_text().replace("mirror: true", "mirror: false").replace("[0.9, 1.1]", "[]"))
    checkout.materialize(BOOSTER_LAB_MOTIONS=str(mocap))
    return checkout


@pytest.fixture(scope="module")
def index(real) -> pd.DataFrame:
    return pd.read_parquet(real.root / "data/expert_db/t1/index.parquet")


def test_every_file_ends_with_a_fate_and_a_reason(real, mocap):
    store = Store(root=real.root / "data/store")
    files = pd.read_csv(mocap / "index.csv")["file"]
    judged = {row.numbers.get("file"): row for row in store.load("motion_catalog").judged}
    assert set(files) <= set(judged)
    for name in ("motion_catalog", "selected_motions", "repaired_motions", "retargeted_motions", "feasible_motions"):
        for row in store.load(name).judged:
            assert row.fate == "accepted" or row.reasons, (name, row.clip)
            assert not any(reason["code"] == "failed" for reason in row.reasons), (name, row.clip)


def test_the_files_known_to_be_defective_are_those_that_the_index_notes(mocap):
    notes = pd.read_csv(mocap / "index.csv").set_index("file")["notes"].fillna("")
    words = "WRONG|wrong|T-pose|TRACKING LOSS|TWICE|limit passed|transient"
    assert {file for file, note in notes.items() if re.search(words, note)} == DEFECTIVE


def test_no_noted_defect_is_in_the_database(index):
    def inside(file: str, first: int, last: int) -> list[str]:
        rows = index[index["source_file"] == file]
        return list(rows[(rows["start_frame"] <= last) & (rows["stop_frame"] > first)]["clip"])

    assert "cmu_asfamc/02_01.amc" not in set(index["source_file"])
    for file in ("cmu_bvh/cmu_12_01_walk.bvh", "misc_bvh/wspr_walk.bvh", "cmu_bvh/02_03.bvh"):
        assert inside(file, 0, 0) == []
    assert inside("pfnn/LocomotionFlat04_000.bvh", 2332, 2427) == []
    rates = index.set_index("source_file")["fps"]
    assert set(rates.get(["cmu_bvh/02_03.bvh"], pd.Series(dtype=float))) <= {120.0}
    assert set(index[index["source_file"] == "isaaclab_amp/humanoid_walk.npz"]["fps"]) <= {30.0}
    assert (index["joint_limit_excess"] <= 0.05).all()


def test_nine_tenths_of_the_labelled_seconds_are_worth_tracking(real, mocap):
    references = Store(root=real.root / "data/store").load("reference_motions").entry_table()
    assert share_kept(references.rename(columns={"file": "source_file"}), mocap) >= 0.9


def test_of_recordings_that_the_tracker_was_not_trained_on_a_third_reaches_the_database(index, mocap):
    assert share_kept(index, mocap) >= 0.33


def share_kept(clips: pd.DataFrame, mocap: Path) -> float:
    """Share of the labelled seconds of sound recordings that at least one clip covers."""
    labels = pd.read_csv(mocap / "segments.csv")
    rates = pd.read_csv(mocap / "index.csv").set_index("file")["fps"]
    labels = labels[~labels["file"].isin(DEFECTIVE)]
    kept_s = sum(
        covered_seconds(clips[clips["source_file"] == row.file], row.first_frame, row.last_frame, rates[row.file])
        for row in labels.itertuples()
    )
    return kept_s / labels["seconds"].sum()


def covered_seconds(clips: pd.DataFrame, first: int, last: int, fps: float) -> float:
    """Seconds of the source's frames [first, last] that clips cover; those that several cover count once."""
    starts_s = clips["start_frame"] / fps + clips["stretch_start_s"]
    stops_s = clips["start_frame"] / fps + clips["stretch_stop_s"]
    total_s, reached_s = 0.0, first / fps
    for start_s, stop_s in sorted(zip(starts_s, stops_s, strict=True)):
        stop_s = min(stop_s, (last + 1) / fps)
        total_s += max(0.0, stop_s - max(start_s, reached_s))
        reached_s = max(reached_s, stop_s)
    return total_s


def test_the_strictest_licence_is_that_of_the_recordings(real):
    manifest = json.loads((real.root / "data/expert_db/t1/manifest.json").read_text())
    assert manifest["licence"]["strictest"] == "unknown"


def test_without_motions_the_last_database_stays_and_the_run_says_so(real):
    """No clip is left, which is no database; the recordings' one is not replaced."""
    database = real.database()
    assert real.run("booster-lab", "sources", "forget", "mocap").returncode == 0
    done = real.run("dagster", "asset", "materialize", "--select", "expert_db")
    assert done.returncode != 0
    assert "no clip is left after KP5" in done.stdout + done.stderr
    assert real.database() == database
