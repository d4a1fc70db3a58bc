"""The policy that ships: its card states the thresholds it misses, its export is whole, planted faults are found."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from pipeline.export.folder import Export, complete_export, read_export
from pipeline.export.parity import read_golden, replay
from pipeline.validation.bars import ValidationSettings, read_validation
from pipeline.validation.deployed import Deployed, deployed
from pipeline.validation.suites import full
from tests.factories.cross_engine_faults import FAULTS
from tests.factories.planted_faults import CAUGHT_BY, judged
from tests.factories.vendor_deploy import VendorPolicy, import_task, vendor_modules


@pytest.fixture(scope="module")
def shipped(root: Path, robot) -> Export:
    return read_export(root / "robots" / "t1" / "policies" / "walk", robot)


@pytest.fixture(scope="module")
def walking(root: Path, shipped: Export) -> Deployed:
    return deployed(root / "robots" / "t1", shipped.policy)


@pytest.fixture(scope="module")
def bars(root: Path) -> ValidationSettings:
    return read_validation(root / "data/validation.yaml", root / "robots/t1/validation.yaml")


def test_what_was_measured_of_it_holds_every_required_bar_but_across_ten_degrees(
    shipped: Export, bars: ValidationSettings, robot
):
    measured = shipped.card.figures["cells"]
    assert set(measured) == set(bars.cells) == {cell.name for cell in full(robot)}
    missed = [
        (name, figure)
        for name, cell in bars.cells.items()
        if cell.required
        for figure, bar in cell.bars.items()
        if not bar.holds(measured[name].get(figure, float("nan")))
    ]
    assert missed == [("terrain grass slope 10 across", figure) for figure in ("falls", "speed_error")]
    required = sum(cell.required for cell in bars.cells.values())
    assert shipped.card.figures["figures"]["required cells"] == required - len(dict(missed))
    assert shipped.card.data["robot_digest"] == bars.reference.robot
    assert shipped.card.shippable


def test_its_golden_vectors_are_what_the_controller_makes_of_their_readings(shipped: Export):
    golden = read_golden(shipped.folder / "golden.npz")
    readings = {name: getattr(golden, name) for name in ("gyro_b", "gravity_b", "command", "joint_pos", "joint_vel")}
    again = replay(shipped.task, shipped.policy, **readings)
    np.testing.assert_allclose(again.observation, golden.observation, atol=1e-6)
    np.testing.assert_allclose(again.targets, golden.targets, atol=1e-5)


def test_the_vendors_inference_gives_its_golden_targets(shipped: Export, robot, tmp_path):
    golden = read_golden(shipped.folder / "golden.npz")
    complete_export(shipped.folder, tmp_path, robot, np.random.default_rng(0))
    with vendor_modules(robot) as registered:
        import_task(tmp_path / "booster_deploy" / "tasks" / "booster_lab")
    vendor = VendorPolicy(registered["booster_lab_walk"])
    for step in range(len(golden.command)):
        readings = (golden.gyro_b, golden.gravity_b, golden.command, golden.joint_pos, golden.joint_vel)
        targets = vendor.targets(*(values[step] for values in readings))
        assert np.abs(targets - golden.targets[step]).max() < 1e-5


def test_it_passes_the_cells_that_show_faults(walking: Deployed, bars: ValidationSettings):
    verdict = judged(walking, bars, sorted(set(CAUGHT_BY.values())))
    assert [str(reason) for reason in verdict.reasons] == []
    assert all(cell.bars.required for cell in verdict.cells)


@pytest.mark.parametrize("fault", FAULTS)
def test_a_fault_planted_into_it_fails_a_required_cell(walking: Deployed, bars: ValidationSettings, fault: str):
    verdict = judged(FAULTS[fault](walking), bars, [CAUGHT_BY[fault]])
    assert not verdict.passed
    assert {reason.cell for reason in verdict.reasons} == {CAUGHT_BY[fault]}
