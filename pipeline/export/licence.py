"""May a policy be passed on? It may where the licences of the motions it was trained on let a derived work be."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from pipeline.export.export_error import ExportError

SHIPPABLE = ("public-domain", "permissive", "attribution", "share-alike")
"""Classes of licence (`pipeline.expert.licence`) of which a trained policy may ship with the project."""


@dataclass(frozen=True, kw_only=True)
class Shipping:
    """Whether a policy may ship, and why."""

    allowed: bool
    reason: str
    strictest: str
    """The strictest class of licence among the clips of its database."""


def shipping(manifest: dict[str, Any] | None) -> Shipping:
    """What the manifest of the expert database that a policy was trained on allows.

    Without a manifest nothing is known, and what isn't known isn't allowed.
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
    """Raises ExportError where a policy is to be marked shippable and may not."""
    if not found.allowed:
        raise ExportError(
            f"policy '{policy}' can't be marked shippable: {found.reason} "
            f"Allowed are {', '.join(SHIPPABLE)}. Train it on a database of such motions."
        )
