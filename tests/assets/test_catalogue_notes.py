"""What is not read, and patterns that fit nothing, are in the log and in the catalogue's metadata."""

import shutil

import dagster as dg
import pytest

from assets import motions
from assets.resources import ClipPoolResource
from pipeline.project import Project
from tests.factories import motion_files as files

SOURCES = """\
sources:
  - name: mine
    folder: takes
    licence: CC0-1.0
    files:
      - {files: "*.bvh", fps: 60}
      - {files: "day2/*.bvh", fps: 30}
"""


@pytest.fixture
def project(root, tmp_path, monkeypatch):
    """A project with one source: a motion, seven files of other formats and one pattern that fits nothing."""
    made = Project(tmp_path)
    takes = made.data / "takes"
    takes.mkdir(parents=True)
    for name in ("catalog.yaml", "curation.yaml"):
        shutil.copy(root / "data" / name, made.settings(name))
    made.settings("sources.yaml").write_text(SOURCES)
    (takes / "good.bvh").write_text(files.bvh(files.upright(90)))
    for name in ("a.fbx", "b.fbx", "c.mvnx", "d.dae", "e.zip", "f.json", "<b>.xyz", "notes.md"):
        (takes / name).write_bytes(b"rubble")
    monkeypatch.setattr(motions, "PROJECT", made)
    return made


def test_the_catalogue_counts_what_is_not_read_by_kind(project, capsys):
    result = motions.motion_catalog(dg.build_asset_context(), clip_pool=ClipPoolResource(backend="sequential"))
    assert [entry.clip for entry in result.value.entries] == ["mine/good"]
    shown = result.metadata["files not read, empty folders and patterns"].md_str
    counted = "7 files of other formats were not read: .dae 1, .fbx 2, .json 1, .mvnx 1, .xyz 1, .zip 1."
    assert counted in shown and "day2/" in shown and "fits no file" in shown
    assert f"source 'mine': {counted}" in capsys.readouterr().err


def test_a_pattern_of_excluded_clips_that_fits_nothing_warns(project, capsys):
    path = project.settings("curation.yaml")
    text = path.read_text()
    assert "excluded_clips: []" in text
    path.write_text(text.replace("excluded_clips: []", 'excluded_clips: ["mine/nothing*"]'))
    pool = ClipPoolResource(backend="sequential")
    catalogue = motions.motion_catalog(dg.build_asset_context(), clip_pool=pool).value
    motions.selected_motions(dg.build_asset_context(), clip_pool=pool, motion_catalog=catalogue)
    warned = capsys.readouterr().err
    assert "excluded_clips in data/curation.yaml: the pattern 'mine/nothing*' matches no clip" in warned
