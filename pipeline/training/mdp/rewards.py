"""Rewards: each term is a function of the environment, and one line in `reward_cfg`.

Terms of mjlab are used where it has them. Velocities `command` and `velocity` are (n, 3): forward, lateral [m/s] in the
yaw frame, yaw rate [rad/s]. Penalties are returned as positive numbers; their weights are negative. mjlab multiplies by
the control step. The paper's numbers are those of its reward table; what the recipe changes is an option
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
"""Width of the paper's tracking kernels [m^2/s^2]."""
FINE_SIGMA2 = 0.05
"""Width of the narrow one."""
COMMANDED = 0.1
"""Least commanded speed [m/s] and yaw rate [rad/s] that progress counts."""
ENOUGH = 0.8
"""Share of the command that counts as reached. A gait's velocity fluctuates: a term that is full at the command itself
pays for more than the command (10 % more were measured)."""
SLOW_M_S = 0.2
"""A trunk of the T1 that moves faster was pushed, and may be caught by a step [m/s]."""
FORCE_SOFT, FORCE_SPAN = 500.0, 400.0
"""Foot force without cost, and the span beyond it in which the cost grows, of the T1 [N] (paper)."""
FEET_APART = 0.2
"""Distance of the T1's feet [m] (paper)."""
FULL_TORQUE = 0.85
"""Share of the motor's torque at its speed that costs nothing."""


def track_axis(env, axis: int) -> torch.Tensor:
    """exp(-(c - v)^2 / sigma^2) of one axis."""
    return torch.exp(-torch.square(env.command - env.robot_state.velocity)[:, axis] / SIGMA2)


def track_all(env, sigma2: float) -> torch.Tensor:
    """exp(-|c - v|^2 / sigma^2) of the averaged velocity, all axes at once."""
    return torch.exp(-torch.square(env.command - env.robot_state.mean_velocity).sum(dim=1) / sigma2)


def progress(env) -> torch.Tensor:
    """Share of the commanded speed and of the yaw rate that the averaged velocity reaches, by `ENOUGH`, -1 to 1; the
    mean of those that are commanded."""
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
    """At the command to stand: feet off the ground while the trunk is slower than `slow` [m/s], and 0.05 of the joints'
    speed [rad/s]."""
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
    """Norm over joints of their powers [W] (paper)."""
    return torch.linalg.norm(env.robot_state.torque * env.robot_state.joint_vel, dim=1)


def power(env, last: float) -> torch.Tensor:
    """Sum over joints of |torque x speed| [W], times a factor that the final ramp takes from 1 to `last`."""
    return (env.robot_state.torque * env.robot_state.joint_vel).abs().sum(dim=1) * (1.0 + (last - 1.0) * env.final)


def saturation(env) -> torch.Tensor:
    """Torque beyond FULL_TORQUE of what the motor can give at its speed, as a share, at most 0.5 a joint; summed."""
    torque, speed = env.robot_state.torque, env.robot_state.joint_vel
    limit = motor_limit(torque, speed, env.effort_limit, env.stall_torque, env.no_load_speed)
    return torch.clamp(torque.abs() / limit - FULL_TORQUE, 0.0, 0.5).sum(dim=1)


def motor_limit(
    torque: torch.Tensor, joint_vel: torch.Tensor, limit: torch.Tensor, stall: torch.Tensor, no_load: torch.Tensor
) -> torch.Tensor:
    """Torque that motors can give at their speed in the torque's direction [N m], at least a tenth of the limit.

    Args:
        torque: (n, j) [N m]; only its sign matters
        joint_vel: (n, j) [rad/s]
        limit: largest torque (j,) [N m]
        stall: torque at which the line meets standstill (j,) [N m]
        no_load: speed at which it meets zero torque (j,) [rad/s]; infinite: the limit at every speed
    """
    slack = 1.0 - torch.sign(torque) * joint_vel / no_load
    return torch.minimum(torch.maximum(stall * slack, 0.1 * limit), limit)


def joints_beyond_limits(env) -> torch.Tensor:
    """Number of joints beyond their limits (paper)."""
    lower, upper = env.joint_limits
    joint_pos = env.robot_state.joint_pos
    return ((joint_pos > upper) | (joint_pos < lower)).float().sum(dim=1)


def fallen(env) -> torch.Tensor:
    """1 where the episode ends by a fall."""
    return fell(env).float()


def stalled(env) -> torch.Tensor:
    """1 where the episode ends because the command was ignored."""
    return ended_by(env, "stalled").float()


def undesired_contacts(env) -> torch.Tensor:
    """Number of shapes other than the feet that are in contact."""
    return (torch.linalg.norm(env.robot_state.other_force_w, dim=-1) > CONTACT_FORCE).float().sum(dim=1)


def feet_slide(env) -> torch.Tensor:
    """Horizontal speed of the lowest sole corner of feet in contact, summed [m/s]."""
    speed = torch.linalg.norm(env.robot_state.lowest_corner_vel_w[..., :2], dim=-1)
    return (speed * env.robot_state.contacts).sum(dim=1)


def feet_force(env, soft: float, span: float) -> torch.Tensor:
    """Norm of the feet's vertical forces beyond `soft`, at most `span` [N]."""
    vertical = torch.linalg.norm(env.robot_state.feet_force_w[..., 2], dim=1)
    return torch.clamp(vertical - soft, 0.0, span)


def feet_too_near(env, apart: float) -> torch.Tensor:
    """By how much the feet are nearer than `apart` [m]."""
    feet = env.robot_state.feet_pos_w
    return torch.clamp(apart - torch.linalg.norm(feet[:, 0] - feet[:, 1], dim=1), min=0.0)


def feet_stumble(env) -> torch.Tensor:
    """1 where the horizontal force on a foot is more than five times the vertical one."""
    force = env.robot_state.feet_force_w
    return (torch.linalg.norm(force[..., :2], dim=-1) > 5.0 * force[..., 2].abs()).any(dim=1).float()


def feet_lateral_distance(env, apart: float) -> torch.Tensor:
    """Difference of the feet's lateral distance in the yaw frame from `apart` [m]; 0 at lateral commands."""
    feet, heading = env.robot_state.feet_pos_w, env.robot_state.heading_w
    gap_w = feet[:, 0] - feet[:, 1]
    gap = gap_w[:, 1] * heading[:, 0] - gap_w[:, 0] * heading[:, 1]
    return torch.abs(gap.abs() - apart) * (env.command[:, 1].abs() < 0.1)


def reward_cfg(robot: RobotFacts, config: Config) -> dict[str, RewardTermCfg]:
    """All terms but those of weight 0. Forces and distances are scaled to the robot; weights are the same for all."""
    force = {"soft": FORCE_SOFT * robot.weight_ratio, "span": FORCE_SPAN * robot.weight_ratio}
    apart = {"apart": FEET_APART * robot.leg_ratio}
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
        "feet_too_near": term(func=feet_too_near, weight=-2.0, params=apart),
        "feet_stumble": term(func=feet_stumble, weight=-2.0),
        "feet_lateral_distance": term(func=feet_lateral_distance, weight=-2.0, params=apart),
    }
    return {name: each for name, each in terms.items() if each.weight != 0.0}
