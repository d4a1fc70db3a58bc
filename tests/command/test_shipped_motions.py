"""The shipped motions through the whole graph: what must happen to each clip by its sidecar, and what comes out."""

import pandas as pd
import pytest

from pipeline.batch import Manifest, Store
from pipeline.expert import read_database
from pipeline.files.settings import read_yaml
from pipeline.selection import SKILLS
from tests.factories.checkout import Checkout

pytestmark = pytest.mark.command


@pytest.fixture(scope="module")
def shipped(root, tmp_path_factory) -> Checkout:
    """A checkout with all shipped motions, materialized by the README's command.

    It need not repeat what `make expert_db` did here, as CI does before the tests.
    """
    names = tuple(path.stem for path in (root / "data/motions").glob("*.bvh"))
    checkout = Checkout.make(root, tmp_path_factory.mktemp("shipped"), names).with_answers_of(root)
    checkout.materialize()
    return checkout


@pytest.fixture(scope="module")
def sidecars(root) -> dict[str, dict]:
    """Name of a shipped clip -> its sidecar."""
    return {path.stem: read_yaml(path) for path in sorted((root / "data/motions").glob("*.yaml"))}


@pytest.fixture(scope="module")
def index(shipped) -> pd.DataFrame:
    """The database's index, of each motion its undisturbed rollout alone, without variants."""
    table = pd.read_parquet(shipped.root / "data/expert_db/t1/index.parquet")
    return table[(table["variant"] == "original") & (table["rollout"] == 0)]


def stages(checkout: Checkout) -> dict[str, Manifest]:
    store = Store(root=checkout.root / "data/store")
    return {
        name: store.load(name)
        for name in ("motion_catalog", "selected_motions", "repaired_motions", "retargeted_motions", "feasible_motions")
    }


def said_of(checkout: Checkout, clip: str, effect: str) -> set[str]:
    """Codes of all that was said of a shipped clip up to KP3, with an effect."""
    manifests = [manifest for name, manifest in stages(checkout).items() if name != "feasible_motions"]
    rows = [row for manifest in manifests for row in manifest.judged]
    mine = [row for row in rows if row.clip.split("@")[0] == f"booster_lab/{clip}"]
    return {reason["code"] for row in mine for reason in row.reasons if reason["effect"] == effect}


def test_nine_tenths_of_the_sound_seconds_reach_the_database(index, sidecars, shipped):
    catalog = {row.clip: row.numbers["seconds_in"] for row in stages(shipped)["motion_catalog"].judged}
    sound = [name for name in sidecars if not name.startswith("defect_")]
    kept = index[index["source_file"].isin([f"{name}.bvh" for name in sound])]["seconds"].sum()
    assert kept >= 0.9 * sum(catalog[f"booster_lab/{name}"] for name in sound)


def test_every_skill_has_four_seconds_before_mirroring(index):
    seconds = index.groupby("skill")["seconds"].sum()
    assert {skill: seconds.get(skill, 0.0) for skill in SKILLS if seconds.get(skill, 0.0) < 4.0} == {}


def test_to_each_defect_clip_happens_what_its_sidecar_says(index, sidecars, shipped):
    for name, sidecar in sidecars.items():
        expect = sidecar["expect"]
        kept = index[index["source_file"] == f"{name}.bvh"]["seconds"].sum()
        told = said_of(shipped, name, "rejected") | said_of(shipped, name, "repaired")
        assert set(expect["reasons"]) | set(expect["repaired"]) <= told, name
        assert (kept > 0.0) == (expect["fate"] != "rejected"), name
        for skill, seconds in expect["skills"].items():
            found = index[(index["source_file"] == f"{name}.bvh") & (index["skill"] == skill)]["seconds"].sum()
            assert found == pytest.approx(seconds, abs=0.15 * seconds + 0.7), (name, skill)


def test_nothing_of_the_planted_stretches_is_in_the_database(index, sidecars):
    for name, sidecar in sidecars.items():
        for defect in sidecar.get("defects", []):
            if defect["effect"] == "repaired":
                continue
            for row in index[index["source_file"] == f"{name}.bvh"].to_dict("records"):
                start_s, stop_s = row["start_frame"] / row["fps"], row["stop_frame"] / row["fps"]
                overlap_s = min(stop_s, defect["stop_s"]) - max(start_s, defect["start_s"])
                assert overlap_s <= 0.04, (row["clip"], defect)


def test_the_database_is_whole_and_says_what_it_may_be_used_for(shipped):
    database = read_database(shipped.root / "data/expert_db/t1")
    assert database.manifest["frame_columns"] == 79
    assert database.manifest["licence"]["strictest"] == "public-domain"
    assert all(clip.frames.shape[1] == 79 for clip in database.clips)


def test_two_checkouts_give_the_same_bytes(shipped, root, tmp_path):
    again = Checkout.make(root, tmp_path / "again", ("curve_left",))
    again.materialize()
    names = {name for name in shipped.database() if name.startswith("booster_lab__curve_left@")}
    assert names == {name for name in again.database() if name.endswith(".json")}
    for name in names:
        assert frames_of(again, name) == frames_of(shipped, name)


def frames_of(checkout: Checkout, name: str) -> str:
    """Text of a database file's frames; weights before them depend on what else is in the database."""
    return (checkout.root / "data/expert_db/t1" / name).read_text().split('"Frames"')[1]
