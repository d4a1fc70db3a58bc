"""Files that people write, with a planted fault: refused in one sentence that names the file and the place."""

import os
import re
from pathlib import Path

import pytest

from pipeline.catalog import CatalogSettings
from pipeline.errors import FileError, SettingsError
from pipeline.feasibility import CommandSettings, FeasibilitySettings
from pipeline.files import settings
from pipeline.readers import Source, list_motion_files, read_sources, refuse_outside_link
from pipeline.repair import RepairSettings
from pipeline.retarget import RetargetSettings
from pipeline.selection import Curation
from tests.factories.mutants_yaml import ANY_FILE, SOURCES, SOURCES_FAULTS, settings_faults

ROOT = Path(__file__).resolve().parents[2]
FEASIBILITY = (ROOT / "data" / "feasibility.yaml").read_text()
KINDS = {
    "catalog": CatalogSettings,
    "commands": CommandSettings,
    "curation": Curation,
    "feasibility": FeasibilitySettings,
    "repair": RepairSettings,
    "retarget": RetargetSettings,
}


def sentence(error: Exception, name: str) -> bool:
    """One readable sentence about the file."""
    text = str(error)
    return name in text and "Traceback" not in text and 10 < len(text) < 20_000 and "\n" not in text.strip()


@pytest.mark.parametrize("fault", ANY_FILE)
@pytest.mark.parametrize("kind", KINDS)
def test_no_settings_file_may_be_this(tmp_path, kind, fault):
    path = tmp_path / f"{kind}.yaml"
    path.write_bytes(ANY_FILE[fault])
    with pytest.raises(SettingsError) as raised:
        settings.read(path, KINDS[kind])
    assert sentence(raised.value, path.name)


@pytest.mark.parametrize("fault", settings_faults(FEASIBILITY))
def test_a_fault_in_the_thresholds_is_named_by_its_key_or_line(tmp_path, fault):
    path = tmp_path / "feasibility.yaml"
    path.write_text(settings_faults(FEASIBILITY)[fault])
    with pytest.raises(SettingsError) as raised:
        settings.read(path, FeasibilitySettings)
    assert sentence(raised.value, path.name)
    assert re.search(r"limit_exces|joints?'|line \d+|missing", str(raised.value))


@pytest.fixture
def project(tmp_path: Path) -> Path:
    """A folder with a sources file's surroundings."""
    (tmp_path / "motions").mkdir()
    (tmp_path / "circle").symlink_to("circle")
    return tmp_path


@pytest.mark.parametrize("fault", SOURCES_FAULTS)
def test_a_fault_in_the_sources_file_is_refused(project, fault):
    path = project / "sources.yaml"
    path.write_text(SOURCES_FAULTS[fault])
    with pytest.raises(SettingsError) as raised:
        read_sources(path)
    assert sentence(raised.value, path.name)


@pytest.mark.parametrize("fault", ANY_FILE)
def test_no_sources_file_may_be_this(project, fault):
    path = project / "sources.yaml"
    path.write_bytes(ANY_FILE[fault])
    with pytest.raises(SettingsError) as raised:
        read_sources(path)
    assert sentence(raised.value, path.name)


def test_the_sources_file_that_the_faults_are_planted_into_is_read(project):
    (project / "sources.yaml").write_text(SOURCES)
    assert [source.name for source in read_sources(project / "sources.yaml")] == ["mine"]


LINKS = {
    "a file elsewhere": "../secret.bvh",
    "the password file": "/etc/passwd",
    "nothing": "nowhere.bvh",
    "itself": "link.bvh",
    "a device without an end": "/dev/zero",
}


@pytest.mark.parametrize("target", LINKS)
def test_a_link_out_of_the_folder_is_listed_and_not_read(project, target):
    (project / "secret.bvh").write_text("HIERARCHY")
    link = project / "motions" / "link.bvh"
    link.symlink_to(LINKS[target])
    source = Source(name="mine", folder=project / "motions")
    assert list_motion_files(source) == [link]
    with pytest.raises(FileError, match=r"link\.bvh: a symbolic link") as raised:
        refuse_outside_link(link, source.folder)
    assert sentence(raised.value, "link.bvh")


def test_a_linked_folder_and_a_pipe_are_no_motions(project):
    (project / "secret").mkdir()
    (project / "secret" / "walk.bvh").write_text("HIERARCHY")
    (project / "motions" / "more").symlink_to(project / "secret")
    os.mkfifo(project / "motions" / "pipe.bvh")
    (project / "motions" / "folder.bvh").mkdir()
    assert list_motion_files(Source(name="mine", folder=project / "motions")) == []
