"""A database as others load it: each format opened by its consumer's own loader or read back, and the card."""

from pathlib import Path

import numpy as np
import pytest
import torch
import yaml

from pipeline import rotation
from pipeline.cli.database_clip import read_database_clip
from pipeline.cli.main import main
from pipeline.expert import ExpertEntry, read_database, write_database
from pipeline.expert.write import file_name
from pipeline.readers import read_motion
from tests.factories.robot_clips import wandering

NAMES = ("source/walk@0-60", "source/walk@0-60~mirror", "other/run@5-80")


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


def test_clips_of_one_skill_alone_are_exported(database, tmp_path):
    assert main(["export", str(database), "--format", "gmr", "--out", str(tmp_path / "out"), "--skill", "run"]) == 0
    assert sorted(path.name for path in (tmp_path / "out").iterdir()) == ["README.md", archive(tmp_path, NAMES[2]).name]


def test_the_card_names_sources_licences_skills_and_stages(database, tmp_path):
    assert main(["export", str(database), "--format", "card", "--out", str(tmp_path)]) == 0
    text = (tmp_path / "README.md").read_text()
    head = yaml.safe_load(text.split("---")[1])
    assert head["license"] == "other" and "t1" in head["tags"]
    assert "| CC0-1.0 | public-domain | 1 | 1.4 |" in text
    assert "| walk | 2.5 | 2 |" in text
    assert "| repaired_motions | 12ab |" in text
    assert "| mirror | 1.3 | 1 |" in text
    assert "<b>" not in text and "Jane &lt;b&gt;Doe&lt;/b&gt; \\| \\[x](y)" in text
    assert read_database(database).manifest["clips"] == 3


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (["{db}/none", "--format", "gmr", "--out", "{out}"], "it is not a folder"),
        (["{db}", "--format", "gmr", "--out", "{db}/inside"], "it is in the database, whose files have digests"),
        (["{db}", "--format", "gmr", "--out", "{out}", "--skill", "fly"], "unknown skill 'fly'; there are: run, walk"),
        (["{out}", "--format", "gmr", "--out", "{out}"], "not a whole expert database"),
    ],
)
def test_what_can_not_be_exported_is_told(database, tmp_path, capsys, arguments, says):
    (tmp_path / "out").mkdir()
    filled = [each.format(db=database, out=tmp_path / "out") for each in arguments]
    assert main(["export", *filled]) == 1
    assert says in capsys.readouterr().err
