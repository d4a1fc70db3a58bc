"""Classification of licences by strictness, and the allowed use of a database with several licences."""

import enum
import re
from collections.abc import Iterable


class LicenceClass(enum.IntEnum):
    """Classes of licences, the strictest last. The strictest clip determines the allowed use of a database.

    An unknown licence is the strictest class.
    """

    PUBLIC_DOMAIN = 0
    PERMISSIVE = 1
    ATTRIBUTION = 2
    SHARE_ALIKE = 3
    NON_COMMERCIAL = 4
    NO_DERIVATIVES = 5
    UNKNOWN = 6

    @property
    def label(self) -> str:
        return self.name.lower().replace("_", "-")

    @property
    def allowed_use(self) -> str:
        """Allowed use of a database whose strictest clip has this class."""
        return _ALLOWED_USE[self]


_ALLOWED_USE = {
    LicenceClass.PUBLIC_DOMAIN: "Any use.",
    LicenceClass.PERMISSIVE: "Any use; keep the licence texts.",
    LicenceClass.ATTRIBUTION: "Any use; name the sources.",
    LicenceClass.SHARE_ALIKE: "Any use; name the sources; share what is made of it under the same licence.",
    LicenceClass.NON_COMMERCIAL: "Research and other non-commercial use; name the sources.",
    LicenceClass.NO_DERIVATIVES: "Own non-commercial use; the database is a derived work: do not pass it on.",
    LicenceClass.UNKNOWN: "Own experiments; at least one source has no known licence: do not pass it on.",
}

_PATTERNS = (
    (LicenceClass.UNKNOWN, r"not stated|unknown|no licen[cs]e|unclear|proprietary|all rights reserved"),
    (LicenceClass.NO_DERIVATIVES, r"\bnd\b|no[- ]?deriv"),
    (LicenceClass.NON_COMMERCIAL, r"\bnc\b|non[- ]?commercial|academic|research (use )?only|smpl|amass"),
    (LicenceClass.SHARE_ALIKE, r"\bsa\b|share[- ]?alike|gpl"),
    (LicenceClass.ATTRIBUTION, r"\bcc[- ]by\b|attribution|credit"),
    (LicenceClass.PERMISSIVE, r"\bmit\b|apache|\bbsd\b|\bisc\b|free for research and commercial"),
    (LicenceClass.PUBLIC_DOMAIN, r"\bcc0\b|public domain|unlicense"),
)
"""Searched in this order, so that the strictest word of a licence decides."""

_CREATIVE_COMMONS = re.compile(r"^cc[- ]by([- ]nc)?([- ](?:nd|sa))?\b")
"""A text that begins with a Creative Commons name is that licence, regardless of the rest."""

_WHOLE_NAMES = {
    LicenceClass.PUBLIC_DOMAIN: ("cc0-1.0", "cc0", "unlicense", "public domain"),
    LicenceClass.PERMISSIVE: ("mit", "apache-2.0", "bsd-2-clause", "bsd-3-clause", "isc"),
}


def classify_licence(text: str | None) -> LicenceClass:
    """The class of a licence given as an SPDX identifier or in words; UNKNOWN if it isn't recognized.

    In words, the strictest one found decides: "MIT repo; human source not stated" is UNKNOWN.
    """
    plain = re.sub(r"[_\s]+", " ", (text or "").strip().lower())
    for kind, names in _WHOLE_NAMES.items():
        if plain in names:
            return kind
    if match := _CREATIVE_COMMONS.match(plain):
        plain = match.group(0)
    for kind, pattern in _PATTERNS:
        if re.search(pattern, plain):
            return kind
    return LicenceClass.UNKNOWN


def strictest(licences: Iterable[str | None]) -> LicenceClass:
    """The strictest class among the licences of a database's clips; public domain if there are none."""
    return max((classify_licence(text) for text in licences), default=LicenceClass.PUBLIC_DOMAIN)
