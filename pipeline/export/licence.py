"""Whether a policy may be distributed, from the licences of the motions it was trained on."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from pipeline.export.export_error import ExportError

SHIPPABLE = ("public-domain", "permissive", "attribution", "share-alike")
"""Licence classes (`pipeline.expert.licence`) whose policies may ship with the project."""


@dataclass(frozen=True, kw_only=True)
class Shipping:
    """Whether a policy may ship, and why."""

    allowed: bool
    reason: str
    strictest: str
    """The strictest class of licence among the clips of its database."""


def shipping(manifest: dict[str, Any] | None) -> Shipping:
    """Whether the manifest of the training database allows shipping.

    Without a manifest the licence is unknown, and shipping is not allowed.
    """
    stated = (manifest or {}).get("licence", {})
    strictest = str(stated.get("strictest", "unknown"))
    if strictest in SHIPPABLE:
        return Shipping(allowed=True, reason=str(stated.get("allowed_use", "")), strictest=strictest)
    forbidding = sorted(text for text, kind in stated.get("licences", {}).items() if kind not in SHIPPABLE)
    why = f"the strictest licence of its database is {strictest}"
    detail = f" ({'; '.join(forbidding)})" if forbidding else ""
    return Shipping(
        allowed=False, reason=f"{why}{detail}. {stated.get('allowed_use', '')}".strip(), strictest=strictest
    )


def refuse_unless_allowed(found: Shipping, policy: str) -> None:
    """Raise ExportError if the policy must not be marked as shippable."""
    if not found.allowed:
        raise ExportError(
            f"policy '{policy}' can't be marked shippable: {found.reason} "
            f"Allowed are {', '.join(SHIPPABLE)}. Train it on a database of such motions."
        )
