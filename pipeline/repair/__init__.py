"""KP2: fill or cut corrupted frames, align heading and floor, low-pass, label foot contacts."""

from pipeline.repair.process import prepare, process
from pipeline.repair.settings import RepairSettings
