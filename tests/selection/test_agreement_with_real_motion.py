"""Windows of real recordings against hand-checked ones, from the files on."""

import csv

import pytest

from benchmarks.selection import LEAST_EACH, LEAST_OVERALL, agreement, frame_labels, main
from pipeline.catalog import CatalogSettings
from pipeline.files import settings as settings_file
from pipeline.selection import SKILLS, Curation
from tests.conftest import ROOT

CATALOG = settings_file.read(ROOT / "data" / "catalog.yaml", CatalogSettings)
CURATION = settings_file.read(ROOT / "data" / "curation.yaml", Curation)


def test_a_folder_without_windows_is_named_in_a_sentence(tmp_path, capsys, monkeypatch):
    monkeypatch.setattr("sys.argv", ["selection.py", str(tmp_path)])
    with pytest.raises(SystemExit) as stop:
        main()
    assert stop.value.code == 2
    assert f"{tmp_path} has no segments.csv; name a folder" in capsys.readouterr().err


@pytest.mark.shared
def test_windows_agree_with_the_labelled_seconds(mocap):
    with (mocap / "segments.csv").open() as stream:
        rows = list(csv.DictReader(stream))
    found = agreement(mocap, CATALOG, CURATION)
    assert sum(found.labelled_s.values()) > 250.0
    assert len(rows) > 100
    assert found.overall_percent >= LEAST_OVERALL
    assert {skill: found.percent(skill) >= LEAST_EACH for skill in SKILLS} == dict.fromkeys(SKILLS, True)


@pytest.mark.shared
def test_a_run_declared_at_a_fifth_of_its_rate_is_a_run(mocap):
    labels, fps = frame_labels(mocap / "cmu_bvh" / "02_03.bvh", CATALOG, CURATION)
    assert fps == 120.0
    assert (labels == "run").mean() > 0.9
