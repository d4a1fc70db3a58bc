"""Settings files: what is refused, and that every fault is named at once."""

from dataclasses import dataclass
from pathlib import Path

import pytest

from pipeline.errors import SettingsError
from pipeline.files import settings


@dataclass(frozen=True, kw_only=True)
class Inner:
    limit: float
    name: str = "none"


@dataclass(frozen=True, kw_only=True)
class Outer:
    count: int
    inner: Inner
    each: dict[str, float]
    pair: tuple[float, float] = (0.0, 1.0)


def written(folder: Path, text: str) -> Path:
    path = folder / "settings.yaml"
    path.write_text(text)
    return path


GOOD = "count: 3\ninner: {limit: 1e3}\neach: {walk: 2, run: 0.5}\n"


def test_a_good_file_is_read_by_the_types_of_its_fields(tmp_path):
    found = settings.read(written(tmp_path, GOOD), Outer)
    assert found == Outer(count=3, inner=Inner(limit=1000.0), each={"walk": 2.0, "run": 0.5})
    assert settings.plain(found)["pair"] == [0.0, 1.0]


def test_all_faults_are_named_at_once(tmp_path):
    path = written(tmp_path, "count: many\ninner: {limit: .nan, nam: x}\npair: [1]\n")
    with pytest.raises(SettingsError) as caught:
        settings.read(path, Outer)
    for part in ("'count' is 'many'", "'inner.limit'", "unknown key 'inner.nam'", "'pair' has 1", "'each' is missing"):
        assert part in str(caught.value)


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("count: 1\ncount: 2\n", "duplicate key 'count'"),
        ("a: &x [1]\nb: *x\n", "aliases are not allowed"),
        ("a: [1\n", "line 2"),
        ("a: !!python/object:os.system x\n", "line 1: tags such as 'tag:yaml.org,2002:python/object:os.system'"),
        ("a: !!int 1:30\n", "line 1: tags such as"),
        ("a: !!int 0x10\n", "line 1: tags such as"),
        ("a: !!float '１.５'\n", "line 1: tags such as"),
        ("a: !!seq [1]\n", "line 1: tags such as"),
        ("!!map {a: 1}\n", "line 1: tags such as"),
        ("a: 1\nb: 2020-13-45\n", r"line 2: a value can't be read \(month must be in 1\.\.12\)"),
        ("a: " + "9" * 5000 + "\n", "line 1: a value can't be read"),
        ("a: !!timestamp x\n", "line 1: tags such as"),
    ],
)
def test_yaml_that_could_mean_harm_is_refused_with_its_line(tmp_path, text, says):
    with pytest.raises(SettingsError, match=says):
        settings.read_yaml(written(tmp_path, text))


def test_a_truth_value_is_no_number(tmp_path):
    with pytest.raises(SettingsError, match="'count' is True"):
        settings.read(written(tmp_path, GOOD.replace("3", "yes", 1)), Outer)


def test_a_missing_file_is_named(tmp_path):
    with pytest.raises(SettingsError, match=r"gone\.yaml: the file does not exist"):
        settings.read_yaml(tmp_path / "gone.yaml")
