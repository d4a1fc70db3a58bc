"""All faulty files at once through the catalogue's stage, and faults of a database: what was there still loads."""

import json
import logging
import re
import shutil
from functools import partial
from pathlib import Path

import numpy as np
import pytest

from pipeline.batch import ClipPool, Manifest, Stage, Store, run_files
from pipeline.catalog import CatalogSettings, catalogue_file
from pipeline.expert import DatabaseError, ExpertEntry, read_database, write_database
from pipeline.files import digest, settings
from pipeline.readers import Source
from pipeline.robot import load_robot
from tests.factories import mutants_bvh, mutants_npz, mutants_text
from tests.factories.mutant import REFUSED, understood
from tests.factories.robot_clips import wandering

ROOT = Path(__file__).resolve().parents[2]
LOG = logging.getLogger("faults")
T1 = load_robot("t1")
CLEAN = [
    understood("walk.bvh", {"clean": mutants_bvh.CLEAN})[0],
    understood("walk.npz", {"clean": mutants_npz.packed(mutants_npz.arrays())})[0],
    understood("robot.csv", {"clean": mutants_text.robot_csv()})[0],
]


def run(files, store) -> Manifest:
    """The catalogue's stage on files of one source."""
    values = settings.read(ROOT / "data/catalog.yaml", CatalogSettings)
    stage = Stage(name="motion_catalog", version="1", function=partial(catalogue_file, settings=values))
    jobs = []
    for path in files:
        source = Source(name="mine", folder=path.parent, licence="CC0-1.0")
        content = digest.of_json([path.name, str(path.parent)])
        jobs.append((f"mine/{path.parent.name}", path, content, (source, path.name)))
    return run_files(stage, jobs, store, ClipPool(backend="sequential"), LOG)


def test_faulty_files_fail_alone_and_leave_what_was_stored(tmp_path):
    store = Store(root=tmp_path / "store")
    clean = [mutant.put(tmp_path / f"clean{index}") for index, mutant in enumerate(CLEAN)]
    before = run(clean, store)
    mutants = [
        *mutants_bvh.bvh_mutants(),
        *mutants_text.amc_mutants(),
        *mutants_text.deepmimic_mutants(),
        *mutants_text.csv_mutants(),
        *mutants_npz.npz_mutants(),
    ]
    faulty = [mutant.put(tmp_path / f"mutant{index}") for index, mutant in enumerate(mutants)]
    after = run([*faulty, *clean], store)
    judged = {row.clip: row for row in after.judged}
    assert len(judged) == len(after.judged) == len(mutants) + len(CLEAN)
    for path, mutant in zip(faulty, mutants, strict=True):
        row = judged[f"mine/{path.parent.name}"]
        assert all(reason["code"] != "failed" for reason in row.reasons), (mutant.name, row.reasons)
        if mutant.want == REFUSED:
            assert not row.pieces, mutant.name
            assert [reason["code"] for reason in row.reasons] == ["unreadable"], (mutant.name, row.reasons)
    assert after.recomputed == len(mutants)
    kept = {entry.clip: entry.blob for entry in after.entries}
    for entry in before.entries:
        assert kept[entry.clip] == entry.blob
        assert store.get_clip(entry.blob, entry.clip).frame_count > 1


@pytest.fixture(scope="module")
def database(tmp_path_factory) -> Path:
    """A whole database of two clips."""
    folder = tmp_path_factory.mktemp("database") / "t1"
    entries = [
        ExpertEntry(
            clip=wandering(T1, seed=index).cut(0, 60, f"source/clip{index}"),
            weight=1.0,
            skill="walk",
            licence="CC0-1.0",
            numbers={"file": "source/clip.bvh", "file_sha256": "ab"},
            stages={},
        )
        for index in range(2)
    ]
    write_database(folder, entries, T1, stages={})
    return folder


def _json(change):
    def mutate(path: Path) -> None:
        content = json.loads(path.read_text())
        changed = change(content)
        path.write_text(json.dumps(content if changed is None else changed))

    return mutate


def _bytes(change):
    return lambda path: path.write_bytes(change(path.read_bytes()))


DAMAGES = {
    "cut": _bytes(lambda data: data[: len(data) // 2]),
    "emptied": _bytes(lambda _: b""),
    "a bit turned": _bytes(lambda data: data[:200] + bytes([data[200] ^ 1]) + data[201:]),
    "zeros": _bytes(lambda data: bytes(len(data))),
    "doubled": _bytes(lambda data: data + data),
    "another kind of file": _bytes(lambda _: b"\x89PNG\r\n\x1a\n"),
    "10,000 deep": _bytes(lambda _: b"[" * 10_000 + b"]" * 10_000),
    "deleted": Path.unlink,
    "a folder": lambda path: (path.unlink(), path.mkdir()),
    "a link to the password file": lambda path: (path.unlink(), path.symlink_to("/etc/passwd")),
}
CLIP_DAMAGES = {
    "NaN": _bytes(lambda data: data.replace(b"0.0", b"NaN", 1)),
    "1e999": _bytes(lambda data: data.replace(b"0.0", b"1e999", 1)),
    "a frame cut": _json(lambda clip: clip["Frames"][3].pop() and None),
    "no frames": _json(lambda clip: clip.update(Frames=[])),
    "a weight below zero": _json(lambda clip: clip.update(MotionWeight=-1.0)),
    "quaternions of length 2": _json(lambda clip: clip["Frames"][0].__setitem__(slice(3, 7), [2.0, 0.0, 0.0, 0.0])),
    "a list": _json(lambda clip: [clip]),
}
MANIFEST_DAMAGES = {
    "another schema": _json(lambda head: head.update(schema="0")),
    "no files": _json(lambda head: head.pop("files") and None),
    "a file that climbs": _json(lambda head: head["files"].update({"../../etc/passwd": "00"})),
    "a thousand clips more": _json(lambda head: head.update(clips=1002)),
}
CASES = [
    *((file, name, damage) for file in ("manifest.json", "index.parquet", "clip") for name, damage in DAMAGES.items()),
    *(("clip", name, damage) for name, damage in CLIP_DAMAGES.items()),
    *(("manifest.json", name, damage) for name, damage in MANIFEST_DAMAGES.items()),
]


@pytest.mark.parametrize(
    ("file", "damage"), [(file, damage) for file, _, damage in CASES], ids=[f"{file} {name}" for file, name, _ in CASES]
)
def test_a_damaged_database_is_not_read_and_says_which_file(tmp_path, database, file, damage):
    folder = shutil.copytree(database, tmp_path / "t1", symlinks=True)
    path = next(each for each in sorted(folder.iterdir()) if each.suffix == ".json" and each.name != "manifest.json")
    path = path if file == "clip" else folder / file
    damage(path)
    with pytest.raises(DatabaseError) as raised:
        read_database(folder)
    others = r"index\.parquet|source__clip\d\.json|passwd"  # what a manifest says falsely shows at what it speaks of
    assert re.search(re.escape(path.name) + (f"|{others}" if file == "manifest.json" else ""), str(raised.value))
    assert "Traceback" not in str(raised.value)
    before = read_database(database)
    assert len(before.clips) == 2
    assert all(np.isfinite(clip.frames).all() for clip in before.clips)
