"""What all tests share: the robot, and where the things are that are not in the repository."""

import os
from pathlib import Path

import hypothesis
import pytest

from tests.factories.repeated_checks import check_each_kind_of_call_once

for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"):
    os.environ.setdefault(name, "1")  # tests run side by side, one a core
check_each_kind_of_call_once()  # before the first import of what is checked

from pipeline.robot import Robot, load_robot  # noqa: E402

ROOT = Path(__file__).resolve().parent.parent

# The same examples in every run, however long they take: a change is judged by what it changed. Other examples:
# --hypothesis-profile=default.
hypothesis.settings.register_profile("same_examples", derandomize=True, database=None, deadline=None)
hypothesis.settings.load_profile("same_examples")


@pytest.fixture(scope="session")
def root() -> Path:
    """The project's root folder."""
    return ROOT


@pytest.fixture(scope="session")
def robot() -> Robot:
    """The robot of the project; the tests of robots themselves run on each."""
    return load_robot("t1")


@pytest.fixture(scope="session")
def mocap() -> Path:
    """The folder of real recordings beside the checkout; a test that asks for it has the marker `shared`."""
    return shared_folder("mocap", "the real recordings")


@pytest.fixture(scope="session")
def policies() -> Path:
    """The folder of published policies beside the checkout; a test that asks for it has the marker `shared`."""
    return shared_folder("policies", "the published policies")


@pytest.fixture(scope="session")
def cases() -> Path:
    """The folder of small difficult inputs beside the checkout; a test that asks for it has the marker `shared`."""
    return shared_folder("cases", "the difficult inputs")


def shared_folder(name: str, what: str) -> Path:
    """A folder beside the checkout; skips the test where it is absent."""
    folder = ROOT.parent / "shared" / name
    if not folder.is_dir():
        pytest.skip(f"needs {what} of ../shared/{name}, which are not part of the project")
    return folder
