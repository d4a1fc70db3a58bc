"""Escape untrusted text for display: names of files, licences and reasons must never be interpreted as markup.

Markdown may contain HTML, and programs render it differently. So every character with a possible meaning is written as
a character reference, which all of them show as that character.
"""

import re
from collections.abc import Iterable, Sequence

_PLAIN = re.compile(r"[^A-Za-z0-9 .,:/\-\u00a0-\U0010ffff]")
"""Characters to escape: ASCII punctuation and control characters."""


def escaped(text: object) -> str:
    """`str(text)` escaped for one line of Markdown or HTML."""
    return _PLAIN.sub(lambda match: f"&#{ord(match[0])};" if match[0].isprintable() else " ", decodable(str(text)))


_MARKS = (("&", "&amp;"), ("\\", "&#92;"), ("<", "&lt;"), (">", "&gt;"), ("|", "\\|"), ("[", "\\["), ("`", "'"))
"""Characters replaced in files that are also read as plain text, and their replacements."""


def cell(value: object) -> str:
    """`plain` of at most 300 characters; empty for None and NaN."""
    if value is None or value != value:
        return ""
    return plain(value, 300)


def plain(value: object, most: int | None = None) -> str:
    """`str(value)` on one line of a Markdown file, without markup, truncated to `most` characters.

    Unlike `escaped` it keeps harmless punctuation, since such a file is also read as plain text.
    """
    text = " ".join(decodable(str(value)).split())[:most]
    for mark, instead in _MARKS:
        text = text.replace(mark, instead)
    return text


def markdown_list(texts: Iterable[object], none: str = "none") -> str:
    """Texts as a Markdown list; `none` if there are none."""
    return "\n".join(f"- {escaped(text)}" for text in texts) or none


def markdown_table(header: Sequence[object], rows: Iterable[Sequence[object]]) -> str:
    lines = [header, ["---"] * len(header), *rows]
    cells = [[text if text == "---" else escaped(text) for text in line] for line in lines]
    return "\n".join(f"| {' | '.join(line)} |" for line in cells)


def decodable(text: str) -> str:
    r"""The text with invalid UTF-8 bytes of a file name written out (`\udcff`), so that it can be stored."""
    return text.encode("utf-8", "backslashreplace").decode("utf-8")
