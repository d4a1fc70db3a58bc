"""Sources: folders, licences, statements, and which files are motions."""

import dataclasses
import re
from pathlib import Path

import pytest

from pipeline.errors import FileError, SettingsError
from pipeline.readers import (
    Source,
    Statement,
    content_digest,
    list_motion_files,
    read_motion,
    read_sources,
    refuse_outside_link,
    sources_of_environment,
)
from tests.factories import motion_files as files


def sources_yaml(folder, text):
    (folder / "motions").mkdir(exist_ok=True)
    path = folder / "sources.yaml"
    path.write_text(text)
    return path


ENTRY = "sources:\n  - {name: mine, folder: motions, licence: MIT, credit: me}\n"


def test_the_shipped_sources_are_the_projects_own_motions(root: Path):
    (source,) = read_sources(root / "data" / "sources.yaml")
    assert (source.name, source.folder, source.licence) == ("booster_lab", root / "data" / "motions", "CC0-1.0")
    assert source.credit


def test_every_shipped_motion_reads_as_the_projects_skeleton(root: Path):
    (source,) = read_sources(root / "data" / "sources.yaml")
    paths = list_motion_files(source)
    assert len(paths) >= 12
    for path in paths:
        read = read_motion(path, path.stem, source.statement_of(path))
        assert (read.skeleton, read.unit, read.up_axis) == ("booster_lab", "cm", "y"), path.name


def test_statements_of_files_go_before_those_of_the_source(tmp_path):
    text = """
sources:
  - name: mine
    folder: motions
    licence: MIT
    statement: {unit: cm, fps: 100}
    files:
      - {files: "day2/*", fps: 120, licence: CC-BY-4.0}
      - {files: "*.npz", body_model: models/neutral.npz}
"""
    (source,) = read_sources(sources_yaml(tmp_path, text))
    plain, second, smpl = (source.folder / name for name in ("a.bvh", "day2/b.bvh", "day2/c.npz"))
    assert source.statement_of(plain) == Statement(unit="cm", fps=100.0)
    assert source.statement_of(second) == Statement(unit="cm", fps=120.0)
    assert source.statement_of(smpl).body_model == str(tmp_path / "models" / "neutral.npz")
    assert [source.licence_of(path) for path in (plain, second)] == ["MIT", "CC-BY-4.0"]
    assert source.about(second)["licence"] == "CC-BY-4.0"


@pytest.mark.parametrize(
    ("old", "new", "match"),
    [
        ("folder: motions", "folder: nowhere", "the folder 'nowhere' of source 'mine' does not exist"),
        ("licence: MIT, ", "", r"'sources\[0\].licence' is missing"),
        ("name: mine", "name: my/own", "the source name 'my/own'"),
        ("credit: me", "colour: red", r"unknown key 'sources\[0\].colour'"),
        ("credit: me", "statement: {unit: 3}", r"'sources\[0\].statement.unit' is 3, expected str"),
    ],
)
def test_faults_of_the_sources_file_are_named(tmp_path, old, new, match):
    with pytest.raises(SettingsError, match=match):
        read_sources(sources_yaml(tmp_path, ENTRY.replace(old, new)))


def test_two_sources_of_one_name_are_refused(tmp_path):
    with pytest.raises(SettingsError, match="two sources are named 'mine'"):
        read_sources(sources_yaml(tmp_path, ENTRY + "  - {name: mine, folder: motions, licence: MIT}\n"))


def test_folders_of_the_environment_are_named_after_themselves(tmp_path):
    for name in ("a/takes", "b/takes", "c"):
        (tmp_path / name).mkdir(parents=True)
    value = f"{tmp_path}/a/takes:{tmp_path}/b/takes::{tmp_path}/c:{tmp_path}/c/"
    sources = sources_of_environment(value)
    assert [source.name for source in sources] == ["takes", "takes-2", "c"]
    assert sources_of_environment("") == ()


def test_a_folder_of_the_environment_that_is_not_there_is_refused(tmp_path):
    with pytest.raises(FileError, match="BOOSTER_LAB_MOTIONS names it, but it is not a folder"):
        sources_of_environment(f"{tmp_path}/none")


def test_a_licence_is_that_of_the_sidecar_the_index_or_the_licence_file(tmp_path):
    for name in ("a.bvh", "b.bvh", "c.bvh", "sub/d.bvh", "e.bvh"):
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).touch()
    (tmp_path / "a.yaml").write_text("licence: CC0-1.0\n")
    (tmp_path / "e.yaml").write_text("a: [broken")
    (tmp_path / "index.csv").write_text('file,licence\na.bvh,MIT\nb.bvh,"MIT, mostly"\n')
    (tmp_path / "sub" / "LICENSE").write_text("\n  BSD-3-Clause\nmore\n")
    (source,) = sources_of_environment(str(tmp_path))
    found = [source.licence_of(source.folder / name) for name in ("a.bvh", "b.bvh", "c.bvh", "sub/d.bvh", "e.bvh")]
    assert found == ["CC0-1.0", "MIT, mostly", "unknown", "BSD-3-Clause", "unknown"]


def test_motions_are_listed_in_order_without_what_is_none(tmp_path):
    for name in ("b.bvh", "a/z.BVH", "a/x.npz", "w.amc", "w.asf", "b.yaml", ".hidden.bvh", ".git/a.bvh", "picture.png"):
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).touch()
    files.write_deepmimic(tmp_path / "walk.txt", files.deepmimic(2))
    (tmp_path / "README.txt").write_text("These are motions.")
    (tmp_path / "index.csv").write_text("file,licence\n")
    (tmp_path / "segments.csv").write_text("file,skill\n")
    (tmp_path / "robot.csv").write_text("0.1,0.2,0.3\n")
    paths = list_motion_files(Source(name="mine", folder=tmp_path))
    found = [path.relative_to(tmp_path).as_posix() for path in paths]
    assert found == ["a/x.npz", "a/z.BVH", "b.bvh", "robot.csv", "w.amc", "walk.txt"]


def linked(tmp_path):
    """A source with one motion and, beside its folder, another that is not its own."""
    folder, outside = tmp_path / "motions", tmp_path / "outside"
    folder.mkdir()
    outside.mkdir()
    for path in (folder / "a.bvh", outside / "other.bvh"):
        path.write_text("HIERARCHY")
    return Source(name="mine", folder=folder), outside


def test_links_that_stay_in_the_folder_are_motions(tmp_path):
    source, _ = linked(tmp_path)
    (source.folder / "b.bvh").symlink_to(source.folder / "a.bvh")
    assert [path.name for path in list_motion_files(source)] == ["a.bvh", "b.bvh"]
    refuse_outside_link(source.folder / "b.bvh", source.folder)


def test_links_that_are_no_motions_stop_nothing(tmp_path):
    source, outside = linked(tmp_path)
    for name, target in (("more", outside), ("gone", outside / "none"), ("x.yaml", "/etc/hostname"), ("y.md", "nil")):
        (source.folder / name).symlink_to(target)
    (source.folder / "README.txt").symlink_to(outside / "README.txt")
    assert [path.name for path in list_motion_files(source)] == ["a.bvh"]


@pytest.mark.parametrize("target", ["other.bvh", "none.bvh"])
@pytest.mark.parametrize("name", ["b.bvh", "b.csv", "b.txt"])
def test_a_motion_that_is_a_link_out_of_the_folder_is_listed_and_rejected_with_the_reason(tmp_path, name, target):
    source, outside = linked(tmp_path)
    link = source.folder / name
    link.symlink_to(outside / target)
    assert list_motion_files(source) == [source.folder / "a.bvh", link]
    with pytest.raises(FileError, match=r"a symbolic link \(to .*\) that leaves the source's folder .* as a source"):
        refuse_outside_link(link, source.folder)


def test_links_in_a_circle_are_rejected_too(tmp_path):
    source, _ = linked(tmp_path)
    (source.folder / "b.bvh").symlink_to(source.folder / "b.bvh")
    assert [path.name for path in list_motion_files(source)] == ["a.bvh", "b.bvh"]
    with pytest.raises(FileError, match="leads nowhere"):
        refuse_outside_link(source.folder / "b.bvh", source.folder)


def test_the_content_of_a_link_out_of_the_folder_is_its_target_and_is_not_read(tmp_path):
    source, outside = linked(tmp_path)
    link = source.folder / "b.bvh"
    link.symlink_to(outside / "other.bvh")
    before = content_digest(link, source)
    (outside / "other.bvh").write_text("changed")
    assert content_digest(link, source) == before
    (outside / "other.bvh").unlink()
    assert content_digest(link, source) == before
    link.unlink()
    link.symlink_to(outside / "third.bvh")
    assert content_digest(link, source) != before


def test_the_content_of_a_clip_is_all_that_it_is_read_from(tmp_path):
    folder = tmp_path / "motions"
    folder.mkdir()
    own = {name: folder / name for name in ("a.amc", "a.asf", "stated.asf", "a.yaml")}
    own |= {name: tmp_path / name for name in ("map.yaml", "body.npz")}
    for path in own.values():
        path.write_text("x: 1")
    stated = Statement(skeleton=str(own["map.yaml"]), body_model=str(own["body.npz"]), asf="stated.asf")
    source = Source(name="mine", folder=folder, statement=stated)
    seen = {content_digest(own["a.amc"], source)}
    for name, text in (*((name, "x: 2") for name in own if name != "a.yaml"), ("a.yaml", "licence: MIT")):
        own[name].write_text(text)
        seen.add(content_digest(own["a.amc"], source))
    own["a.yaml"].write_text("licence: [1")
    seen.add(content_digest(own["a.amc"], source))
    assert len(seen) == 8
    (folder / "unrelated.bvh").touch()
    own["map.yaml"].unlink()
    seen.add(content_digest(own["a.amc"], source))
    assert len(seen) == 9, "a file that is stated and gone is a change too"


def test_the_buffers_beside_a_gltf_are_of_its_content(tmp_path):
    path, buffer = tmp_path / "a.gltf", tmp_path / "a.bin"
    path.write_text(
        '{"asset": {"version": "2.0"}, "buffers": [{"uri": "a.bin"}, {"uri": "../b.bin"}, {"uri": "c.bin"}]}'
    )
    source = Source(name="mine", folder=tmp_path, statement=Statement())
    seen = {content_digest(path, source)}
    for content in (b"1", b"2"):
        buffer.write_bytes(content)
        seen.add(content_digest(path, source))
    (tmp_path / "unnamed.bin").write_bytes(b"1")
    seen.add(content_digest(path, source))
    assert len(seen) == 3
    path.write_text("no JSON")
    assert content_digest(path, source) not in seen


def test_a_broken_sidecar_is_noted_with_file_and_line_where_its_licence_would_count(tmp_path):
    (tmp_path / "a.bvh").touch()
    (source,) = sources_of_environment(str(tmp_path))
    path = source.folder / "a.bvh"
    assert source.notes_of(path) == ()
    for text, says in (("credit: me\nlicence: [1\n", r"a\.yaml, line 3: "), ("licence: [1]\n", r"'licence' is \[1\]")):
        (tmp_path / "a.yaml").write_text(text)
        (note,) = source.notes_of(path)
        assert (note.code, note.effect) == ("broken_sidecar", "noted")
        assert re.search(says, note.text)
        assert source.licence_of(path) == "unknown"
    assert dataclasses.replace(source, licence="MIT").notes_of(path) == ()
    (tmp_path / "a.yaml").write_text("credit: me\n")
    assert source.notes_of(path) == ()


def test_folders_of_the_environment_do_not_clash_with_sources_that_are_there(tmp_path):
    for name in ("mine", "a/mine", "b/mine-2"):
        (tmp_path / name).mkdir(parents=True)
    (tmp_path / "again").symlink_to(tmp_path / "mine")
    known = (Source(name="mine", folder=tmp_path / "mine"),)
    value = ":".join(str(tmp_path / name) for name in ("again", "mine", "a/mine", "b/mine-2"))
    sources = sources_of_environment(value, known=known)
    assert [(source.name, source.folder.name) for source in sources] == [("mine-2", "mine"), ("mine-2-2", "mine-2")]
