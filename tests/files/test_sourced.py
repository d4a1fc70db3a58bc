"""Numbers of a settings file with unit and source: what is read, what is refused, what is told of them."""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import pytest

from pipeline.errors import SettingsError
from pipeline.files import settings
from pipeline.files.ranges import POSITIVE
from pipeline.files.sourced import Origin, Unit, origins


@dataclass(frozen=True, kw_only=True)
class Walk:
    speed: Annotated[float, POSITIVE, Unit("m/s")]
    share: Annotated[tuple[float, float], POSITIVE, Unit("of frames")]
    name: str = "none"


@dataclass(frozen=True, kw_only=True)
class Gait:
    walk: Walk


SPEED = "  speed: {value: 2, unit: m/s, source: lit, why: A person walks at half of it.}\n"
SHARE = "  share: {value: [0.1, 0.2], unit: of frames, source: judge, why: 'Few, and more.'}\n"
GOOD = f"walk:\n{SPEED}{SHARE}"


def written(folder: Path, text: str) -> Path:
    path = folder / "gait.yaml"
    path.write_text(text)
    return path


def test_the_settings_hold_the_bare_numbers(tmp_path):
    found = settings.read(written(tmp_path, GOOD), Gait)
    assert found == Gait(walk=Walk(speed=2.0, share=(0.1, 0.2)))
    assert settings.plain(found) == {"walk": {"speed": 2.0, "share": [0.1, 0.2], "name": "none"}}


def test_unit_and_source_of_each_number_are_told_by_its_name(tmp_path):
    assert origins(settings.read_yaml(written(tmp_path, GOOD))) == {
        "walk.speed": Origin(value=2, unit="m/s", source="lit", why="A person walks at half of it."),
        "walk.share": Origin(value=[0.1, 0.2], unit="of frames", source="judge", why="Few, and more."),
    }


@pytest.mark.parametrize(
    ("part", "instead", "says"),
    [
        (SPEED, "  speed: 2\n", r"'walk.speed' is 2, expected \{value: …, unit: m/s, source: cal"),
        (SPEED, "", "'walk.speed' is missing"),
        ("unit: m/s", "unit: km/h", "'walk.speed.unit' is 'km/h', expected 'm/s'"),
        ("source: lit", "source: [lit]", r"'walk.speed.source' is \['lit'\], there are: cal, lit, phys, judge"),
        ("why: A person walks at half of it.", "why: 3", "'walk.speed.why' is 3, expected a sentence"),
        ("value: 2, ", "", "'walk.speed.value' is missing"),
        ("value: 2, ", "value: 2, limit: 3, ", "unknown key 'walk.speed.limit', there are: value, unit, source, why"),
        ("value: 2", "value: -2", "'walk.speed' is -2, allowed is more than 0"),
        ("value: 2", "value: fast", "'walk.speed' is 'fast', expected float"),
        ("[0.1, 0.2]", "[0.1]", "'walk.share' has 1 entries, expected more"),
    ],
)
def test_a_number_that_is_not_whole_is_refused_by_its_name(tmp_path, part, instead, says):
    assert part in GOOD
    with pytest.raises(SettingsError, match=says):
        settings.read(written(tmp_path, GOOD.replace(part, instead, 1)), Gait)


def test_all_faults_of_a_number_are_told_at_once(tmp_path):
    text = GOOD.replace("value: 2, unit: m/s", "value: -1, unit: s").replace("why: 'Few, and more.'", "why: ''")
    with pytest.raises(SettingsError, match=r"walk\.speed\.unit.*'walk\.speed' is -1.*walk\.share\.why"):
        settings.read(written(tmp_path, text), Gait)
