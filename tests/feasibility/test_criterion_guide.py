"""What `docs/add_a_criterion.md` says, done to a copy of the code, and evaluated."""

from __future__ import annotations

import json
import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

PLACES = (
    ("pipeline/feasibility/root_criteria.py", "\n    def __post_init__"),
    ("pipeline/feasibility/root_criteria.py", '@criterion(\n    Criterion("root_jerk"'),
)
"""Where each block of Python goes: before this text of that file."""
DROPS = """
import dataclasses, json, sys
from pathlib import Path
import numpy as np
from pipeline.feasibility import FeasibilitySettings, process
from pipeline.files import settings
from pipeline.robot import load_robot
from tests.factories.robot_clips import standing

robot = load_robot("t1")
clip = standing(robot)
time_s = np.arange(len(clip.root_pos_w)) / clip.fps
falls = clip.root_pos_w - np.outer(np.clip(time_s - 1.0, 0.0, 0.1) * float(sys.argv[1]), [0.0, 0.0, 1.0])
limits = settings.read(Path("data/feasibility.yaml"), FeasibilitySettings)
found = process(dataclasses.replace(clip, root_pos_w=falls), {}, settings=limits, robot=robot)
print(json.dumps([[reason.text for reason in found.reasons if reason.code == "root_drop_speed"]]))
"""
"""Evaluate a robot that stands and drops for 0.1 s at the speed given."""


@pytest.fixture
def code(root: Path, tmp_path: Path) -> Path:
    """A folder with the project's code, thresholds and docs, changed as the guide says."""
    for name in ("pipeline", "docs", "robots/t1"):
        shutil.copytree(
            root / name, tmp_path / name, ignore=shutil.ignore_patterns("__pycache__", "pictures", "policies")
        )
    (tmp_path / "data").mkdir()
    page = (root / "docs" / "add_a_criterion.md").read_text()
    for block, (name, before) in zip(re.findall(r"```python\n(.*?)```", page, re.DOTALL), PLACES, strict=True):
        path = tmp_path / name
        text = path.read_text()
        assert text.count(before) == 1
        path.write_text(text.replace(before, f"{block}\n\n{before}" if before.startswith("@") else block + before))
    (threshold,) = re.findall(r"```yaml\n(.*?)```", page, re.DOTALL)
    settings = (root / "data" / "feasibility.yaml").read_text()
    (tmp_path / "data" / "feasibility.yaml").write_text(settings.replace("\nroot:\n", f"\nroot:\n{threshold}", 1))
    return tmp_path


def run(code: Path, root: Path, *arguments: str) -> str:
    """Output of Python with the copy's `pipeline` and the project's `tests`."""
    environment = {**os.environ, "PYTHONPATH": f"{code}{os.pathsep}{root}"}
    done = subprocess.run([sys.executable, *arguments], cwd=code, env=environment, capture_output=True, text=True)
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


def test_the_guides_criterion_rejects_a_drop_and_is_in_the_docs(code: Path, root: Path):
    ((reason,),) = json.loads(run(code, root, "-c", DROPS, "3.0"))
    assert re.search(r"drops at [23]\.\d m/s; at most 1.5 m/s is allowed\.$", reason)
    assert json.loads(run(code, root, "-c", DROPS, "0.3")) == [[]]
    run(code, root, "-m", "pipeline.feasibility.docs_table", "docs/feasibility.md")
    row = "|  | `root_drop_speed` | downward speed of the root, low-passed [m/s] | `root.drop_speed` |  |"
    assert row in (code / "docs" / "feasibility.md").read_text()
