"""Text of strangers as it may be shown: names of files, licences and reasons are text, never markup.

Markdown is rendered with whatever HTML is in it by the viewer, and by other programs in their own ways. So every
character that could mean something is written as a character reference, which all of them show as the character.
"""

import re
from collections.abc import Iterable, Sequence

_PLAIN = re.compile(r"[^A-Za-z0-9 .,:/\-\u00a0-\U0010ffff]")
"""What is not shown as it is: punctuation of ASCII and control characters."""


def escaped(text: object) -> str:
    """`str(text)` on one line of Markdown or HTML, shown as it is."""
    return _PLAIN.sub(lambda match: f"&#{ord(match[0])};" if match[0].isprintable() else " ", decodable(str(text)))


_MARKS = (("&", "&amp;"), ("\\", "&#92;"), ("<", "&lt;"), (">", "&gt;"), ("|", "\\|"), ("[", "\\["), ("`", "'"))
"""What a text of a file that people also open in an editor must not hold, and what is written in its place."""


def cell(value: object) -> str:
    """`plain` of at most 300 characters; empty for None and NaN."""
    if value is None or value != value:
        return ""
    return plain(value, 300)


def plain(value: object, most: int | None = None) -> str:
    """`str(value)` on one line of a Markdown file, without markup; of a longer one its first `most` characters.

    Unlike `escaped` it leaves punctuation that means nothing there, since such a file is also read as it is.
    """
    text = " ".join(decodable(str(value)).split())[:most]
    for mark, instead in _MARKS:
        text = text.replace(mark, instead)
    return text


def markdown_list(texts: Iterable[object], none: str = "none") -> str:
    """Texts as a list in Markdown; `none` where there are none."""
    return "\n".join(f"- {escaped(text)}" for text in texts) or none


def markdown_table(header: Sequence[object], rows: Iterable[Sequence[object]]) -> str:
    lines = [header, ["---"] * len(header), *rows]
    cells = [[text if text == "---" else escaped(text) for text in line] for line in lines]
    return "\n".join(f"| {' | '.join(line)} |" for line in cells)


def decodable(text: str) -> str:
    r"""The text with the bytes of a file's name that are no UTF-8 written out (`\udcff`), so that it can be stored."""
    return text.encode("utf-8", "backslashreplace").decode("utf-8")
