"""Every script of `examples/` runs as its README says, and prints figures that are right."""

from __future__ import annotations

import json
import re
import subprocess
import sys
from pathlib import Path

import pytest

from pipeline.expert.write import ExpertEntry, write_database
from tests.factories.robot_clips import standing, wandering

WALK = "data/motions/walk.bvh"


@pytest.fixture
def example(root: Path):
    def run(name: str, *arguments: object) -> str:
        command = [sys.executable, f"examples/{name}.py", *map(str, arguments)]
        done = subprocess.run(command, cwd=root, env={"PYTHONPATH": str(root)}, capture_output=True, text=True)
        assert done.returncode == 0, done.stderr
        return done.stdout

    return run


def number(pattern: str, text: str) -> float:
    found = re.search(pattern, text)
    assert found, f"{pattern!r} is not in {text!r}"
    return float(found.group(1))


def test_the_readme_lists_every_script(root: Path):
    listed = set(re.findall(r"python examples/(\w+)\.py", (root / "examples" / "README.md").read_text()))
    assert listed == {path.stem for path in (root / "examples").glob("*.py")}
    assert len(listed) == 6


def test_reading_a_clip_gives_its_length_and_speed(example):
    printed = example("read_clip", WALK)
    assert "bvh, skeleton booster_lab, 14.02 s at 60 Hz" in printed
    assert number(r"mean speed ([\d.]+) m/s", printed) == pytest.approx(0.96, abs=0.02)


def test_retargeting_writes_a_csv_with_small_errors(example, tmp_path: Path):
    printed = example("retarget_clip", WALK, tmp_path / "walk.csv")
    assert number(r"slip ([\d.]+) m/s", printed) < 0.02
    assert number(r"error ([\d.]+) deg", printed) < 2.0
    lines = [line for line in (tmp_path / "walk.csv").read_text().splitlines() if not line.startswith("#")]
    assert len(lines) == pytest.approx(14.02 * 30, abs=3)


def test_scoring_prints_every_figure(example):
    from pipeline.scoring import FIGURES

    printed = example("score_clip", WALK)
    assert all(figure.title in printed for figure in FIGURES)
    assert number(r"frames over a joint limit +([\d.]+) %", printed) == 0.0
    assert number(r"limb direction error +([\d.]+) deg", printed) < 2.0


def test_windows_are_drawn_by_weight_and_stay_in_a_clip(example, robot, tmp_path: Path):
    entries = [
        ExpertEntry(clip=clip, weight=weight, skill="stand", licence="CC0-1.0", numbers={}, stages={})
        for clip, weight in ((standing(robot), 1.0), (wandering(robot, seconds=3.0), 3.0))
    ]
    write_database(tmp_path / "database", entries, robot, stages={})
    printed = example("load_database", tmp_path / "database", 64)
    assert printed.startswith("2 clips")
    assert "windows (64, 4, 72)" in printed


@pytest.mark.parametrize("robot", ["t1", "k1"])
def test_the_shipped_policy_walks_at_the_command(example, robot: str):
    printed = example("run_policy", f"robots/{robot}/policies/walk", 1.0, 0, 0)
    assert number(r"mean speed ([\d.]+) m/s", printed) == pytest.approx(1.0, abs=0.1)


@pytest.mark.parametrize(("log", "fell"), [("stand", "no"), ("side_left_fall", "yes")])
def test_a_robot_log_is_read_with_its_fall(example, log: str, fell: str):
    printed = example("read_robot_log", f"data/hardware_logs/demo/{log}.mcap")
    assert f"fall reported: {fell}" in printed
    assert number(r"largest tilt ([\d.]+) deg", printed) > (60.0 if fell == "yes" else 0.0)


def test_the_notebook_runs_from_top_to_bottom(root: Path, tmp_path: Path):
    notebook = json.loads((root / "examples/quickstart.ipynb").read_text())
    cells = [cell for cell in notebook["cells"] if cell["cell_type"] == "code"]
    assert all(cell["outputs"] == [] and cell["execution_count"] is None for cell in cells), "stored without outputs"
    for name in ("data", "robots", "examples"):
        (tmp_path / name).symlink_to(root / name)
    program = "\n\n".join("".join(cell["source"]) for cell in cells)
    command, environment = [sys.executable, "-c", program], {"PYTHONPATH": str(root)}
    done = subprocess.run(command, cwd=tmp_path, env=environment, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    assert number(r"limb error ([\d.]+) deg", done.stdout) < 2.0
    assert number(r"fell: None, speed ([\d.]+) m/s", done.stdout) == pytest.approx(0.8, abs=0.12)
    assert number(r"(\d+) of \d+ criteria hold", done.stdout) > 20
    assert {path.name for path in (tmp_path / "quickstart").iterdir()} == {"poses.png", "walk.gif"}
