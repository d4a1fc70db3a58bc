"""Sources that runs used: kept when the variable is gone, missed loudly when they are gone themselves."""

import json
import re
import shutil
from pathlib import Path

import pytest

from pipeline.errors import FileError, UnknownNameError
from pipeline.readers.remembered import (
    SourceLostError,
    SourcesInUse,
    check_sources,
    forget,
    read_remembered,
    remember,
    sources_in_use,
)


def project(root: Path, *sources: str) -> Path:
    """A `sources.yaml` with a folder each of one motion file."""
    entries = "".join(f"  - {{name: {name}, folder: {name}, licence: MIT}}\n" for name in sources)
    for name in sources:
        folder(root, name)
    file = root / "sources.yaml"
    file.write_text("sources:\n" + entries if sources else "sources: []\n")
    return file


def folder(root: Path, name: str, files: int = 1) -> Path:
    made = root / name
    made.mkdir(exist_ok=True)
    for index in range(files):
        (made / f"take{index}.bvh").write_text("HIERARCHY")
    return made


def counted(sources: SourcesInUse) -> dict[str, int]:
    return {source.name: len(list(source.folder.glob("*.bvh"))) for source in sources.all}


def run(file: Path, variable: str, memory: Path) -> SourcesInUse:
    """What a run does with its sources."""
    sources = sources_in_use(file, variable, memory)
    check_sources(memory, sources, counted(sources))
    remember(memory, sources, counted(sources))
    return sources


def test_a_folder_of_the_variable_stays_a_source_without_it(tmp_path):
    file, memory = project(tmp_path, "shipped"), tmp_path / "store/sources.json"
    run(file, str(folder(tmp_path, "takes", 3)), memory)
    later = run(file, "", memory)
    assert [source.name for source in later.remembered] == ["takes"]
    assert counted(later) == {"shipped": 1, "takes": 3}
    assert [(each.name, each.files, each.named_in) for each in read_remembered(memory)] == [
        ("shipped", 1, "data/sources.yaml"),
        ("takes", 3, "BOOSTER_LAB_MOTIONS"),
    ]


def test_names_do_not_change_with_the_order_of_the_folders(tmp_path):
    file, memory = project(tmp_path), tmp_path / "sources.json"
    for parent in "ab":
        (tmp_path / parent).mkdir()
    first, second = folder(tmp_path, "a/takes"), folder(tmp_path, "b/takes")
    before = {source.name: source.folder for source in run(file, f"{first}:{second}", memory).all}
    assert {source.name: source.folder for source in run(file, f"{second}", memory).all} == before
    assert {source.name: source.folder for source in run(file, f"{second}:{first}", memory).all} == before


def test_a_forgotten_source_is_gone_and_another_name_is_refused(tmp_path):
    file, memory = project(tmp_path, "shipped"), tmp_path / "sources.json"
    run(file, str(folder(tmp_path, "takes")), memory)
    with pytest.raises(UnknownNameError, match="unknown source 'tokes'; there are: shipped, takes"):
        forget(memory, ["tokes"])
    assert [each.name for each in forget(memory, ["takes"])] == ["takes"]
    assert counted(run(file, "", memory)) == {"shipped": 1}


@pytest.mark.parametrize(
    ("lose", "match"),
    [
        (
            lambda root, file: (root / "takes").rename(root / "moved"),
            "'takes' .*3 motion files.* is not a folder any more",
        ),
        (lambda root, file: [path.unlink() for path in (root / "takes").iterdir()], "'takes' .*holds no motion file"),
        (lambda root, file: project(root), "'shipped' .*is not named any more"),
        (
            lambda root, file: [path.unlink() for path in (root / "shipped").iterdir()],
            "'shipped' .*holds no motion file",
        ),
    ],
    ids=["folder moved", "disk not mounted", "entry deleted", "shipped emptied"],
)
def test_a_lost_source_stops_the_run_and_names_what_would_be_lost(tmp_path, lose, match):
    file, memory = project(tmp_path, "shipped"), tmp_path / "sources.json"
    run(file, str(folder(tmp_path, "takes", 3)), memory)
    recorded = memory.read_text()
    lose(tmp_path, file)
    with pytest.raises(SourceLostError, match=match) as raised:
        run(file, "", memory)
    assert "booster-lab sources forget" in str(raised.value)
    assert memory.read_text() == recorded


def test_what_is_said_of_a_file_does_not_need_the_folders_of_other_sources(tmp_path):
    file, memory = project(tmp_path, "shipped", "second"), tmp_path / "sources.json"
    run(file, str(folder(tmp_path, "takes")), memory)
    for name in ("second", "takes"):
        shutil.rmtree(tmp_path / name)
    found = sources_in_use(file, "", memory, only_there=True)
    assert [source.name for source in found.all] == ["shipped"]


def test_a_source_that_is_renamed_or_moved_is_not_lost(tmp_path):
    file, memory = project(tmp_path, "shipped"), tmp_path / "sources.json"
    run(file, "", memory)
    file.write_text(file.read_text().replace("name: shipped", "name: renamed"))
    assert counted(run(file, "", memory)) == {"renamed": 1}
    (tmp_path / "shipped").rename(tmp_path / "moved")
    file.write_text(file.read_text().replace("folder: shipped", "folder: moved"))
    assert counted(run(file, "", memory)) == {"renamed": 1}


RECORDED = {"name": "a", "folder": "/a", "named_in": "data/sources.yaml", "files": 1}


@pytest.mark.parametrize(
    ("change", "told"),
    [
        ({"path": "/b"}, "unknown key 'sources[0].path', there are: name, folder, named_in, files"),
        ({"files": "1"}, "'sources[0].files' is '1', expected int"),
        ({"files": -1}, "'sources[0].files' is -1, allowed is at least 0"),
        ({"named_in": "x"}, "'sources[0].named_in' is 'x', there are: data/sources.yaml, BOOSTER_LAB_MOTIONS"),
    ],
)
def test_a_fault_in_the_record_is_a_plain_sentence(tmp_path, change, told):
    memory = tmp_path / "sources.json"
    memory.write_text(json.dumps([RECORDED]))
    assert [each.name for each in read_remembered(memory)] == ["a"]
    memory.write_text(json.dumps([RECORDED | change]))
    with pytest.raises(FileError, match=re.escape(f"can't be read ({told}). Name all of your sources")):
        read_remembered(memory)


@pytest.mark.parametrize("text", ["null", "[1]", "{", '[{"name": "a"}]', "\x00"])
def test_a_damaged_record_is_refused_with_what_to_do(tmp_path, text):
    file, memory = project(tmp_path, "shipped"), tmp_path / "sources.json"
    memory.write_text(text)
    with pytest.raises(FileError, match=r"sources\.json: the record of the sources in use can't be read .*remove this"):
        run(file, "", memory)
    memory.write_text(json.dumps([]))
    assert counted(run(file, "", memory)) == {"shipped": 1}
