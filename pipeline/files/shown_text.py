"""Text of strangers as it may be shown: names of files, licences and reasons are text, never markup.

Markdown is rendered with whatever HTML is in it by the viewer, and by other programs in their own ways. So every
character that could mean something is written as a character reference, which all of them show as the character.
"""

from __future__ import annotations

import re
from collections.abc import Iterable

_PLAIN = re.compile(r"[^A-Za-z0-9 .,:/\-\u00a0-\U0010ffff]")
"""What is not shown as it is: punctuation of ASCII and control characters."""


def escaped(text: object) -> str:
    """`str(text)` on one line of Markdown or HTML, shown as it is."""
    return _PLAIN.sub(lambda match: f"&#{ord(match[0])};" if match[0].isprintable() else " ", decodable(str(text)))


def markdown_list(texts: Iterable[object], none: str = "none") -> str:
    """Texts as a list in Markdown; `none` where there are none."""
    return "\n".join(f"- {escaped(text)}" for text in texts) or none


def decodable(text: str) -> str:
    r"""The text with the bytes of a file's name that are no UTF-8 written out (`\udcff`), so that it can be stored."""
    return text.encode("utf-8", "backslashreplace").decode("utf-8")
