"""Parts of names that left and right differ by."""

import re
from collections.abc import Iterable

from pipeline.robot.legs import mirrored_name


def propose_pairs(partners: Iterable[tuple[str, str]]) -> tuple[tuple[str, str], ...]:
    """Pairs of name parts that turn each left name into its right one.

    Args:
        partners: (left, right) names of links, joints and sites that are mirror images
    """
    pairs: list[tuple[str, str]] = []
    for left, right in partners:
        if left != right and mirrored_name(left, pairs) != right:
            pairs.append(_difference(left, right))
    return tuple(pairs)


def _difference(left: str, right: str) -> tuple[str, str]:
    """What differs, widened to the whole words that it is part of: AL1, AR1 differ by AL, AR."""
    start = _alike(left, right)
    end = _alike(left[start:][::-1], right[start:][::-1])
    while start > 0 and re.match(r"[A-Za-z]", left[start - 1]):
        start -= 1
    while end > 0 and re.match(r"[A-Za-z]", left[len(left) - end]):
        end -= 1
    if len(left) - end - start == 1:  # a single letter occurs in other words, too: take a separator with it
        if end > 0:
            end -= 1
        elif start > 0:
            start -= 1
    return left[start : len(left) - end], right[start : len(right) - end]


def _alike(first: str, second: str) -> int:
    """Number of characters that two texts begin with alike."""
    differing = (place for place, (a, b) in enumerate(zip(first, second, strict=False)) if a != b)
    return next(differing, min(len(first), len(second)))
