"""Advisories of a copied database are matched with pinned packages by name and version."""

import datetime
import json
import sys

import pytest
import yaml

from benchmarks import advisories
from benchmarks.advisories import look_up, pinned


def advisory(name: str = "Some_Package", **affected):
    """An advisory in the OSV format."""
    return {
        "id": "PYSEC-2026-1",
        "aliases": ["CVE-2026-1"],
        "summary": "A file runs code.",
        "modified": "2026-01-02T03:04:05Z",
        "affected": [{"package": {"name": name, "ecosystem": "PyPI"}, **affected}],
    }


def ranges(*events: dict[str, str]):
    return {"ranges": [{"type": "ECOSYSTEM", "events": list(events)}]}


FIXED = ranges({"introduced": "1.0"}, {"fixed": "2.0"})
TWICE = ranges({"introduced": "0"}, {"fixed": "1.0"}, {"introduced": "2.0"}, {"last_affected": "2.4"})


@pytest.mark.parametrize(
    ("affected", "version", "applies"),
    [
        (FIXED, "0.9", False),
        (FIXED, "1.0", True),
        (FIXED, "1.10", True),
        (FIXED, "2.0", False),
        (TWICE, "0.1", True),
        (TWICE, "1.5", False),
        (TWICE, "2.4", True),
        (TWICE, "2.4.1", False),
        ({"versions": ["1.0", "1.1"]}, "1.1.0", True),
        ({"versions": ["1.0", "1.1"]}, "1.2", False),
        ({"ranges": [{"type": "GIT", "events": [{"introduced": "0"}]}]}, "1.0", False),
    ],
)
@pytest.mark.parametrize("suffix", ["yaml", "json"])
def test_a_version_is_looked_up_in_lists_and_ranges(tmp_path, affected, version, applies, suffix):
    (tmp_path / "pins").write_text(f"# a comment\nsome.package=={version} \\\n    --hash=sha256:00\n")
    write = json.dumps if suffix == "json" else yaml.safe_dump
    (tmp_path / f"a.{suffix}").write_text(write(advisory(**affected)))
    looked = look_up(tmp_path, pinned(tmp_path / "pins"))
    assert (looked.advisories, looked.newest) == (1, datetime.date(2026, 1, 2))
    line = f"some-package {pinned(tmp_path / 'pins')['some-package']}: PYSEC-2026-1, CVE-2026-1: A file runs code."
    assert looked.found == ((line,) if applies else ())


def test_withdrawn_advisories_and_those_of_other_packages_do_not_apply(tmp_path):
    (tmp_path / "pins").write_text("some-package==1.5\n")
    found = [{**advisory(**FIXED), "withdrawn": "2026-02-03T00:00:00Z"}, advisory("other", **FIXED)]
    other_index = advisory(**FIXED)
    other_index["affected"][0]["package"]["ecosystem"] = "npm"
    for number, each in enumerate([*found, other_index]):
        (tmp_path / f"{number}.json").write_text(json.dumps(each))
    looked = look_up(tmp_path, pinned(tmp_path / "pins"))
    assert (looked.advisories, looked.found) == (3, ())


@pytest.mark.parametrize(
    ("day", "version", "code"), [("today", "2.0", 0), ("today", "1.5", 1), ("2020-01-01", "2.0", 1)]
)
def test_the_command_fails_for_an_advisory_and_for_an_old_copy(tmp_path, monkeypatch, capsys, day, version, code):
    changed = str(datetime.datetime.now(datetime.UTC).date()) if day == "today" else day
    (tmp_path / "a.json").write_text(json.dumps({**advisory(**FIXED), "modified": f"{changed}T00:00:00Z"}))
    (tmp_path / "pins").write_text(f"some-package=={version}\n")
    monkeypatch.setattr(sys, "argv", ["advisories.py", str(tmp_path), "--pins", str(tmp_path / "pins")])
    assert advisories.main() == code
    assert "advisories that apply" in capsys.readouterr().out


def test_a_folder_without_advisories_is_not_taken_for_none_that_apply(tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(sys, "argv", ["advisories.py", str(tmp_path)])
    assert advisories.main() == 2
    assert "holds no advisories" in capsys.readouterr().err


def test_every_locked_package_is_looked_up(root):
    packages = {name for path in advisories.PINS for name in pinned(path)}
    lines = (root / "constraints.txt").read_text().splitlines()
    assert len(packages) == sum("==" in line and not line.startswith("#") for line in lines)
    assert {"torch", "numpy", "pyyaml"} <= packages
