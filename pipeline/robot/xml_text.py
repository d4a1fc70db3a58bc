"""Deterministic XML text: numbers in their shortest form, two spaces per level."""

from __future__ import annotations

from collections.abc import Iterable
from xml.etree import ElementTree as Xml


def numbers(values: Iterable[float]) -> str:
    """Numbers separated by spaces, exact, without a negative zero."""
    return " ".join(repr(float(value) + 0.0).removesuffix(".0") for value in values)


def to_text(root: Xml.Element) -> str:
    """The element as an indented document that ends with a newline."""
    Xml.indent(root, space="  ")
    return Xml.tostring(root, encoding="unicode") + "\n"
