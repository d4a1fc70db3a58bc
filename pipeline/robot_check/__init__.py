"""What a robot folder lacks or contradicts, and how it differs from another model file of the robot."""

from pipeline.robot_check.body_checks import Finding
from pipeline.robot_check.check import check_folder
from pipeline.robot_check.compare import Difference, compare

__all__ = ["Difference", "Finding", "check_folder", "compare"]
