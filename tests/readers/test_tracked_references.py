"""The motion that a recording tracked: where it is named, what is refused, and that its content counts."""

import dataclasses
from pathlib import Path

import pytest

from pipeline.catalog import CatalogSettings, catalogue_file
from pipeline.cli.retarget_command import encode_csv
from pipeline.clips.robot_clip import RobotClip
from pipeline.errors import FileError
from pipeline.files import settings
from pipeline.readers import FileStatement, Source, content_digest, read_motion, read_reference
from pipeline.robot import Robot
from tests.factories import motion_files as files
from tests.factories.robot_clips import standing


def write_robot_csv(path: Path, clip: RobotClip) -> None:
    path.write_text(encode_csv(clip, {}))


@pytest.fixture
def folder(tmp_path: Path, robot: Robot) -> Path:
    """`takes/rollout.csv` of 2 s and `plans/reference.csv` of 3 s."""
    (tmp_path / "motions" / "takes").mkdir(parents=True)
    (tmp_path / "motions" / "plans").mkdir()
    write_robot_csv(tmp_path / "motions" / "takes" / "rollout.csv", standing(robot, 2.0))
    write_robot_csv(tmp_path / "motions" / "plans" / "reference.csv", standing(robot, 3.0))
    return tmp_path / "motions"


def _source(folder: Path, tracks: str | None = None) -> Source:
    stated = () if tracks is None else (FileStatement(files="takes/*", tracks=tracks),)
    return Source(name="mine", folder=folder, licence="MIT", files=stated)


def _read(folder: Path, source: Source, clip: RobotClip):
    return read_reference(folder / "takes" / "rollout.csv", source, clip)


def test_most_motions_track_nothing(folder, robot):
    assert _read(folder, _source(folder), standing(robot)) is None


def test_a_statement_or_the_file_beside_the_recording_names_it(folder, robot):
    stated = _read(folder, _source(folder, "../plans/reference.csv"), standing(robot))
    (folder / "takes" / "rollout.yaml").write_text("tracks: ../plans/reference.csv\n")
    beside = _read(folder, _source(folder), standing(robot))
    assert stated is not None and beside is not None
    assert stated.path == beside.path == folder / "plans" / "reference.csv"
    assert stated.content == beside.content
    assert stated.clip.frame_count == 150


def test_another_reference_is_another_content_of_the_recording(folder, robot):
    source = _source(folder, "../plans/reference.csv")
    rollout = folder / "takes" / "rollout.csv"
    digests = [content_digest(rollout, _source(folder)), content_digest(rollout, source)]
    contents = [_read(folder, source, standing(robot))]
    moved = standing(robot, 3.0)
    write_robot_csv(folder / "plans" / "reference.csv", dataclasses.replace(moved, joint_pos=moved.joint_pos + 0.01))
    digests.append(content_digest(rollout, source))
    contents.append(_read(folder, source, standing(robot)))
    assert len(set(digests)) == 3
    assert contents[0].content != contents[1].content


REFUSED = {
    "nowhere.csv": "'nowhere.csv', does not serve: it is not there",
    "../../secret.csv": "does not serve: it lies outside of the source's folder",
    "/etc/passwd": "does not serve: it lies outside of the source's folder",
    "link.csv": "does not serve: it lies outside of the source's folder",
    "circle": "does not serve: it lies outside of the source's folder",
    "a\0b.csv": "does not serve: it lies outside of the source's folder",
    "x" * 5000: "does not serve: it",
    "..": "does not serve: it is not there",
    "short.csv": "it is 1.00 s long, the recording 2.00 s; both begin together",
    "human.bvh": "it is a person's motion",
    "broken.csv": "can't be read: .*broken.csv, line 6",
    "text.txt": "can't be read: .*text.txt",
}


@pytest.mark.parametrize("named", REFUSED)
def test_a_reference_that_does_not_serve_is_refused_with_one_sentence(folder, robot, named):
    takes = folder / "takes"
    write_robot_csv(folder.parent / "secret.csv", standing(robot, 3.0))
    (takes / "link.csv").symlink_to(folder.parent / "secret.csv")
    (takes / "circle").symlink_to("circle")
    write_robot_csv(takes / "short.csv", standing(robot, 1.0))
    (takes / "human.bvh").write_text(files.bvh(files.upright(90)))
    lines = (folder / "plans" / "reference.csv").read_text().splitlines()
    (takes / "broken.csv").write_text("\n".join([*lines[:5], lines[5].replace("0.", "zero", 1), *lines[6:]]))
    (takes / "text.txt").write_text("hello")
    with pytest.raises(FileError, match=REFUSED[named]) as raised:
        _read(folder, _source(folder, named), standing(robot))
    text = str(raised.value)
    assert "rollout.csv" in text
    assert "\n" not in text


@pytest.mark.parametrize("content", ["tracks: 3\n", "tracks: [a]\n", "tracks: ''\n"])
def test_a_file_beside_the_recording_that_names_no_path_is_refused(folder, robot, content):
    (folder / "takes" / "rollout.yaml").write_text(content)
    with pytest.raises(FileError, match=r"rollout\.yaml: 'tracks' is .*, expected the path of a motion"):
        _read(folder, _source(folder), standing(robot))
    assert content_digest(folder / "takes" / "rollout.csv", _source(folder))


def test_a_persons_recording_tracks_nothing(folder, tmp_path):
    (folder / "takes" / "person.bvh").write_text(files.bvh(files.upright(90)))
    clip = read_motion(folder / "takes" / "person.bvh", "person").clip
    with pytest.raises(FileError, match="only a robot tracks a motion"):
        read_reference(folder / "takes" / "person.bvh", _source(folder, "../plans/reference.csv"), clip)


def test_the_catalogue_notes_what_was_tracked_and_refuses_what_is_broken(folder, root):
    values = settings.read(root / "data" / "catalog.yaml", CatalogSettings)
    rollout, source = folder / "takes" / "rollout.csv", _source(folder, "../plans/reference.csv")
    (piece,) = catalogue_file(rollout, "mine/takes/rollout", source, "takes/rollout.csv", settings=values).pieces
    assert piece.numbers["tracks"] == "plans/reference.csv"
    assert len(str(piece.numbers["tracks_content"])) == 64
    with pytest.raises(FileError, match="does not serve"):
        catalogue_file(rollout, "mine/takes/rollout", _source(folder, "gone.csv"), "takes/rollout.csv", settings=values)
