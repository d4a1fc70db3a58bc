"""A robot folder from its maker's URDF or MJCF."""

from pipeline.robot_import.propose import Proposal, propose
from pipeline.robot_import.read import read_model
from pipeline.robot_import.stated import Stated, read_stated
from pipeline.robot_import.write import write_folder

__all__ = ["Proposal", "Stated", "propose", "read_model", "read_stated", "write_folder"]
