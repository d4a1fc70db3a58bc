"""KP2: corrupted frames found and filled or cut, heading and floor aligned, smoothed, foot contacts labelled."""

from pipeline.repair.process import prepare, process
from pipeline.repair.settings import RepairSettings
