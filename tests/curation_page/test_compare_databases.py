"""Two versions of a database: what came, left, changed, and what only weighs another amount."""

from pathlib import Path

from pipeline.curation_page.clip_table import ClipTable
from pipeline.curation_page.compare_databases import compare, versions
from pipeline.expert import DatabaseSettings, ExpertEntry, write_database
from pipeline.robot import Robot
from tests.factories.robot_clips import wandering

SETTINGS = DatabaseSettings(max_lost_share=0.9, kept_versions=2)


def test_another_weight_is_no_other_content(robot: Robot, tmp_path: Path):
    folder = tmp_path / "t1"
    for weight, seed in ((1.0, 2), (3.0, 5)):  # the second clip is another motion in the second version
        clips = [wandering(robot, seed=1), wandering(robot, seed=seed), wandering(robot, seed=3)]
        entries = [
            ExpertEntry(
                clip=clip.cut(0, 60, f"lab/{number}"),
                weight=weight if number == 0 else 1.0,
                skill="walk",
                licence="CC0-1.0",
                numbers={"source": "lab"},
            )
            for number, clip in enumerate(clips)
        ]
        write_database(folder, entries, robot, stages={}, settings=SETTINGS)
    after, before = (each.name for each in versions(folder))
    found = compare(folder, before, after, ClipTable(manifests={}, rows=()), ())
    assert [each["clip"] for each in found["weighted"]] == ["lab/0"]
    assert found["changed"] == 1
