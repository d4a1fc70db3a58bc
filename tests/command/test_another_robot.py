"""A third robot is a folder: imported from a model file, checked and retargeted, with the code as it is."""

from __future__ import annotations

import csv
from pathlib import Path

import dagster as dg
import pytest

from pipeline.batch import Store
from pipeline.files import digest
from tests.factories.booster_2026 import joint_names, newer_urdf
from tests.factories.checkout import Checkout

pytestmark = pytest.mark.command

ROBOT = "t1_of_2026"
SHARED = ("motion_catalog", "selected_motions", "repaired_motions")


def code_of(checkout: Checkout) -> str:
    """Digest of the code."""
    files = [path for folder in ("pipeline", "assets") for path in (checkout.root / folder).rglob("*.py")]
    return digest.of_files(sorted(files), checkout.root)


def stated(root: Path, path: Path) -> Path:
    """What a model file does not state of the T1, under the newer names."""
    names = joint_names()
    with (root / "robots/t1/joints.csv").open() as stream, path.open("w", newline="") as out:
        writer = csv.writer(out)
        columns = ("controlled", "motor_speed", "armature", "kp", "kd", "default_pos")
        writer.writerow(("joint", *columns))
        for row in csv.DictReader(stream):
            writer.writerow((names[row["joint"]], *(row[column] for column in columns)))
    return path


def times(checkout: Checkout, *keys: dg.AssetKey) -> list[int]:
    """How often assets were materialized."""
    with checkout.instance() as instance:
        return [len(instance.fetch_materializations(key, limit=100).records) for key in keys]


def test_a_robot_folder_reaches_retargeted_motions_without_a_change_of_code(root: Path, tmp_path: Path):
    checkout = Checkout.make(root, tmp_path / "checkout", ("stand",))
    code = code_of(checkout)

    def run(*command: str) -> str:
        done = checkout.run(*command)
        assert done.returncode == 0, done.stdout[-3000:] + done.stderr[-3000:]
        return done.stdout + done.stderr

    run("dagster", "asset", "materialize", "--select", "retargeted_motions")
    model, table = newer_urdf(tmp_path / "T1_23dof.urdf"), stated(root, tmp_path / "stated.csv")
    run("booster-lab", "import-robot", str(model), "--name", ROBOT, "--joints", str(table))
    assert "no findings" in run("booster-lab", "check-robot", f"robots/{ROBOT}")
    run("dagster", "asset", "materialize", "--select", f"{ROBOT}/retargeted_motions")
    shared = [dg.AssetKey([name]) for name in SHARED]
    own = dg.AssetKey([ROBOT, "retargeted_motions"])
    assert times(checkout, *shared, own) == [1, 1, 1, 1]
    store = Store(root=checkout.root / "data/store")
    first, other = (store.load(name) for name in ("retargeted_motions", f"{ROBOT}/retargeted_motions"))
    assert [each.clip for each in other.entries] == [each.clip for each in first.entries] != []
    assert all(each.numbers["limb_error_deg"] < 3.0 for each in other.entries)
    assert code_of(checkout) == code
