"""The error of a training run that cannot start: what, where, got, allowed, do."""

from __future__ import annotations


class TrainingError(Exception):
    """Its text is one complete message for the user."""
