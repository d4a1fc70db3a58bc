"""Each planted fault fails a required cell of the shipped bars that the published policy passes."""

import dataclasses
from pathlib import Path

import numpy as np
import pytest

from pipeline.deployment import load_policy
from pipeline.validation.bars import ValidationSettings, read_validation
from pipeline.validation.deployed import Deployed, deployed, with_ankle_kd
from tests.factories.cross_engine_faults import FAULTS, with_normalizer
from tests.factories.planted_faults import CAUGHT_BY, judged
from tests.factories.policy_walks import ANKLE_KD

pytestmark = pytest.mark.shared


@pytest.fixture(scope="module")
def published(root: Path, policies: Path) -> Deployed:
    """The published policy with the ankle damping that it is deployed with."""
    return with_ankle_kd(deployed(root / "robots" / "t1", load_policy(policies / "t1_walk.npz")), ANKLE_KD)


@pytest.fixture(scope="module")
def bars(root: Path) -> ValidationSettings:
    return read_validation(root / "data/validation.yaml", root / "robots/t1/validation.yaml")


def test_the_published_policy_passes_the_cells_that_show_faults(published: Deployed, bars: ValidationSettings):
    verdict = judged(published, bars, sorted(set(CAUGHT_BY.values())))
    assert verdict.reasons == ()
    assert verdict.passed
    assert all(cell.bars.required for cell in verdict.cells)


@pytest.mark.parametrize("fault", FAULTS)
def test_a_fault_fails_a_required_cell_and_the_verdict_says_which(
    published: Deployed, bars: ValidationSettings, fault: str
):
    good = published
    if fault == "normalizer left out":  # the published policy has none that could be left out
        rng, size = np.random.default_rng(3), published.policy.observation_size
        policy = with_normalizer(published.policy, rng.normal(0.0, 0.3, size), rng.uniform(0.3, 3.0, size))
        good = dataclasses.replace(published, policy=policy)
    verdict = judged(FAULTS[fault](good), bars, [CAUGHT_BY[fault]])
    assert not verdict.passed
    assert {reason.cell for reason in verdict.reasons} == {CAUGHT_BY[fault]}
