"""Readers: motion files of every known format in, clips on the canonical skeleton out."""

from pipeline.readers.read_motion import ReadMotion, read_motion
from pipeline.readers.statement import Statement

__all__ = ["ReadMotion", "Statement", "read_motion"]
