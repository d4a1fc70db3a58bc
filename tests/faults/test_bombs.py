"""Files that ask for more than there is, read in a process that may have little memory and little time."""

import os
import resource
import subprocess
import sys
from pathlib import Path

import pytest

from tests.factories.mutants_bvh import nested
from tests.factories.mutants_npz import bombs
from tests.factories.mutants_text import deepmimic_mutants
from tests.factories.mutants_yaml import BOMB

ROOT = Path(__file__).resolve().parents[2]
COMMAND = "import sys; from pipeline.cli.main import main; sys.exit(main())"
MOST_BYTES, MOST_S = 1_500_000_000, 60
"""Address space, of which the interpreter with all it has loaded takes a half; and processor time."""


def limits() -> None:
    """Of the process that is about to start."""
    resource.setrlimit(resource.RLIMIT_AS, (MOST_BYTES, MOST_BYTES))
    resource.setrlimit(resource.RLIMIT_CPU, (MOST_S, MOST_S))


@pytest.fixture(scope="module")
def inspected(tmp_path_factory) -> tuple[int, dict[str, str], str]:
    """Exit code of `booster-lab inspect` on a folder of bombs, its line of each file, and all of standard error."""
    folder = tmp_path_factory.mktemp("bombs")
    for index, mutant in enumerate(bombs()):
        mutant.put(folder / f"bomb{index}")
    deep = [mutant for mutant in deepmimic_mutants() if "deep" in mutant.name]
    for index, mutant in enumerate(deep):
        mutant.put(folder / f"deep{index}")
    (folder / "joints.bvh").write_text(nested(100_000))
    (folder / "line.bvh").write_bytes(b"HIERARCHY\n" + b"x" * 20_000_000)
    (folder / "aliases.bvh").write_text("HIERARCHY\n")
    (folder / "aliases.yaml").write_text(BOMB)
    environment = {**os.environ, "OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}
    done = subprocess.run(
        [sys.executable, "-c", COMMAND, "inspect", str(folder)],
        check=False,
        cwd=ROOT,
        env=environment,
        capture_output=True,
        text=True,
        timeout=4 * MOST_S,
        preexec_fn=limits,
    )
    lines = {line.split()[0]: line for line in done.stdout.splitlines() if line.split()}
    return done.returncode, lines, done.stderr


def test_the_command_reports_every_bomb_and_continues(inspected):
    code, lines, errors = inspected
    assert code == 0, errors[-2_000:]
    assert "Traceback" not in errors
    assert "MemoryError" not in errors + str(lines)
    assert sum(name.startswith(("bomb", "deep")) for name in lines) == len(bombs()) + 2


@pytest.mark.parametrize(
    ("file", "says"),
    [
        ("bomb0/walk.npz", "inflates from"),
        ("bomb1/walk.npz", "claims shape"),
        ("bomb2/walk.npz", "not a NumPy archive"),
        ("bomb3/walk.bvh", "more than the 400000000 allowed"),
        ("bomb4/walk.txt", "more than the 400000000 allowed"),
        ("joints.bvh", "deeper than 200 joints"),
        ("line.bvh", "not part of a BVH hierarchy"),
        ("aliases.bvh", "no MOTION section"),
    ],
)
def test_a_bomb_is_refused_for_what_it_is(inspected, file, says):
    assert says in inspected[1][file]
