"""Read a robot's log (MCAP, of the robot or the virtual robot) as a robot motion.

A log has joints and the trunk's attitude, but no position: the odometer is planar and biased. The root position is
therefore computed by leg odometry: the lowest sole corner is on the ground and does not move between frames. This holds
for standing and walking; in the flight phase of a run the lowest corner moves, so the path is too short there.
"""

from pathlib import Path

import numpy as np
from jaxtyping import Float

from pipeline import rotation, time_series
from pipeline.clips.outcome import Reason
from pipeline.errors import FileError
from pipeline.files import settings
from pipeline.hardware_logs import LogSettings, Trial, read_log
from pipeline.readers.robot_motion import RobotMotion, robots
from pipeline.robot import Kinematics, Robot

SETTINGS = Path(__file__).resolve().parents[2] / "data" / "hardware_logs.yaml"

RATE_HZ = 50.0
"""Rate to which the samples of a log (500 Hz) are decimated, about the rate of the database [Hz]."""


def read_robot_log(path: Path) -> RobotMotion:
    """Read the longest stretch of a log without falls and missing samples. Raises FileError."""
    trials = read_log(path, robots(), settings.read(SETTINGS, LogSettings))
    stretches = [(trial, start, stop) for trial in trials for start, stop in time_series.runs(_usable(trial))]
    if not stretches:
        raise FileError(path, "the robot is never up with joints and attitude recorded.", "Leave it out.")
    trial, start, stop = max(stretches, key=lambda each: (each[2] - each[1]) / each[0].rate_hz)
    robot = next((each for each in robots() if each.name == trial.robot), None)
    if robot is None:
        raise FileError(path, f"its robot '{trial.robot}' is none of this project's.", "Add its folder to robots/.")
    seconds, whole = (stop - start) / trial.rate_hz, sum(each.seconds for each in trials)
    text = (
        f"{seconds:.1f} of {whole:.1f} s of the log are taken, the longest stretch in which the robot is up and "
        f"recorded without a gap; its path is from leg odometry, and the log is of a "
        f"{'simulated' if trial.simulated else 'real'} robot."
    )
    notes = dict.fromkeys(note for each in trials for note in each.notes)
    step = max(round(trial.rate_hz / RATE_HZ), 1)
    frames = slice(start, stop, step)
    joint_pos = trial.joint_pos[frames]
    root_pos, root_quat = root_poses(robot, trial.rpy[frames], joint_pos)
    return RobotMotion(
        format="robot_log",
        path=path,
        root_pos_w=root_pos,
        root_quat=root_quat,
        order_is_certain=True,
        joint_pos=joint_pos,
        joint_names=robot.joint_names,
        robot=robot.name,
        fps=trial.rate_hz / step,
        notes=(
            Reason(code="robot_log", text=text, effect="noted", value=seconds, unit="s"),
            *(Reason(code="log_note", text=note, effect="noted") for note in notes),
        ),
    )


def root_poses(
    robot: Robot, rpy: Float[np.ndarray, "t 3"], joint_pos: Float[np.ndarray, "t j"]
) -> tuple[Float[np.ndarray, "t 3"], Float[np.ndarray, "t 4"]]:
    """Positions [m] and orientations wxyz of the root, from its roll, pitch and yaw [rad].

    Leg odometry from the origin: the lowest sole corner is on the ground and does not slide.
    """
    roll, pitch, yaw = rpy.T
    root_quat_w = rotation.from_euler([(2, yaw), (1, pitch), (0, roll)])
    kinematics = Kinematics(robot)
    poses = kinematics.forward(np.zeros((len(joint_pos), 3)), root_quat_w, joint_pos)
    corners = kinematics.site_pos_w(poses, [name for side in robot.sole_corners for name in side])
    lowest = corners[..., 2].argmin(axis=1)
    frames = np.arange(len(corners) - 1)
    steps = corners[frames, lowest[:-1], :2] - corners[frames + 1, lowest[:-1], :2]
    root = np.zeros((len(corners), 3))
    root[1:, :2] = np.cumsum(steps, axis=0)
    root[:, 2] = -corners[..., 2].min(axis=1)
    return root, root_quat_w


def _usable(trial: Trial) -> np.ndarray:
    """(n,) bool: samples with joints and attitude, while the robot has not fallen."""
    recorded = np.isfinite(trial.joint_pos).all(axis=1) & np.isfinite(trial.rpy).all(axis=1)
    return recorded & trial.measured & (trial.fall_state <= 0)
