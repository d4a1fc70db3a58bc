"""KP5: feasibility of motions for the robot, and the sampling weight of each clip."""

from pipeline.feasibility.assess import Assessment, assess
from pipeline.feasibility.balance import balance
from pipeline.feasibility.command_space import CommandSettings
from pipeline.feasibility.coverage import Coverage, coverage
from pipeline.feasibility.criterion import Verdict
from pipeline.feasibility.process import process
from pipeline.feasibility.settings import FeasibilitySettings
