"""A database as others load it: each format opened by its consumer's own loader or read back, and the card."""

import json
import sys
from pathlib import Path

import jsonschema
import numpy as np
import pandas as pd
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
import torch
import yaml

from pipeline import rotation
from pipeline.cli.main import main
from pipeline.dataset_export.lerobot import write_lerobot
from pipeline.expert import ExpertEntry, read_database, write_database
from pipeline.expert.database_clip import read_database_clip
from pipeline.expert.write import file_name
from pipeline.readers import read_motion
from tests.factories.robot_clips import wandering

NAMES = ("source/walk@0-60", "source/walk@0-60~mirror", "other/run@5-80")

COUNT = {"type": "integer", "minimum": 1}
LEROBOT_INFO = {
    "type": "object",
    "required": [
        *("codebase_version", "robot_type", "total_episodes", "total_frames", "total_tasks", "chunks_size"),
        *("data_files_size_in_mb", "video_files_size_in_mb", "fps", "splits", "data_path", "video_path", "features"),
    ],
    "properties": {
        "codebase_version": {"const": "v3.0"},
        "robot_type": {"const": "t1"},
        **dict.fromkeys(("total_episodes", "total_frames", "total_tasks", "chunks_size"), COUNT),
        "fps": {"const": 50},
        "splits": {"type": "object", "required": ["train"], "properties": {"train": {"pattern": "^0:[0-9]+$"}}},
        "data_path": {"const": "data/chunk-{chunk_index:03d}/file-{file_index:03d}.parquet"},
        "video_path": {"type": "null"},
        "features": {
            "type": "object",
            "required": ["action", "timestamp", "frame_index", "episode_index", "index", "task_index"],
            "additionalProperties": {
                "type": "object",
                "required": ["dtype", "shape", "names"],
                "properties": {
                    "dtype": {"enum": ["float32", "int64"]},
                    "shape": {"type": "array", "items": COUNT, "minItems": 1},
                    "names": {"type": ["array", "null"]},
                },
            },
        },
    },
}
"""What `meta/info.json` of a LeRobotDataset v3.0 without videos holds."""


@pytest.fixture
def database(robot, tmp_path) -> Path:
    entries = [
        ExpertEntry(
            clip=wandering(robot, seed=index).cut(0, 60 + 5 * index, name),
            weight=1.0,
            skill="run" if "run" in name else "walk",
            licence="CC0-1.0" if "run" in name else "CC-BY-4.0",
            numbers={
                "file": "a.bvh",
                "source": name.split("/")[0],
                "credit": "Jane <b>Doe</b> | [x](y)",
                "variant": "mirror" if "mirror" in name else "original",
            },
            stages={},
        )
        for index, name in enumerate(NAMES)
    ]
    write_database(tmp_path / "t1", entries, robot, stages={"a": {"stage": "repaired_motions", "version": "12ab"}})
    return tmp_path / "t1"


def truth(database, robot, name):
    return read_database_clip(database / file_name(name), robot)[0]


def archive(folder, name):
    return folder / Path(file_name(name)).with_suffix(".npz")


def test_the_archives_are_loaded_by_mjlabs_own_loader(database, robot, tmp_path, capsys):
    from mjlab.tasks.tracking.mdp.commands import MotionLoader

    assert main(["export", str(database), "--format", "mjlab", "--out", str(tmp_path / "out")]) == 0
    assert "3 clips and README.md" in capsys.readouterr().out
    for name in NAMES:
        clip = truth(database, robot, name)
        feet = torch.tensor([robot.link("left_foot_link"), 0])
        motion = MotionLoader(str(archive(tmp_path / "out", name)), feet)
        assert motion.time_step_total == clip.frame_count
        np.testing.assert_allclose(motion.joint_pos.numpy(), clip.joint_pos, atol=1e-6)
        np.testing.assert_allclose(motion.joint_vel.numpy(), clip.joint_vel(), atol=1e-4)
        np.testing.assert_allclose(motion.body_pos_w[:, 1].numpy(), clip.root_pos_w, atol=1e-6)
        np.testing.assert_allclose(motion.body_lin_vel_w[:, 1].numpy(), clip.root_lin_vel_w(), atol=1e-4)
        np.testing.assert_allclose(motion.body_ang_vel_w[:, 1].numpy(), clip.root_ang_vel_w(), atol=1e-4)


@pytest.mark.parametrize("kind", ["mjlab", "gmr"])
def test_what_is_exported_is_read_back_as_the_same_motion(database, robot, tmp_path, kind):
    assert main(["export", str(database), "--format", kind, "--out", str(tmp_path / "out")]) == 0
    for name in NAMES:
        clip, read = truth(database, robot, name), read_motion(archive(tmp_path / "out", name), "clip")
        assert (read.skeleton, read.clip.fps, read.notes) == ("t1", 50.0, ())
        np.testing.assert_allclose(read.clip.root_pos_w, clip.root_pos_w, atol=1e-6)
        np.testing.assert_allclose(read.clip.joint_pos, clip.joint_pos, atol=1e-6)
        assert rotation.angle_between(read.clip.root_quat_w, clip.root_quat_w).max() < 1e-3


def test_the_data_set_has_the_layout_of_lerobot_3(database, robot, tmp_path):
    """As the format's documentation has it; its own loader opens one in tests/dataset_export."""
    out = tmp_path / "out"
    assert main(["export", str(database), "--format", "lerobot", "--out", str(out)]) == 0
    info = json.loads((out / "meta/info.json").read_text())
    jsonschema.validate(info, LEROBOT_INFO)
    clips = [truth(database, robot, name) for name in read_database(database).index["clip"]]
    assert (info["total_episodes"], info["total_frames"]) == (3, sum(clip.frame_count for clip in clips))
    tasks = pd.read_parquet(out / "meta/tasks.parquet")
    frames = pq.read_table(out / info["data_path"].format(chunk_index=0, file_index=0))
    assert set(frames.column_names) == set(info["features"])
    for name, feature in info["features"].items():
        kind = frames.schema.field(name).type
        wide = pa.types.is_fixed_size_list(kind)
        number = {"float": "float32", "int64": "int64"}[str(kind.value_type if wide else kind)]
        assert number == feature["dtype"]
        assert feature["shape"] == [kind.list_size if wide else 1]
    episodes = pq.read_table(out / "meta/episodes/chunk-000/file-000.parquet").to_pylist()
    stats = json.loads((out / "meta/stats.json").read_text())
    for number, (episode, clip) in enumerate(zip(episodes, clips, strict=True)):
        first, stop = episode["dataset_from_index"], episode["dataset_to_index"]
        part = frames.slice(first, stop - first).to_pydict()
        assert (episode["episode_index"], episode["length"]) == (number, clip.frame_count)
        assert part["index"] == list(range(first, stop)) and part["frame_index"] == list(range(clip.frame_count))
        assert tasks.iloc[part["task_index"][0]].name == episode["tasks"][0]
        np.testing.assert_allclose(part["timestamp"], np.arange(clip.frame_count) / 50.0, atol=1e-5)
        np.testing.assert_allclose(part["observation.state"], clip.joint_pos, atol=1e-6)
        np.testing.assert_allclose(part["action"][:-1], clip.joint_pos[1:], atol=1e-6)
        np.testing.assert_allclose(episode["stats/action/max"], np.max(part["action"], axis=0), atol=1e-6)
    state = np.concatenate([clip.joint_pos for clip in clips])
    np.testing.assert_allclose(stats["observation.state"]["mean"], state.mean(axis=0), atol=1e-9)
    np.testing.assert_allclose(stats["observation.state"]["std"], state.std(axis=0), atol=1e-9)
    assert stats["index"]["count"] == [len(state)]


def test_a_large_data_set_is_divided_into_files_and_episodes_say_which(robot, tmp_path):
    clips = [wandering(robot, seed=seed).cut(0, 50, f"clip {seed}") for seed in range(5)]
    assert write_lerobot(tmp_path, ((clip, "walk") for clip in clips), file_mb=0.05) == 5
    episodes = pq.read_table(tmp_path / "meta/episodes/chunk-000/file-000.parquet").to_pylist()
    files = [each["data/file_index"] for each in episodes]
    assert len(set(files)) > 1 and files == sorted(files)
    for episode in episodes:
        rows = pq.read_table(tmp_path / f"data/chunk-000/file-{episode['data/file_index']:03d}.parquet").to_pylist()
        own = [row["index"] for row in rows if row["episode_index"] == episode["episode_index"]]
        assert own == list(range(episode["dataset_from_index"], episode["dataset_to_index"]))


def test_recordings_are_opened_by_reruns_own_reader(database, robot, tmp_path):
    rerun = pytest.importorskip("rerun", reason="the extra booster-lab[export] is not installed")
    assert main(["export", str(database), "--format", "rerun", "--out", str(tmp_path / "out")]) == 0
    for name in NAMES:
        clip = truth(database, robot, name)
        reader = rerun.chunk.RrdReader(tmp_path / "out" / Path(file_name(name)).with_suffix(".rrd"))
        (entry,) = reader.recordings()
        assert entry.application_id == "booster-lab"
        rows: dict[str, dict[str, list]] = {}
        for chunk in reader.stream().to_chunks():
            table = chunk.to_record_batch().to_pydict()
            for column, values in table.items():
                rows.setdefault(chunk.entity_path, {}).setdefault(column, []).extend(values)
        knee = robot.joint("Left_Knee_Pitch")
        found = rows["/joint_pos/Left_Knee_Pitch"]
        np.testing.assert_allclose(np.ravel(found["Scalars:scalars"]), clip.joint_pos[:, knee], atol=1e-9)
        assert found["frame"] == list(range(clip.frame_count))
        assert found["time"][10].total_seconds() == pytest.approx(0.2)
        trunk = rows[f"/world/{robot.root_link}"]
        np.testing.assert_allclose(np.reshape(trunk["Transform3D:translation"], (-1, 3)), clip.root_pos_w, atol=1e-5)
        quat = np.roll(np.reshape(trunk["Transform3D:quaternion"], (-1, 4)), 1, axis=1)
        assert rotation.angle_between(rotation.normalize(quat), clip.root_quat_w).max() < 1e-3


def test_without_its_extra_the_recording_is_refused_with_the_command(database, tmp_path, monkeypatch, capsys):
    monkeypatch.setitem(sys.modules, "rerun", None)
    assert main(["export", str(database), "--format", "rerun", "--out", str(tmp_path / "out")]) == 1
    assert "rerun-sdk is not installed. Run: pip install 'booster-lab[export]'" in capsys.readouterr().err


def test_clips_of_one_skill_alone_are_exported(database, tmp_path):
    assert main(["export", str(database), "--format", "gmr", "--out", str(tmp_path / "out"), "--skill", "run"]) == 0
    assert sorted(path.name for path in (tmp_path / "out").iterdir()) == ["README.md", archive(tmp_path, NAMES[2]).name]


def test_the_card_beside_the_database_names_sources_licences_skills_and_stages(database):
    text = (database / "README.md").read_text()
    head = yaml.safe_load(text.split("---")[1])
    assert head["license"] == "other" and "t1" in head["tags"]
    assert "3 clips, 0.1 minutes at 50 Hz" in text
    assert "| CC0-1.0 | public-domain | 1 | 1.4 |" in text
    assert "| source | CC-BY-4.0 | Jane" in text and "| other | CC0-1.0 | Jane" in text
    assert "| walk | 2.5 | 2 |" in text
    assert (
        "| repaired_motions | defects filled or cut, put onto the ground, smoothed, contacts labelled | 12ab |" in text
    )
    assert "| mirror | 1.3 | 1 |" in text
    assert "<b>" not in text and "Jane &lt;b&gt;Doe&lt;/b&gt; \\| \\[x](y)" in text
    assert read_database(database).manifest["files"].keys() >= {"README.md"}


@pytest.mark.parametrize("kind", ["gmr", "lerobot"])
def test_the_card_of_an_export_is_that_of_the_exported_clips(database, tmp_path, kind):
    for name, skills in (("all", []), ("run", ["--skill", "run"])):
        assert main(["export", str(database), "--format", kind, "--out", str(tmp_path / name), *skills]) == 0
    assert (tmp_path / "all/README.md").read_bytes() == (database / "README.md").read_bytes()
    text = (tmp_path / "run/README.md").read_text()
    assert "1 clip, " in text and "Strictest: **public-domain**" in text
    assert "CC-BY-4.0" not in text and "| walk |" not in text


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (["{db}/none", "--format", "gmr", "--out", "{out}"], "materialize --select expert_db\n"),
        (["{db}/k1", "--format", "gmr", "--out", "{out}"], "materialize --select k1/expert_db\n"),
        (["{db}", "--format", "gmr", "--out", "{db}/inside"], "it is inside the database, which must not be changed"),
        (["{db}", "--format", "gmr", "--out", "{out}", "--skill", "fly"], "unknown skill 'fly'; there are: run, walk"),
        (["{out}", "--format", "gmr", "--out", "{db}.out"], "not a whole expert database"),
    ],
)
def test_what_can_not_be_exported_is_told(database, tmp_path, capsys, arguments, says):
    (tmp_path / "out").mkdir()
    filled = [each.format(db=database, out=tmp_path / "out") for each in arguments]
    assert main(["export", *filled]) == 1
    assert says in capsys.readouterr().err


@pytest.mark.parametrize("kind", ["gmr", "mjlab", "lerobot"])
def test_a_folder_that_holds_something_is_not_written_into(database, tmp_path, capsys, kind):
    out = tmp_path / "out"
    out.mkdir()
    (out / "README.md").write_text("mine")
    assert main(["export", str(database), "--format", kind, "--out", str(out)]) == 1
    assert "it is not empty. Name an empty folder" in capsys.readouterr().err
    assert [path.name for path in out.iterdir()] == ["README.md"]
    assert (out / "README.md").read_text() == "mine"
