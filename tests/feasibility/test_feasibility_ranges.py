"""What data/feasibility.yaml may say: every number has a range, and all faults are told at once."""

import re
from collections.abc import Iterator
from pathlib import Path

import pytest

from pipeline.errors import SettingsError
from pipeline.feasibility import FeasibilitySettings
from pipeline.files import settings
from pipeline.files.sourced import origins

FILE = Path(__file__).resolve().parents[2] / "data" / "feasibility.yaml"


@pytest.mark.parametrize(
    ("line", "changed", "said"),
    [
        ("min_seconds: {value: 0.4", "min_seconds: {value: 0", r"'cut.min_seconds' is 0, allowed is 0.04 to 60"),
        (
            "limit_excess: {value: 0.05",
            "limit_excess: {value: -0.1",
            r"'joints.limit_excess' is -0.1, allowed is 0 to 1",
        ),
        (
            "speed_over_share: {value: 0.12",
            "speed_over_share: {value: 5",
            r"'joints.speed_over_share' is 5, allowed is 0 to 1",
        ),
        (
            "on_speed: {value: 0.4",
            "on_speed: {value: 0.9",
            r"'contact.off_speed' is 0.7, allowed is more than 'on_speed'",
        ),
        ("saturation: {value: 0.99", "saturation: {value: 1.5", r"'torque.saturation' is 1.5, allowed is 0.5 to 1"),
        ("saturation_share: {value: 0.5", "saturation_share: {value: 2", r"'torque.saturation_share' is 2"),
        ("saturation_run_s: {value: 0.8", "saturation_run_s: {value: -1", r"'torque.saturation_run_s' is -1"),
        ("residual_window_s: {value: 0.5", "residual_window_s: {value: 0", r"'torque.residual_window_s' is 0"),
        ("followed: {value: 0.5", "followed: {value: 2", r"'tracking.followed' is 2, allowed is 0 to 1"),
        (
            "inferred_slip_mean: {value: [0.05",
            "inferred_slip_mean: {value: [-0.1",
            r"'feet.inferred_slip_mean\[0\]' is -0.1",
        ),
        ("slip_mean: {value: [0.1, 0.06]", "slip_mean: {value: [0.1, -1]", r"'feet.slip_mean\[1\]' is -1"),
        (
            "glide_s: {value: [0.08, 0.075]",
            "glide_s: {value: [0.08, -1]",
            r"'feet.glide_s\[1\]' is -1, allowed is 0 to 10",
        ),
        (
            "height: {value: [0.7, 1.2]",
            "height: {value: [1.2, 0.7]",
            r"'root.height\[1\]' is 0.7, allowed is more than the first",
        ),
        ("tilt_deg: {value: 45.0", "tilt_deg: {value: 450", r"'root.tilt_deg' is 450"),
        ("max_ratio: {value: 10.0", "max_ratio: {value: 0.5", r"'balance.max_ratio' is 0.5, allowed is at least 1"),
        (
            "force_residual: {value: 0.1",
            "force_residual: {value: 0",
            r"'torque.force_residual' is 0, allowed is more than 0",
        ),
    ],
)
def test_a_number_out_of_its_range_is_refused_by_its_name(tmp_path, line, changed, said):
    text = FILE.read_text()
    assert line in text
    (tmp_path / "feasibility.yaml").write_text(text.replace(line, changed, 1))
    with pytest.raises(SettingsError, match=said):
        settings.read(tmp_path / "feasibility.yaml", FeasibilitySettings)


def test_all_faults_are_told_at_once(tmp_path):
    text = (
        FILE.read_text()
        .replace("saturation: {value: 0.99", "saturation: {value: 9")
        .replace("tilt_deg: {value: 45.0", "tilt_deg: {value: -1")
    )
    (tmp_path / "feasibility.yaml").write_text(text)
    with pytest.raises(SettingsError, match=r"torque\.saturation.*root\.tilt_deg"):
        settings.read(tmp_path / "feasibility.yaml", FeasibilitySettings)


def test_every_number_bears_unit_source_and_a_sentence():
    """The whole file: what no motion is held against, too."""
    said = origins(settings.read_yaml(FILE))
    plain = settings.plain(settings.read(FILE, FeasibilitySettings))
    assert {name: settings.plain(each.value) for name, each in said.items()} == dict(_numbers(plain))
    assert {name.partition(".")[0] for name in said} == set(plain)


@pytest.mark.parametrize("name", ["cell_power", "max_ratio", "same_gait", "smooth_jerk", "missing_seconds"])
@pytest.mark.parametrize(
    ("part", "instead", "said"),
    [
        (r"\{value: ([\d.]+),[^}]*\}", r"\1", "expected {value: …, unit: "),
        (r"unit: [^,]*,", "unit: bananas,", ".unit' is 'bananas', expected '"),
        (r"source: \w+,", "source: told,", ".source' is 'told', there are: cal, lit, phys, judge"),
        (r', why: "[^"]*"', "", ".why' is missing"),
    ],
)
def test_a_number_that_balances_is_refused_as_the_others_are(tmp_path, name, part, instead, said):
    head, found, rest = FILE.read_text().partition(f"\n  {name}: ")
    assert found
    (tmp_path / "feasibility.yaml").write_text(head + found + re.sub(part, instead, rest, count=1))
    with pytest.raises(SettingsError, match=rf"'balance\.{name}.*{re.escape(said)}"):
        settings.read(tmp_path / "feasibility.yaml", FeasibilitySettings)


def _numbers(plain: dict, where: str = "") -> Iterator[tuple[str, object]]:
    """Dotted name and value of every number, or list of numbers, in nested settings."""
    for name, value in plain.items():
        if isinstance(value, dict):
            yield from _numbers(value, f"{where}{name}.")
        else:
            yield where + name, value
