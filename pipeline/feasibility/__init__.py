"""KP5: which motions the robot can do, and how much each clip weighs."""

from pipeline.feasibility.assess import Assessment, assess
from pipeline.feasibility.balance import balance
from pipeline.feasibility.command_space import CommandSettings
from pipeline.feasibility.coverage import Coverage, coverage
from pipeline.feasibility.criterion import Verdict
from pipeline.feasibility.process import process
from pipeline.feasibility.settings import FeasibilitySettings
