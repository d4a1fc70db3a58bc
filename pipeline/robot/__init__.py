"""The robot: a folder of `robots/` read into plain arrays, its kinematics, and its model for MuJoCo."""

from pipeline.robot.kinematics import Kinematics, LinkPoses, mujoco_model
from pipeline.robot.load import load_robot
from pipeline.robot.robot import Robot
from pipeline.robot.robot_error import RobotError
