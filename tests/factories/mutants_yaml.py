"""Faults of the files that a person writes: data/sources.yaml and settings."""

from __future__ import annotations

from collections.abc import Mapping

SOURCES = """\
sources:
  - name: mine
    folder: motions
    licence: CC0-1.0
"""

BOMB = "a: &a [x, x, x, x, x, x, x, x, x]\n" + "".join(
    f"{name}: &{name} [{', '.join([f'*{before}'] * 9)}]\n" for before, name in zip("abcdefgh", "bcdefghi", strict=True)
)
"""Nine to the ninth strings in some hundred bytes."""

ANY_FILE: Mapping[str, bytes] = {
    "empty": b"",
    "a list": b"- 1\n- 2\n",
    "a text": b"hello",
    "an alias bomb": BOMB.encode(),
    "10,000 deep": b"[" * 10_000 + b"]" * 10_000,
    "mappings 10,000 deep": b"{a: " * 10_000 + b"}" * 10_000,
    "code": b"!!python/object/apply:os.system ['true']\n",
    "an unknown tag": b"!secret {a: 1}\n",
    "two documents": b"a: 1\n---\nb: 2\n",
    "a bracket missing": b"a: [1, 2\n",
    "tabs for blanks": b"a:\n\tb: 1\n",
    "latin-1": "a: é\n".encode("latin-1"),
    "UTF-16 without a mark": "a: 1\n".encode("utf-16-le"),
    "zero bytes": b"a: \0\n",
    "larger than a megabyte": b"# " + b"x" * 1_100_000 + b"\n",
    "a key that is a list": b"? [1, 2]\n: 3\n",
    "a key that is a mapping": b"? {a: 1}\n: 3\n",
    "a date for a mapping": b"2020-01-01\n",
    "binary": b"\x89PNG\r\n\x1a\n\x00\x00",
}
"""What no settings file may be."""

SOURCES_FAULTS: Mapping[str, str] = {
    "a key twice": SOURCES.replace("folder: motions", "folder: motions\n    folder: /etc"),
    "sources twice": SOURCES + SOURCES,
    "an alias": SOURCES.replace("name: mine", "name: &n mine").replace("licence: CC0-1.0", "licence: *n"),
    "a merge": "base: &b {licence: x}\nsources:\n  - <<: *b\n    name: mine\n    folder: motions\n",
    "an unknown key": SOURCES + "    folders: more\n",
    "a key of capitals": SOURCES.replace("licence", "Licence"),
    "no licence": SOURCES.replace("    licence: CC0-1.0\n", ""),
    "no folder": SOURCES.replace("    folder: motions\n", ""),
    "a folder that is not there": SOURCES.replace("motions", "nowhere"),
    "a folder that is a file": SOURCES.replace("motions", "sources.yaml"),
    "a folder of zero bytes": SOURCES.replace("motions", '"a\\0b"'),
    "a folder of 5,000 letters": SOURCES.replace("motions", "x" * 5000),
    "a folder of nothing": SOURCES.replace("motions", '"nowhere/../../.."').replace("name: mine", "name: ../mine"),
    "a link that leads in a circle": SOURCES.replace("motions", "circle"),
    "a name with a slash": SOURCES.replace("name: mine", "name: mine/../../x"),
    "a name that climbs": SOURCES.replace("name: mine", "name: .."),
    "no name": SOURCES.replace("name: mine", 'name: ""'),
    "a name that is true": SOURCES.replace("name: mine", "name: yes"),
    "a name that is a number": SOURCES.replace("name: mine", "name: 12:30:45"),
    "two of one name": SOURCES + SOURCES.replace("sources:\n", ""),
    "a list for a source": "sources:\n  - [mine, motions, CC0-1.0]\n",
    "a mapping for the list": "sources:\n  name: mine\n  folder: motions\n  licence: x\n",
    "no sources": "sources:\n",
    "a rate in words": SOURCES + "    statement: {fps: fast}\n",
    "a rate of nan": SOURCES + "    statement: {fps: .nan}\n",
    "a rate of infinity": SOURCES + "    statement: {fps: .inf}\n",
    "a rate that is true": SOURCES + "    statement: {fps: yes}\n",
    "a rate of 1e999": SOURCES + "    statement: {fps: 1e999}\n",
    "an unknown statement": SOURCES + "    statement: {rate: 30}\n",
}
"""Sources files that have to be refused."""


def settings_faults(text: str) -> dict[str, str]:
    """A settings file of numbers with one fault each: `text` holds `limit_excess` with unit and source in `joints:`."""
    line = next(
        line for line in text.splitlines() if line.startswith("  limit_excess: {value: 0.05, unit: rad")
    ).strip()
    words = (
        "",
        "null",
        "x",
        ".nan",
        "-.inf",
        "1e999",
        "yes",
        "[0.05]",
        "{a: 1}",
        "0.05 rad",
        "2020-01-01",
        "0,05",
        "-1",
    )
    found = {f"the value '{word}'": text.replace(line, line.replace("0.05", word), 1) for word in words}
    found |= {f"'{word}' for value, unit and source": text.replace(line, f"limit_excess: {word}", 1) for word in words}
    return found | {
        "the bare number": text.replace(line, "limit_excess: 0.05", 1),
        "another unit": text.replace(line, line.replace("unit: rad", "unit: deg"), 1),
        "no unit": text.replace(line, line.replace("unit: rad, ", ""), 1),
        "a source of another kind": text.replace(line, line.replace("source: cal", "source: me"), 1),
        "a source that is a list": text.replace(line, line.replace("source: cal", "source: [cal]"), 1),
        "a source without a sentence": text.replace(line, line[: line.index("why:")] + "why: ''}", 1),
        "one more word of a number": text.replace(line, line.replace("{", "{least: 0, "), 1),
        "a key twice": text.replace(line, f"{line}\n  limit_excess: 9.0", 1),
        "a section twice": text + "\njoints:\n  limit_excess: 9.0\n",
        "an alias": text.replace(line, line.replace("0.05", "&x 0.05") + "\n  speed_over: *x", 1),
        "a key left out": text.replace(line, "", 1),
        "a key misspelt": text.replace(line, line.replace("limit_excess", "limit_exces"), 1),
        "a section left out": text.replace("joints:", "joint:", 1),
        "cut in the middle": text[: len(text) // 2],
    }
