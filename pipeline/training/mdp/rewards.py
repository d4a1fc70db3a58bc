"""Rewards: each term is a function of the environment and one line in `reward_cfg`.

Existing terms of mjlab are reused. Velocities `command` and `velocity` are (n, 3): forward, lateral [m/s] in the yaw
frame, yaw rate [rad/s]. Penalty terms return positive values and have negative weights. mjlab multiplies by the control
step. Weights are those of the paper's reward table; weights that the recipe changes are options
(`config.RewardsConfig`).
"""

import math

import torch
from mjlab.envs.mdp import rewards as mdp
from mjlab.managers.reward_manager import RewardTermCfg

from pipeline.learning.robot_facts import RobotFacts
from pipeline.training.config import Config
from pipeline.training.mdp.commands import moves
from pipeline.training.mdp.terminations import ended_by, fell
from pipeline.training.robot_state import CONTACT_FORCE

SIGMA2 = 0.25
"""sigma^2 of the paper's tracking kernels [m^2/s^2]."""
FINE_SIGMA2 = 0.05
"""sigma^2 of the narrow kernel [m^2/s^2]."""
COMMANDED = 0.1
"""Least commanded speed [m/s] and yaw rate [rad/s] for `progress`."""
ENOUGH = 0.8
"""Share of the command with full reward. A gait's velocity fluctuates, so a term that saturates at the command itself
rewards overshoot (10 % was measured)."""
SLOW_M_S = 0.2
"""Trunk speed of the T1 above which it was pushed and may take a recovery step [m/s]."""
FORCE_SOFT, FORCE_SPAN = 500.0, 400.0
"""Foot force of the T1 without penalty, and the range above it over which the penalty grows [N] (paper)."""
FEET_DISTANCE_M = 0.2
"""Lateral foot distance of the T1 [m] (paper)."""
FULL_TORQUE = 0.85
"""Share of the motor's torque limit at its speed without penalty."""


def track_axis(env, axis: int) -> torch.Tensor:
    """exp(-(c - v)^2 / sigma^2) of one velocity axis."""
    return torch.exp(-torch.square(env.command - env.robot_state.velocity)[:, axis] / SIGMA2)


def track_all(env, sigma2: float) -> torch.Tensor:
    """exp(-|c - v|^2 / sigma^2) of the averaged velocity, all axes at once."""
    return torch.exp(-torch.square(env.command - env.robot_state.mean_velocity).sum(dim=1) / sigma2)


def progress(env) -> torch.Tensor:
    """Share of the commanded speed and yaw rate achieved by the averaged velocity, over `ENOUGH`, -1 to 1; mean of the
    commanded ones."""
    return reached_share(env.command, env.robot_state.mean_velocity)


def reached_share(command: torch.Tensor, velocity: torch.Tensor) -> torch.Tensor:
    """`progress` of tensors."""
    speed, turn = torch.linalg.norm(command[:, :2], dim=1), command[:, 2].abs()
    along = (velocity[:, :2] * command[:, :2]).sum(dim=1) / torch.square(speed).clamp(min=1e-6)
    turned = velocity[:, 2] * command[:, 2] / torch.square(turn).clamp(min=1e-6)
    commanded = torch.stack([speed > COMMANDED, turn > COMMANDED], dim=1)
    reached = (torch.stack([along, turned], dim=1) / ENOUGH).clamp(-1.0, 1.0) * commanded
    return reached.sum(dim=1) / commanded.sum(dim=1).clamp(min=1)


def stand_still(env, slow: float) -> torch.Tensor:
    """For a standing command: number of lifted feet while the trunk is slower than `slow` [m/s], plus 0.05 times the
    joint speed norm [rad/s]."""
    state = env.robot_state
    lifted = (~state.contacts).float().sum(dim=1) * (torch.linalg.norm(state.lin_vel_b[:, :2], dim=1) < slow)
    return ~moves(env.command) * (lifted + 0.05 * torch.linalg.norm(state.joint_vel, dim=1))


def lin_vel_z_l2(env) -> torch.Tensor:
    """v_z^2."""
    return torch.square(env.robot_state.lin_vel_b[:, 2])


def ang_vel_xy_l2(env) -> torch.Tensor:
    """|w_xy|^2."""
    return torch.square(env.robot_state.ang_vel_b[:, :2]).sum(dim=1)


def energy(env) -> torch.Tensor:
    """Norm of the joint powers [W] (paper)."""
    return torch.linalg.norm(env.robot_state.torque * env.robot_state.joint_vel, dim=1)


def power(env, last: float) -> torch.Tensor:
    """Sum over joints of |torque x speed| [W], times a factor that the final ramp takes from 1 to `last`."""
    return (env.robot_state.torque * env.robot_state.joint_vel).abs().sum(dim=1) * (1.0 + (last - 1.0) * env.final)


def saturation(env) -> torch.Tensor:
    """Torque above FULL_TORQUE of the motor's limit at its speed, as a share, at most 0.5 per joint; summed."""
    torque, speed = env.robot_state.torque, env.robot_state.joint_vel
    limit = motor_limit(torque, speed, env.effort_limit, env.stall_torque, env.no_load_speed)
    return torch.clamp(torque.abs() / limit - FULL_TORQUE, 0.0, 0.5).sum(dim=1)


def motor_limit(
    torque: torch.Tensor, joint_vel: torch.Tensor, limit: torch.Tensor, stall: torch.Tensor, no_load: torch.Tensor
) -> torch.Tensor:
    """Available motor torque (n, j) at the current speed, in the torque's direction [N m]; at least 0.1 of the limit.

    Args:
        torque: (n, j) [N m]; only its sign is used
        joint_vel: (n, j) [rad/s]
        limit: torque limit (j,) [N m]
        stall: stall torque of the torque-speed line (j,) [N m]
        no_load: no-load speed (j,) [rad/s]; infinite: the limit at every speed
    """
    slack = 1.0 - torch.sign(torque) * joint_vel / no_load
    return torch.minimum(torch.maximum(stall * slack, 0.1 * limit), limit)


def joints_beyond_limits(env) -> torch.Tensor:
    """Number of joints beyond their limits (paper)."""
    lower, upper = env.joint_limits
    joint_pos = env.robot_state.joint_pos
    return ((joint_pos > upper) | (joint_pos < lower)).float().sum(dim=1)


def fallen(env) -> torch.Tensor:
    """1 if the episode terminates by a fall."""
    return fell(env).float()


def stalled(env) -> torch.Tensor:
    """1 if the episode terminates because the command was ignored."""
    return ended_by(env, "stalled").float()


def undesired_contacts(env) -> torch.Tensor:
    """Number of collision shapes other than the feet in contact."""
    return (torch.linalg.norm(env.robot_state.other_force_w, dim=-1) > CONTACT_FORCE).float().sum(dim=1)


def feet_slide(env) -> torch.Tensor:
    """Horizontal speed of the lowest sole corner, summed over feet in contact [m/s]."""
    speed = torch.linalg.norm(env.robot_state.lowest_corner_vel_w[..., :2], dim=-1)
    return (speed * env.robot_state.contacts).sum(dim=1)


def feet_force(env, soft: float, span: float) -> torch.Tensor:
    """Norm of the vertical foot forces above `soft`, at most `span` [N]."""
    vertical = torch.linalg.norm(env.robot_state.feet_force_w[..., 2], dim=1)
    return torch.clamp(vertical - soft, 0.0, span)


def feet_too_near(env, distance: float) -> torch.Tensor:
    """Shortfall of the foot distance below `distance` [m]."""
    feet = env.robot_state.feet_pos_w
    return torch.clamp(distance - torch.linalg.norm(feet[:, 0] - feet[:, 1], dim=1), min=0.0)


def feet_stumble(env) -> torch.Tensor:
    """1 if the horizontal force on a foot exceeds five times the vertical force."""
    force = env.robot_state.feet_force_w
    return (torch.linalg.norm(force[..., :2], dim=-1) > 5.0 * force[..., 2].abs()).any(dim=1).float()


def feet_lateral_distance(env, distance: float) -> torch.Tensor:
    """Deviation of the lateral foot distance in the yaw frame from `distance` [m]; 0 for lateral commands."""
    feet, heading = env.robot_state.feet_pos_w, env.robot_state.heading_w
    gap_w = feet[:, 0] - feet[:, 1]
    gap = gap_w[:, 1] * heading[:, 0] - gap_w[:, 0] * heading[:, 1]
    return torch.abs(gap.abs() - distance) * (env.command[:, 1].abs() < 0.1)


def reward_cfg(robot: RobotFacts, config: Config) -> dict[str, RewardTermCfg]:
    """Reward terms with nonzero weight. Forces and distances are scaled to the robot, weights are not."""
    force = {"soft": FORCE_SOFT * robot.weight_ratio, "span": FORCE_SPAN * robot.weight_ratio}
    distance = {"distance": FEET_DISTANCE_M * robot.leg_ratio}
    slow = {"slow": SLOW_M_S * math.sqrt(robot.leg_ratio)}
    weights, term = config.rewards, RewardTermCfg
    limits = joints_beyond_limits if weights.joint_limits == "indicator" else mdp.joint_pos_limits
    terms = {
        "track_lin_vel_x": term(func=track_axis, weight=weights.track_axes, params={"axis": 0}),
        "track_lin_vel_y": term(func=track_axis, weight=weights.track_axes, params={"axis": 1}),
        "track_ang_vel_z": term(func=track_axis, weight=weights.track_axes, params={"axis": 2}),
        "track_all": term(func=track_all, weight=weights.track_all, params={"sigma2": SIGMA2}),
        "track_mean": term(func=track_all, weight=weights.track_mean, params={"sigma2": FINE_SIGMA2}),
        "progress": term(func=progress, weight=weights.progress),
        "stand_still": term(func=stand_still, weight=weights.stand_still, params=slow),
        "lin_vel_z": term(func=lin_vel_z_l2, weight=-1.0),
        "ang_vel_xy": term(func=ang_vel_xy_l2, weight=-0.05),
        "energy": term(func=energy, weight=-1e-3),
        "power": term(func=power, weight=weights.power, params={"last": weights.final_power}),
        "saturation": term(func=saturation, weight=weights.saturation),
        "torque": term(func=mdp.joint_torques_l2, weight=-1e-4),
        "joint_vel": term(func=mdp.joint_vel_l2, weight=-1e-3),
        "joint_acc": term(func=mdp.joint_acc_l2, weight=-2.5e-7),
        "action_rate": term(func=mdp.action_rate_l2, weight=-0.1),
        "orientation": term(func=mdp.flat_orientation_l2, weight=-2.0),
        "joint_limit": term(func=limits, weight=-20.0),
        "fallen": term(func=fallen, weight=-200.0),
        "stalled": term(func=stalled, weight=-100.0),
        "undesired_contacts": term(func=undesired_contacts, weight=-1.0),
        "feet_slide": term(func=feet_slide, weight=weights.feet_slide),
        "feet_force": term(func=feet_force, weight=-3e-3, params=force),
        "feet_too_near": term(func=feet_too_near, weight=-2.0, params=distance),
        "feet_stumble": term(func=feet_stumble, weight=-2.0),
        "feet_lateral_distance": term(func=feet_lateral_distance, weight=-2.0, params=distance),
    }
    return {name: each for name, each in terms.items() if each.weight != 0.0}
