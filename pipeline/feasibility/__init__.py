"""KP5: what of a motion the robot can do, and how much each clip weighs."""

from pipeline.feasibility.assess import Assessment, assess
from pipeline.feasibility.balance import balance
from pipeline.feasibility.command_settings import CommandSettings
from pipeline.feasibility.coverage import Coverage, coverage
from pipeline.feasibility.process import process
from pipeline.feasibility.settings import FeasibilitySettings
from pipeline.feasibility.verdict import Verdict

__all__ = [
    "Assessment",
    "CommandSettings",
    "Coverage",
    "FeasibilitySettings",
    "Verdict",
    "assess",
    "balance",
    "coverage",
    "process",
]
