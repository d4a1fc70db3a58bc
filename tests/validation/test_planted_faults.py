"""Each planted fault fails a required cell of the shipped bars that the published policy passes."""

import dataclasses
from pathlib import Path

import numpy as np
import pytest

from pipeline.batch import ClipPool
from pipeline.deployment import load_policy
from pipeline.files import settings
from pipeline.validation.bars import ValidationSettings
from pipeline.validation.cross_engine_faults import FAULTS, with_normalizer
from pipeline.validation.deployed import ANKLE_KD, Deployed, deployed, with_ankle_kd
from pipeline.validation.measure import measure
from pipeline.validation.suites import named
from pipeline.validation.verdict import Verdict, judge

CAUGHT_BY = {
    "gyro in the world frame": "curve vx +0.6 yaw +0.8",
    "gyro in deg/s": "stand",
    "left and right swapped": "stand",
    "reversed history": "vx +0.6",
    "wrong joint order": "stand",
    "action scale halved": "vx +0.6",
    "60 % torque": "vx +2.0",
    "half Kp": "stand",
    "normalizer left out": "vx +0.6",
}
"""A cell that shows it; others do too."""

pytestmark = pytest.mark.shared


@pytest.fixture(scope="module")
def published(root: Path, policies: Path) -> Deployed:
    """The published policy with the ankle damping that it is deployed with."""
    return with_ankle_kd(deployed(root / "robots" / "t1", load_policy(policies / "t1_walk.npz")), ANKLE_KD)


@pytest.fixture(scope="module")
def bars(root: Path) -> ValidationSettings:
    return settings.read(root / "data" / "validation.yaml", ValidationSettings)


def _judged(one: Deployed, bars: ValidationSettings, cells: list[str]) -> Verdict:
    found = measure(one, named(one.robot, dict.fromkeys(cells, 1)), ClipPool(workers=1))
    return judge(found, bars, suite="test", policy="", robot="")


def test_the_published_policy_passes_the_cells_that_show_faults(published: Deployed, bars: ValidationSettings):
    verdict = _judged(published, bars, sorted(set(CAUGHT_BY.values())))
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
    verdict = _judged(FAULTS[fault](good), bars, [CAUGHT_BY[fault]])
    assert not verdict.passed
    assert {reason.cell for reason in verdict.reasons} == {CAUGHT_BY[fault]}
