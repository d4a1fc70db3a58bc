"""KP2: corrupted frames found and filled or cut, heading and floor aligned, smoothed, foot contacts labelled."""

from pipeline.repair.process import process
from pipeline.repair.settings import RepairSettings

__all__ = ["RepairSettings", "process"]
