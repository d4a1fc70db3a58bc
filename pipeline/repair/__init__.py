"""KP2: corrupted frames found and filled or cut, heading and floor aligned, smoothed, foot contacts labelled."""

from pipeline.repair.process import STAGE_VERSION, process
from pipeline.repair.settings import RepairSettings

__all__ = ["STAGE_VERSION", "RepairSettings", "process"]
