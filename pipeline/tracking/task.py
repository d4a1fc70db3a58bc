"""Definitions shared by training on a GPU and rollouts on a CPU: rates, action, order of the observation."""

CONTROL_HZ = 50.0
"""Rate of the tracker, and of the clips it tracks [Hz]."""

DECIMATION = 4
"""Physics steps per control step."""

ACTION_SCALE = 0.25
"""Joint target = reference joint position + ACTION_SCALE * action [rad]."""

ITERATIONS = 500
"""Training iterations of 24 control steps each, enough for the shipped clips; docs/tracking.md states what more
need."""

PATH_M = 0.5
"""Distance of the root from the reference's root at which an episode ends [m]."""

OBSERVATION = (
    "command",  # reference joint positions and velocities (2j)
    "motion_anchor_pos_b",  # reference root position in the robot's root frame (3)
    "motion_anchor_ori_b",  # first two columns of the reference root's rotation in the robot's root frame (6)
    "body_pos",  # key links in the root frame (3k)
    "body_ori",  # first two columns of their rotations in the root frame (6k)
    "base_lin_vel",  # root velocity in the root frame (3)
    "base_ang_vel",  # (3)
    "joint_pos",  # minus the default pose (j)
    "joint_vel",  # (j)
    "actions",  # the last action (a)
)
"""Terms of the observation in order, named as in mjlab's tracking task. The tracker is used only in simulation, so it
observes the full state without noise."""


def observation_size(joints: int, links: int, actions: int) -> int:
    """Length of the observation for j joints, k key links and a actions."""
    return 2 * joints + 9 + 9 * links + 6 + 2 * joints + actions
