"""The error of a refused export."""

from __future__ import annotations

from pipeline.errors import PipelineError


class ExportError(PipelineError):
    """A policy that can't be exported, with the reason and numbers."""
