"""Every command of the README, as it is written there, on a fresh clone with the answers of a database made before."""

import json
import os
import re
import signal
import subprocess
from pathlib import Path

import pytest

from tests.factories.checkout import Checkout

pytestmark = pytest.mark.command

SERVING = ("booster-lab curate", "booster-lab view", "booster-lab play")
"""Commands that serve a page until they are interrupted."""
ELSEWHERE = {
    "make expert_db": "CI runs it (.ci/run)",
    "make test": "CI runs it (.ci/run)",
    "dagster asset materialize --select expert_db": "tests/command/test_materialize.py",
    "dagster dev": "tests/command/test_web_ui.py",
}
"""Commands that other tests run."""
TRAIN = "dagster asset materialize --select t1/amp_policy"


def commands(root: Path) -> list[str]:
    """The commands in the README's code blocks, without their remarks."""
    lines = re.findall(r"^    (\S.*)$", (root / "README.md").read_text(), re.MULTILINE)
    return [line.split("  #")[0].strip() for line in lines]


@pytest.fixture(scope="module")
def checkout(root, tmp_path_factory) -> Checkout:
    return Checkout.make(root, tmp_path_factory.mktemp("readme"), ("walk",)).with_answers_of(root)


def test_the_commands_are_those_that_are_tested(root):
    here = {"inspect", "retarget", "validate"} | {command.split()[1] for command in SERVING}
    known = {each for each in commands(root) if each in ELSEWHERE or each == TRAIN or each.split()[1] in here}
    assert known == set(commands(root))
    assert {*ELSEWHERE, TRAIN} <= known


@pytest.mark.parametrize("start", ["inspect", "retarget", "validate"])
def test_a_command_of_the_readme_ends_well(root, checkout, start):
    (command,) = [each for each in commands(root) if each.startswith(f"booster-lab {start} ")]
    done = checkout.run(*command.split())
    assert done.returncode == 0, done.stdout + done.stderr
    assert done.stdout.strip()
    if start == "retarget":
        assert (checkout.root / "walk.csv").stat().st_size > 10_000


def test_the_command_that_trains_ends_with_a_trial_of_a_policy(checkout):
    """In a checkout without a database, so that it makes that first."""
    done = checkout.run(*TRAIN.split())
    assert done.returncode == 0, done.stdout + done.stderr
    (config,) = (checkout.root / "data" / "policies" / "t1" / "runs").glob("*/config.json")
    assert json.loads(config.read_text())["num_envs"] == 8
    assert (config.parent / "policy.npz").is_file()


@pytest.mark.parametrize("start", SERVING)
def test_a_command_of_the_readme_serves_its_page(root, checkout, start):
    (command,) = [each for each in commands(root) if each.startswith(start)]
    process = subprocess.Popen(
        command.split(),
        cwd=checkout.root,
        env={**checkout.environment(), "BROWSER": "/bin/true"},
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        start_new_session=True,
        preexec_fn=_heed_interrupts,
    )
    try:
        assert process.stdout is not None
        printed = []
        for line in process.stdout:  # warnings of libraries may come first
            printed.append(line)
            if re.match(r"http://(localhost|127\.0\.0\.1):\d+", line):
                break
        else:
            pytest.fail("".join(printed))
    finally:
        os.killpg(process.pid, signal.SIGINT)
        process.wait(timeout=60)
    assert process.returncode in (0, 130, -signal.SIGINT)


def _heed_interrupts() -> None:
    """A background job of a shell ignores Ctrl-C, and so would what it starts."""
    signal.signal(signal.SIGINT, signal.SIG_DFL)
