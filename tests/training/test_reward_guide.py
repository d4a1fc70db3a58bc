"""What `docs/add_a_reward.md` says, done to a copy of the code, and trained."""

from __future__ import annotations

import csv
import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from tests.factories.training_bundle import small_bundle

SIZES = ("simulation.num_envs=4", "distillation.iterations=1", "schedule.iterations=2")
PLACES = (
    ("rewards.py", "\n\ndef reward_cfg("),
    ("rewards.py", "    }\n    return {name: each"),
    ("config.py", "    joint_limits: str = option("),
)
"""Where each block of the guide goes: before this text of that file."""


@pytest.fixture
def code(root: Path, tmp_path: Path) -> Path:
    """A folder with the project's code, changed as the guide says."""
    shutil.copytree(root / "pipeline", tmp_path / "pipeline", ignore=shutil.ignore_patterns("__pycache__"))
    page = (root / "docs" / "add_a_reward.md").read_text()
    blocks = re.findall(r"```python\n(.*?)```", page, re.DOTALL)
    for block, (name, before) in zip(blocks, PLACES, strict=True):
        (path,) = (tmp_path / "pipeline" / "training").rglob(name)
        text = path.read_text()
        assert text.count(before) == 1
        path.write_text(text.replace(before, f"\n\n{block}{before}" if before.startswith("\n") else block + before))
    return tmp_path


def test_the_guides_term_is_trained_and_is_in_the_curves(code: Path, root: Path, robot, tmp_path: Path):
    bundle = small_bundle(tmp_path / "small", root, robot, tracker="passive")
    page = (root / "docs" / "add_a_reward.md").read_text().replace("\\\n", " ")
    (line,) = re.findall(r"^    python (-m pipeline\.training .*)$", page, re.MULTILINE)
    words = [*line.split(), *(word for size in SIZES for word in ("--set", size))]
    words[words.index("--bundle") + 1] = str(bundle)
    environment = {**os.environ, "PYTHONPATH": str(code)}
    done = subprocess.run([sys.executable, *words], cwd=code, env=environment, capture_output=True, text=True)
    assert done.returncode == 0, done.stdout + done.stderr
    rows = list(csv.DictReader((code / "trial" / "curves.csv").read_text().splitlines()))
    assert len(rows) == 2
    values = [float(row["reward_flight"]) for row in rows]
    assert all(-2.0 <= value <= 0.0 for value in values)
    assert any(value < 0.0 for value in values)
    for row in rows:
        total = sum(float(value) for name, value in row.items() if name.startswith("reward_"))
        assert 0.02 * total == pytest.approx(float(row["task_reward"]), rel=1e-3)
