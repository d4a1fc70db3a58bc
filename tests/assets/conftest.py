"""Assets run in the tests' own process, where Dagster keeps what an earlier test's history lay in."""

from collections.abc import Iterator

import pytest
from dagster._core.storage.defs_state.base import set_defs_state_storage

from tests.factories.log_folder import one_second_log


@pytest.fixture(autouse=True)
def no_history_of_another_test() -> Iterator[None]:
    """A checkout's history that was open before leaves its relative path behind, which is no file here."""
    with set_defs_state_storage(None):
        yield


@pytest.fixture(scope="package")
def log_bytes() -> bytes:
    """A whole log of the T1, 1 s long."""
    return one_second_log()
