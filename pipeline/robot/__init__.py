"""The robot: a folder of `robots/` read into plain arrays, its kinematics, and its model for MuJoCo."""

from pipeline.robot.kinematics import Kinematics, LinkPoses
from pipeline.robot.load import load_robot
from pipeline.robot.robot import Robot
from pipeline.robot.robot_error import RobotError
from pipeline.robot.simulator_model import mujoco_model

__all__ = ["Kinematics", "LinkPoses", "Robot", "RobotError", "load_robot", "mujoco_model"]
