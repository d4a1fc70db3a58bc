"""Known security advisories on the locked packages, from a copy of an advisory database, without network access.

    python benchmarks/advisories.py ADVISORIES [--pins requirements.lock constraints.txt] [--json]

ADVISORIES is a folder of advisories in the OSV format (https://ossf.github.io/osv-schema) as YAML or JSON, at any
depth: a checkout of https://github.com/pypa/advisory-database, or the unpacked `all.zip` of PyPI from https://osv.dev.
Exit code 1 if an advisory applies or the copy is too old to be conclusive.
"""

from __future__ import annotations

import argparse
import datetime
import json
import re
import sys
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import yaml
from packaging.utils import canonicalize_name
from packaging.version import InvalidVersion, Version

ROOT = Path(__file__).resolve().parent.parent
sys.path.insert(0, str(ROOT))

from benchmarks.report import Bar, machine, report  # noqa: E402

PINS = [ROOT / "requirements.lock", ROOT / "constraints.txt"]
"""The second file also lists torch."""
MOST_DAYS = 31.0
"""Largest age of the newest advisory [days]; several on Python packages appear each week."""
PINNED = re.compile(r"^([A-Za-z0-9][A-Za-z0-9._-]*)==([^\s;\\]+)", re.MULTILINE)
NAME = re.compile(r"""\bname["']?: *["']?([A-Za-z0-9._-]+)""")
CHANGED = re.compile(r"""\b(?:modified|published)["']?: *["']?(\d{4}-\d{2}-\d{2})""")


@dataclass(frozen=True, kw_only=True)
class Looked:
    """Result of looking up packages in a database copy."""

    advisories: int
    newest: datetime.date
    """Date of the newest change of an advisory."""
    found: tuple[str, ...]
    """One line per applicable advisory."""


def pinned(path: Path) -> dict[str, Version]:
    """Read a file of pins: normalized name -> version."""
    return {canonicalize_name(name): Version(version) for name, version in PINNED.findall(path.read_text())}


def look_up(folder: Path, packages: Mapping[str, Version]) -> Looked:
    """Find the advisories in a folder that apply to the packages. Raises ValueError for a folder without advisories."""
    count, days, found = 0, set(), []
    for path in sorted((*folder.rglob("*.yaml"), *folder.rglob("*.json"))):
        text = path.read_text(encoding="utf-8")
        if not CHANGED.search(text):
            continue
        count, days = count + 1, days | set(CHANGED.findall(text))
        if {canonicalize_name(name) for name in NAME.findall(text)} & packages.keys():
            advisory = json.loads(text) if path.suffix == ".json" else yaml.safe_load(text)
            found += applying(advisory, packages)
    if not count:
        raise ValueError(f"{folder}: holds no advisories (.yaml or .json files in the OSV format).")
    return Looked(advisories=count, newest=datetime.date.fromisoformat(max(days)), found=tuple(found))


def applying(advisory: Mapping[str, Any], packages: Mapping[str, Version]) -> list[str]:
    """One line per package and version that an advisory affects; none for a withdrawn advisory."""
    found = []
    for affected in advisory.get("affected", ()) if not advisory.get("withdrawn") else ():
        package = affected.get("package", {})
        name = canonicalize_name(package.get("name", ""))
        if package.get("ecosystem") == "PyPI" and name in packages and _affects(affected, packages[name]):
            names = ", ".join([advisory["id"], *advisory.get("aliases", ())])
            summary = " ".join((advisory.get("summary") or advisory.get("details") or "").split())[:100]
            found.append(f"{name} {packages[name]}: {names}: {summary}")
    return found


def _affects(affected: Mapping[str, Any], version: Version) -> bool:
    """Whether a version is listed, or within a range of versions."""
    if any(_version(each) == version for each in affected.get("versions", ())):
        return True
    ranges = [each for each in affected.get("ranges", ()) if each.get("type") == "ECOSYSTEM"]
    return any(_within(each["events"], version) for each in ranges)


def _within(events: list[Mapping[str, str]], version: Version) -> bool:
    """Whether the last event up to a version marks it as affected."""
    steps = []
    for event in events:
        ((kind, text),) = event.items()
        steps.append((_version(text), kind))
    inside = False
    for at, kind in sorted(steps):
        if kind == "introduced" and at <= version:
            inside = True
        elif (kind == "fixed" and at <= version) or (kind == "last_affected" and at < version):
            inside = False
    return inside


def _version(text: str) -> Version:
    """Parse a version; one that is not a Python version counts as older than all."""
    try:
        return Version(text)
    except InvalidVersion:
        return Version("0.dev0")


def main() -> int:
    """Print the table and the advisories that apply; 0 when there are none in a recent copy."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("advisories", type=Path, metavar="ADVISORIES", help="folder of the database's copy")
    parser.add_argument("--pins", type=Path, nargs="+", default=PINS, help="files with name==version by line")
    parser.add_argument("--json", action="store_true", help="print one JSON object")
    arguments = parser.parse_args()
    packages = {name: version for path in arguments.pins for name, version in pinned(path).items()}
    try:
        looked = look_up(arguments.advisories, packages)
    except ValueError as error:
        print(error, file=sys.stderr)
        return 2
    for line in looked.found:
        print(line, file=sys.stderr)
    age = (datetime.datetime.now(datetime.UTC).date() - looked.newest).days
    bars = [
        Bar(name="packages", value=float(len(packages)), sense=">=", bound=1.0),
        Bar(name="advisories in the copy", value=float(looked.advisories)),
        Bar(name="age of the newest", value=float(age), unit="days", sense="<=", bound=MOST_DAYS),
        Bar(name="advisories that apply", value=float(len(looked.found)), sense="<=", bound=0.0),
    ]
    return 0 if report(bars, machine=machine(), json=arguments.json) else 1


if __name__ == "__main__":
    sys.exit(main())
