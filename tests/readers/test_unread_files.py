"""Files that are not read are counted and listed, a pointer is called one, and patterns that fit nothing warn."""

import json

import pytest

from pipeline.cli.main import main
from pipeline.errors import FileError
from pipeline.readers import FileStatement, Source, list_files, read_motion, source_warnings
from pipeline.readers.read_motion import SUFFIXES
from pipeline.readers.unread import CONVERT
from tests.factories import motion_files as files


@pytest.fixture
def folder(tmp_path):
    (tmp_path / "deep").mkdir()
    (tmp_path / "good.bvh").write_text(files.bvh(files.upright(60)))
    for name in ("a.fbx", "deep/b.FBX", "c.mvnx", "d.trc", ".hidden.fbx", "notes.md", "picture.png", "e.blend1"):
        (tmp_path / name).write_bytes(b"rubble")
    return tmp_path


def test_files_of_other_formats_are_counted_by_kind(folder):
    listing = list_files(Source(name="mine", folder=folder))
    assert [path.name for path in listing.motions] == ["good.bvh"]
    assert dict(listing.unread) == {".fbx": 2, ".mvnx": 1, ".trc": 1}
    text = listing.unread_text()
    assert text.startswith(
        "4 files of other formats were not read: .fbx 2, .mvnx 1, .trc 1. .fbx: Import it into Blender"
    )


def test_inspecting_a_folder_lists_what_was_not_read(folder, capsys):
    assert main(["inspect", str(folder)]) == 0
    assert "4 files of other formats were not read: .fbx 2, .mvnx 1, .trc 1" in capsys.readouterr().out
    assert main(["inspect", str(folder), "--json"]) == 0
    first, last = json.loads(capsys.readouterr().out)
    assert first["file"].endswith("good.bvh")
    assert last["not_read"] == {".fbx": 2, ".mvnx": 1, ".trc": 1}


def test_a_folder_of_other_formats_alone_is_an_error_that_says_how_to_convert(folder, capsys):
    (folder / "good.bvh").unlink()
    assert main(["inspect", str(folder)]) == 1
    assert "it has no motion files. 4 files of other formats" in capsys.readouterr().err


def test_every_other_kind_that_may_hold_motion_is_counted(tmp_path):
    counted = {"a.dae": ".dae", "takes.ZIP": ".zip", "b.json": ".json", "c.json": ".json", "d.xyz": ".xyz"}
    counted |= {"numbers.txt": ".txt", "e.tar.gz": ".gz"}
    (tmp_path / "folder.dae").mkdir()
    (tmp_path / "numbers.txt").write_text("0.1 0.2 0.3\n")
    for name in ("LICENSE", "README.txt", "index.json", "notes.txt", "clip.yaml", "video.mp4", "old.bak", "s.asf"):
        (tmp_path / name).write_text("1" if name == "README.txt" else "text")
    for name in counted:
        if name != "numbers.txt":
            (tmp_path / name).write_bytes(b"rubble")
    listing = list_files(Source(name="mine", folder=tmp_path))
    assert dict(listing.unread) == {".dae": 1, ".gz": 1, ".json": 2, ".txt": 1, ".xyz": 1, ".zip": 1}
    text = listing.unread_text()
    assert text.startswith("7 files of other formats were not read: .dae 1, .gz 1, .json 2, .txt 1, .xyz 1, .zip 1. ")
    assert ".zip: Unpack it" in text and ".xyz:" not in text


def test_a_pointer_in_the_place_of_a_text_file_is_listed_and_its_readme_is_not(tmp_path):
    for name in ("walk.txt", "README.txt"):
        (tmp_path / name).write_text("version https://git-lfs.github.com/spec/v1\noid sha256:0\nsize 9\n")
    listing = list_files(Source(name="mine", folder=tmp_path))
    assert [path.name for path in listing.motions] == ["walk.txt"] and not listing.unread


@pytest.mark.parametrize("suffix", sorted(set(CONVERT) - {".txt"}))
def test_each_of_these_files_is_refused_with_how_to_convert_it(tmp_path, suffix):
    (tmp_path / f"take{suffix}").write_bytes(b"rubble")
    with pytest.raises(FileError, match=f"'{suffix}' is not a motion file") as caught:
        read_motion(tmp_path / f"take{suffix}", "clip")
    assert str(caught.value).endswith(CONVERT[suffix])


@pytest.mark.parametrize(
    ("suffix", "program", "formats"),
    [(".fbx", r"blender --background .*import_scene\.fbx", "BVH or glTF"), (".mvnx", "Xsens MVN", "as BVH, or as FBX")],
)
def test_the_messages_of_fbx_and_mvnx_name_a_program_and_a_format_that_is_read(tmp_path, suffix, program, formats):
    (tmp_path / f"take{suffix}").write_bytes(b"rubble")
    for says in (program, formats):
        with pytest.raises(FileError, match=says):
            read_motion(tmp_path / f"take{suffix}", "clip")


def test_a_source_warns_of_what_is_not_read_of_nothing_and_of_patterns_that_fit_nothing(folder, tmp_path):
    stated = (FileStatement(files="*.bvh", fps=30.0), FileStatement(files="day2/*.bvh", fps=60.0))
    source = Source(name="mine", folder=folder, files=stated)
    unread, idle = source_warnings(source, list_files(source))
    assert unread.startswith("source 'mine': 4 files of other formats")
    assert idle == "source 'mine': the pattern 'day2/*.bvh' in data/sources.yaml fits no file"
    (tmp_path / "nothing").mkdir()
    empty = Source(name="empty", folder=tmp_path / "nothing")
    assert source_warnings(empty, list_files(empty)) == [f"source 'empty': there is no motion file in {empty.folder}"]


@pytest.mark.parametrize("suffix", [*SUFFIXES, ".fbx"])
def test_a_pointer_in_the_place_of_a_file_is_called_one(tmp_path, suffix):
    text = "version https://git-lfs.github.com/spec/v1\noid sha256:" + "0" * 64 + "\nsize 149000000\n"
    (tmp_path / f"clip{suffix}").write_text(text)
    with pytest.raises(FileError, match=r"it is a Git LFS pointer: .* Run `git lfs pull`"):
        read_motion(tmp_path / f"clip{suffix}", "clip")


@pytest.mark.shared
def test_the_folder_of_many_formats_names_those_that_are_not_read(cases, capsys):
    assert main(["inspect", str(cases / "folder_with_other_formats" / "motions")]) == 0
    out = capsys.readouterr().out
    assert "4 files of other formats were not read: .fbx 1, .mvnx 1, .npy 1, .trc 1" in out
    for name in ("take.pkl", "take.pt", "take.glb", "take.c3d"):
        assert name in out
