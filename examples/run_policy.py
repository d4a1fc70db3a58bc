"""Walk with a policy in MuJoCo: python examples/run_policy.py POLICY_FOLDER FORWARD LATERAL YAW_RATE."""

import sys
from pathlib import Path

import numpy as np

from pipeline.deployment import PolicyController, load_policy, policy_task
from pipeline.export.card import read_card
from pipeline.robot import load_robot
from pipeline.simulation.mujoco_plant import MujocoPlant
from pipeline.simulation.run import run
from pipeline.simulation.torque_envelope import PdControl, TorqueEnvelope

SECONDS, SETTLED_S = 6.0, 2.0

folder = Path(sys.argv[1])
policy = load_policy(folder / "policy.npz")
command = np.array([float(text) for text in sys.argv[2:5]])  # forward, lateral [m/s], yaw rate [rad/s]
robot = load_robot(read_card(folder).robot)

# The controller is the one that runs on the robot: sensor readings in, joint targets out, at 50 Hz.
task = policy_task(robot, policy)
motors = PdControl(kp=task.kp, kd=task.kd, envelope=TorqueEnvelope(limit=robot.torque_limit))


def ramp(time_s: float) -> np.ndarray:
    """The command at a time [s], from zero at 1 m/s^2 and 1 rad/s^2."""
    return np.clip(command, -time_s, time_s)


walk = run(robot, MujocoPlant(robot), PolicyController(task, policy), motors, ramp, SECONDS, stop_on_fall=True)

if walk.fell:
    sys.exit("the robot fell")
clip = walk.clip("walk", start_s=SETTLED_S)
moved = clip.root_pos_w[-1] - clip.root_pos_w[0]
print(f"{SECONDS:g} s without a fall, mean speed {np.hypot(*moved[:2]) / clip.duration_s:.2f} m/s")
