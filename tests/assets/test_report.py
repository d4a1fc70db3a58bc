"""What a person reads first of a run that failed with a message of the project."""

from collections.abc import Iterator
from contextlib import contextmanager

import dagster as dg
import pytest

from assets.report import as_failure
from pipeline.errors import SettingsError

SENTENCE = "curation.yaml: 'shortest_s' is -5, allowed is at least 0."


def refused():
    try:
        raise KeyError("shortest_s")
    except KeyError as error:
        raise SettingsError("curation.yaml", "'shortest_s' is -5, allowed is at least 0.") from error


@dg.asset
def asset_that_is_refused():
    with as_failure():
        refused()


class ResourceThatIsRefused(dg.ConfigurableResource):
    @contextmanager
    def yield_for_execution(self, context: dg.InitResourceContext) -> Iterator["ResourceThatIsRefused"]:
        with as_failure():
            refused()
        yield self


@dg.asset
def asset_without_its_resource(refused: ResourceThatIsRefused):
    """The resource fails before it."""


@pytest.mark.parametrize("asset", [asset_that_is_refused, asset_without_its_resource])
def test_a_failed_run_begins_and_ends_with_the_sentence(asset, capfd):
    result = dg.materialize([asset], resources={"refused": ResourceThatIsRefused()}, raise_on_error=False)
    shown = capfd.readouterr().err.rstrip().splitlines()
    errors = [event.event_specific_data.error for event in result.all_events if event.is_failure]
    assert errors and all(SENTENCE.rstrip(".") in error.message for error in errors)
    assert shown[-1].endswith(SENTENCE), "what comes above it are frames of Dagster"
    assert "KeyError" not in "".join(shown)


def test_of_a_step_that_failed_no_frame_is_shown():
    result = dg.materialize([asset_that_is_refused], raise_on_error=False)
    (failed,) = [event for event in result.all_events if event.is_step_failure]
    assert "File " not in failed.step_failure_data.error_display_string
    assert SENTENCE in failed.step_failure_data.error_display_string
