"""Why a policy can't be exported, or an export can't be taken."""

from __future__ import annotations

from pipeline.errors import PipelineError


class ExportError(PipelineError):
    """A policy that is not exported, with the numbers that say why."""
