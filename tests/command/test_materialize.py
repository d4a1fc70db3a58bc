"""The README's command, typed literally, after each kind of change. One checkout, one story."""

import json
import os
import re
import shutil
import signal

import pytest

from pipeline.actuators.synthesize import SAG, Curve, measurement_text
from pipeline.expert import read_database
from tests.factories.checkout import ASSETS, Checkout

pytestmark = pytest.mark.command

FEW = {"stand": 120, "curve_left": 200, "side_left": 90}
"""Shipped motions that the checkout starts with, and how many frames of them."""
EVALUATING = ("reference_motions", "augmented_motions", "feasible_motions")
"""Stages that depend on data/feasibility.yaml and work on clips."""


@pytest.fixture(scope="module")
def checkout(root, tmp_path_factory) -> Checkout:
    """A checkout in which nothing was ever materialized."""
    return Checkout.make(root, tmp_path_factory.mktemp("checkout"), tuple(FEW)).with_less_to_do(FEW)


@pytest.fixture(scope="module")
def materialized(checkout) -> Checkout:
    """The checkout after the first command."""
    checkout.materialize()
    return checkout


def made_since(checkout: Checkout, before: dict[str, int]) -> dict[str, int]:
    """How often assets were materialized since the counts `before`, of those that were."""
    return {name: count - before[name] for name, count in checkout.counts().items() if count > before[name]}


def turned(text: str, yaw_deg: float) -> str:
    """A BVH file whose first channel is shifted."""
    head, rows = text.split("Frame Time:", 1)
    lines = rows.splitlines()
    lines[1:] = [" ".join([f"{float(line.split()[0]) + yaw_deg:.5f}", *line.split()[1:]]) for line in lines[1:]]
    return head + "Frame Time:" + "\n".join(lines) + "\n"


def test_a_fresh_clone_gets_a_database_from_one_command(materialized):
    assert materialized.counts() == dict.fromkeys(ASSETS, 1)
    assert materialized.clips() == {f"{name}.bvh" for name in FEW}


def test_without_a_change_or_with_a_remark_alone_nothing_is_stale(materialized):
    before, database = materialized.counts(), materialized.database()
    path = materialized.root / "data/feasibility.yaml"
    path.write_text(path.read_text() + "\n# a remark\n")
    printed = materialized.materialize()
    assert "nothing is stale" in printed
    assert materialized.counts() == before
    assert materialized.database() == database
    assert set(materialized.newest_checks().values()) <= {"SUCCEEDED", "FAILED"}, "a plan hides the verdicts"
    assert len(materialized.newest_checks()) == 3


def test_a_clip_added_or_changed_is_worked_on_alone_and_a_deleted_one_leaves_the_database(materialized):
    database, motions = materialized.database(), materialized.root / "data/motions"
    shutil.copy2(motions / "side_left.bvh", motions / "added.bvh")
    changed = motions / "curve_left.bvh"
    text = changed.read_text()
    changed.write_text(turned(text, 12.5))
    materialized.materialize()
    assert "added.bvh" in materialized.clips()
    added, other = materialized.clips_from("added"), materialized.clips_from("curve_left")
    assert materialized.recomputed() == {stage: added[stage] + other[stage] for stage in added}
    (motions / "added.bvh").unlink()
    changed.write_text(text)
    materialized.materialize()
    assert "added.bvh" not in materialized.clips()
    assert set(materialized.recomputed().values()) == {0}
    assert materialized.database() == database


def test_a_threshold_changed_recomputes_from_its_stage_on_though_the_first_run_is_killed(materialized):
    before, database = materialized.counts(), materialized.database()
    path = materialized.root / "data/feasibility.yaml"
    text = path.read_text()
    path.write_text(re.sub(r"min_seconds: \{value: [0-9.]+", "min_seconds: {value: 0.77", text))
    assert path.read_text() != text
    process = materialized.start("dagster", "asset", "materialize", "--select", "expert_db")
    marker = "feasible_motions: "
    assert any(marker in line for line in process.stdout), "the run ended before KP5"
    os.killpg(process.pid, signal.SIGKILL)
    process.wait()
    assert materialized.database() == database, "the last version stays"
    read_database(materialized.root / "data/expert_db/t1")
    materialized.materialize()
    assert materialized.started_runs() == [], "the killed run counts as failed"
    made = made_since(materialized, before).keys() - {"tracking_policy"}
    assert made == {"reference_motions", "augmented_motions", "feasible_motions", "expert_db"}
    assert materialized.recomputed()["feasible_motions"] > 0
    path.write_text(text)
    materialized.materialize()
    assert materialized.recomputed()["feasible_motions"] == 0
    assert materialized.database() == database


def test_what_changes_no_verdict_is_written_again_and_no_clip_is_evaluated(materialized):
    """A cell of the commands, the explanation of a limit, and a lost table of verdicts."""
    before, database = materialized.counts(), materialized.database()
    table = materialized.root / "data/store/manifests/feasible_motions.criteria.parquet"
    written = table.read_bytes()
    commands = materialized.replace(
        "data/commands.yaml", "yaw_rate: {value: [-1.5, 1.5, 0.5]", "yaw_rate: {value: [-1.5, 1.5, 1.5]"
    )
    materialized.materialize()
    assert made_since(materialized, before).keys() == {"feasible_motions", "expert_db"}
    assert materialized.recomputed()["feasible_motions"] == 0
    stages = json.loads((materialized.root / "data/expert_db/t1/manifest.json").read_text())["stages"].values()
    assert [each["yaw_rate"] for each in stages if "yaw_rate" in each] == [[-1.5, 1.5, 1.5]]

    (materialized.root / "data/commands.yaml").write_text(commands)
    before = materialized.counts()
    limits = materialized.replace("data/feasibility.yaml", "A fall is 60 degrees.", "A fall is more.")
    materialized.materialize()
    assert {materialized.recomputed()[name] for name in EVALUATING} == {0}
    assert table.read_bytes() != written

    (materialized.root / "data/feasibility.yaml").write_text(limits)
    table.unlink()
    materialized.materialize()
    made = dict.fromkeys((*EVALUATING, "tracking_policy"), 2) | {"expert_db": 1}  # by the commands alone
    assert made_since(materialized, before) == made
    assert {materialized.recomputed()[name] for name in EVALUATING} == {0}
    assert table.read_bytes() == written
    assert materialized.database() == database


def test_code_changed_recomputes_from_its_stage_on(materialized):
    before = materialized.counts()
    path = materialized.root / "pipeline/augment/__init__.py"
    path.write_text(path.read_text() + "\nCHANGED = True\n")
    printed = materialized.materialize()
    assert "'motion_variants' is brought up to date first: its code, settings or robot changed" in printed
    counts = materialized.counts()
    assert counts["motion_variants"] == before["motion_variants"] + 1
    assert counts["retargeted_motions"] == before["retargeted_motions"]
    assert materialized.recomputed()["motion_variants"] > 0


def test_a_folder_of_the_environment_stays_until_it_is_forgotten(materialized, tmp_path):
    takes = tmp_path / "takes"
    takes.mkdir()
    shutil.copy2(materialized.root / "data/motions/curve_left.bvh", takes / "mine.bvh")
    materialized.materialize(BOOSTER_LAB_MOTIONS=str(takes))
    assert "mine.bvh" in materialized.clips()
    assert materialized.recomputed()["motion_catalog"] == 1
    printed = materialized.materialize()
    assert "source 'takes'" in printed
    assert "BOOSTER_LAB_MOTIONS does not name it now" in printed
    assert "mine.bvh" in materialized.clips()
    database = materialized.database()
    takes.rename(tmp_path / "moved")
    done = materialized.run("dagster", "asset", "materialize", "--select", "expert_db")
    assert done.returncode != 0
    assert "is not a folder any more. The clips of 1 motion files would leave" in done.stdout + done.stderr
    assert materialized.database() == database
    assert materialized.run("booster-lab", "sources", "forget", "takes").returncode == 0
    materialized.materialize()
    assert "mine.bvh" not in materialized.clips()


def test_a_database_that_was_tampered_with_is_written_again(materialized):
    database = materialized.database()
    victim = materialized.root / "data/expert_db/t1" / next(name for name in database if name.endswith(".json"))
    victim.write_text("{}")
    materialized.materialize()
    assert materialized.database() == database
    assert victim.read_text() != "{}"


def test_an_empty_folder_of_the_environment_is_named_in_one_sentence(materialized, tmp_path):
    done = materialized.run(
        "dagster", "asset", "materialize", "--select", "expert_db", BOOSTER_LAB_MOTIONS=str(tmp_path / "gone")
    )
    assert done.returncode != 0
    assert "BOOSTER_LAB_MOTIONS names it, but it is not a folder" in done.stdout + done.stderr


def test_a_broken_settings_file_is_told_in_one_sentence(materialized):
    text = materialized.replace("data/repair.yaml", "min_seconds:", "min_secnods:")
    done = materialized.run("dagster", "asset", "materialize", "--select", "expert_db")
    (materialized.root / "data/repair.yaml").write_text(text)
    assert done.returncode != 0
    assert "repair.yaml: unknown key 'min_secnods'" in done.stdout + done.stderr


def test_the_shipped_folder_named_again_in_the_environment_changes_nothing(materialized):
    before = materialized.counts()
    printed = materialized.materialize(BOOSTER_LAB_MOTIONS=str(materialized.root / "data/motions"))
    assert "nothing is stale" in printed
    assert materialized.counts() == before


def test_a_measurement_changed_calibrates_its_motor_and_remakes_what_depends_on_the_model(materialized):
    before, database = materialized.counts(), materialized.database()
    path = materialized.root / "data/actuators/t1/knee.csv"
    text = path.read_text()
    weak = Curve(knee_torque=40.0, knee_speed=12.57, sag=SAG, source="a weaker knee")
    path.write_text(measurement_text("knee", weak))
    materialized.materialize()
    assert made_since(materialized, before).keys() - {"tracking_policy"} == {
        *("actuator_calibration", "adapted_robot", "reference_motions", "augmented_motions"),
        *("feasible_motions", "expert_db"),
    }
    history = materialized.history()
    assert history["actuator_calibration"][0]["motors recomputed"] == "knee"
    assert history["adapted_robot"][0]["joints changed"].endswith("Left_Knee_Pitch, Right_Knee_Pitch")
    assert materialized.recomputed()["feasible_motions"] > 0
    path.write_text(text)
    materialized.materialize()
    assert materialized.history()["actuator_calibration"][0]["motors recomputed"] == "none"
    assert materialized.recomputed()["feasible_motions"] == 0
    assert materialized.database() == database
