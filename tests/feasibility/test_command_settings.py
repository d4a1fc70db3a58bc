"""What data/commands.yaml may say: axes of whole cells, each number with unit and source; faults are told by name."""

from pathlib import Path

import pytest

from pipeline.errors import SettingsError
from pipeline.feasibility import CommandSettings, FeasibilitySettings
from pipeline.files import settings
from pipeline.files.sourced import origins

DATA = Path(__file__).resolve().parents[2] / "data"
FILE = DATA / "commands.yaml"
FORWARD, STANDING = "forward: {value: [-0.6, 2.0, 0.2]", "standing_m_s: {value: 0.1"


def test_every_number_has_its_unit_and_its_source():
    units = {name: each.unit for name, each in origins(settings.read_yaml(FILE)).items()}
    assert units == {
        **{"forward": "m/s", "lateral": "m/s", "yaw_rate": "rad/s"},
        **{"standing_m_s": "m/s", "standing_rad_s": "rad/s"},
    }
    assert settings.plain(settings.read(FILE, CommandSettings)).keys() == units.keys()


@pytest.mark.parametrize(
    ("line", "changed", "said"),
    [
        (FORWARD, "forward: {value: [-0.6, 2.0, 0]", "'forward' is -0.6 to 2 in cells of 0, allowed are 1 to 1000"),
        (FORWARD, "forward: {value: [-0.6, 2.0, 0.3]", "'forward' is -0.6 to 2 in cells of 0.3, allowed are 1 to 1000"),
        (FORWARD, "forward: {value: [2.0, -0.6, 0.2]", "'forward' is 2 to -0.6 in cells of 0.2"),
        (FORWARD, "forward: {value: [-0.6, 2.0]", "'forward' has 2 entries, expected more"),
        (FORWARD, "forward: {value: [-0.6, fast, 0.2]", r"'forward\[1\]' is 'fast', expected float"),
        (FORWARD, "forward: {value: 2.0", "'forward' is 2.0, expected a list"),
        (
            FORWARD,
            "forwards: {value: [-0.6, 2.0, 0.2]",
            "unknown key 'forwards', there are: forward.*'forward' is missing",
        ),
        (STANDING, "standing_m_s: {value: -0.1", "'standing_m_s' is -0.1, allowed is at least 0"),
        (STANDING, "standing_m_s: {value: slow", "'standing_m_s' is 'slow', expected float"),
        (STANDING, "standing_m_s: {least: 0.1", "unknown key 'standing_m_s.least'.*'standing_m_s.value' is missing"),
        ("unit: rad/s", "unit: deg/s", "'yaw_rate.unit' is 'deg/s', expected 'rad/s'"),
        ("source: judge", "source: me", "'standing_m_s.source' is 'me', there are: cal, lit, phys, judge"),
        ("# Of an axis", "lateral: [-0.6, 0.6, 0.2] #", "duplicate key 'lateral'"),
    ],
)
def test_a_fault_is_refused_by_file_and_name(tmp_path, line, changed, said):
    text, path = FILE.read_text(), tmp_path / FILE.name
    assert line in text
    path.write_text(text.replace(line, changed, 1))
    with pytest.raises(SettingsError, match=rf"commands\.yaml.*{said}"):
        settings.read(path, CommandSettings)


def test_all_faults_are_told_at_once(tmp_path):
    path = tmp_path / FILE.name
    path.write_text(FILE.read_text().replace("0.2], unit", "0.7], unit").replace(STANDING, "standing_m_s: {value: -1"))
    with pytest.raises(SettingsError, match=r"'forward' is.*'lateral' is.*'standing_m_s' is -1"):
        settings.read(path, CommandSettings)


def test_the_place_where_they_stood_before_is_refused(tmp_path):
    text, path = (DATA / "feasibility.yaml").read_text(), tmp_path / "feasibility.yaml"
    path.write_text(text.replace("balance:\n", "balance:\n  commands: {forward: [-0.6, 2.0, 0.2]}\n"))
    with pytest.raises(SettingsError, match=r"feasibility\.yaml.*unknown key 'balance\.commands'"):
        settings.read(path, FeasibilitySettings)
