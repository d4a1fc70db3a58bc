"""The task reward's terms, each a pure function of tensors; N environments first.

`reward_table.py` gives each its equation and weight. Velocities `c` and `v` are (n, 3): forward, lateral, yaw rate.
Penalties are returned as positive numbers; their weights are negative.
"""

from __future__ import annotations

import torch

FORCE_SOFT = 500.0
"""Foot force that costs nothing [N]."""
FORCE_SPAN = 400.0
"""Beyond it the cost stops growing here [N]."""
FEET_APART = 0.2
"""[m]"""
STANDS = 1e-6
"""A command of no more on any axis [m/s, rad/s] is to stand."""
ASKED = 0.1
"""Speed [m/s] and yaw rate [rad/s] from which on a command asks for them."""
STANCE_TIME = 0.4
"""Time on one foot that a step is paid up to [s]."""
LONGEST_SHARE = 1.5
"""Of the clips' time of a step: the time beyond is not walked."""
FULL_DOUBLE = 0.6
"""Of the clips' share of time on both feet: what is paid in full; how much of it they have is known roughly."""
LEAST_SWING, FULL_SWING = 0.4, 0.9
"""Of the clips' movement of hip and knee in a stride: what is paid nothing, and in full."""
NOISE_W = 50.0
"""About what exploration spends besides [W]: who stands would else pay most for it."""


def told_to_move(command: torch.Tensor) -> torch.Tensor:
    """Who (n,) of commands (n, 3) is told to do more than stand."""
    return (command.abs() > STANDS).any(dim=1)


def tracking(command: torch.Tensor, velocity: torch.Tensor, sigma2: float) -> torch.Tensor:
    """exp(-(c - v)^2 / sigma^2) on each axis (n, 3)."""
    return torch.exp(-torch.square(command - velocity) / sigma2)


def joint_tracking(command: torch.Tensor, velocity: torch.Tensor, sigma2: float) -> torch.Tensor:
    """exp(-|c - v|^2 / sigma^2), all axes at once (n,)."""
    return torch.exp(-torch.square(command - velocity).sum(dim=1) / sigma2)


def progress(command: torch.Tensor, velocity: torch.Tensor) -> torch.Tensor:
    """Share (n,) of the commanded speed and of the yaw rate that is reached, -1..1; the mean of those asked for."""
    speed, turn = torch.linalg.norm(command[:, :2], dim=1), command[:, 2].abs()
    along = (velocity[:, :2] * command[:, :2]).sum(dim=1) / torch.square(speed).clamp(min=1e-6)
    turned = velocity[:, 2] * command[:, 2] / torch.square(turn).clamp(min=1e-6)
    asked = torch.stack([speed > ASKED, turn > ASKED], dim=1)
    reached = torch.stack([along, turned], dim=1).clamp(-1.0, 1.0) * asked
    return reached.sum(dim=1) / asked.sum(dim=1).clamp(min=1)


def square(value: torch.Tensor) -> torch.Tensor:
    """x^2 of (n,), |x|^2 of (n, k)."""
    return torch.square(value) if value.ndim == 1 else torch.sum(torch.square(value), dim=1)


def energy(torque: torch.Tensor, joint_vel: torch.Tensor) -> torch.Tensor:
    """|tau * dq|, the norm over joints of their powers."""
    return torch.linalg.norm(torque * joint_vel, dim=1)


def power(torque: torch.Tensor, joint_vel: torch.Tensor) -> torch.Tensor:
    """sum |tau * dq| over joints [W]."""
    return (torque * joint_vel).abs().sum(dim=1)


def power_share(
    torque: torch.Tensor, joint_vel: torch.Tensor, command: torch.Tensor, free: float = 0.0
) -> torch.Tensor:
    """The joints' power (n,) beyond the share `free` of what is usual at the command, below 0 where it is less, over
    what is usual and NOISE_W more; of torques and speeds (n, a) [N m, rad/s] and commands (n, 3)."""
    usual = usual_power(command)
    return (power(torque, joint_vel) - free * usual) / (NOISE_W + usual)


def usual_power(command: torch.Tensor) -> torch.Tensor:
    """About what the published walking policy spends on commands (n, 3) [W]: ankle damping 2 N m s/rad on the adapted
    robot, the worst of five seeds. Within a fifth of the mean of both sides: 106 to 110 / 193 / 256 / 371 W at .6 /
    1.0 / 1.5 / 2.0 m/s, 78 W sideways at .6 m/s, 63 and 83 W turning at 1 and 1.5 rad/s, where it spends 1.4 to 1.6
    times as much to the right as to the left."""
    ahead, aside, turn = command.abs().unbind(dim=1)
    return 35.0 + 125.0 * ahead + 22.0 * torch.square(ahead) + 70.0 * aside + 25.0 * turn


def limit_indicator(joint_pos: torch.Tensor, lower: torch.Tensor, upper: torch.Tensor) -> torch.Tensor:
    """How many joints are beyond their limits."""
    return ((joint_pos > upper) | (joint_pos < lower)).float().sum(dim=1)


def limit_excess(joint_pos: torch.Tensor, lower: torch.Tensor, upper: torch.Tensor) -> torch.Tensor:
    """By how much joints are beyond .97 of their range [rad]."""
    middle, half = (lower + upper) / 2.0, 0.97 * (upper - lower) / 2.0
    return torch.clamp((joint_pos - middle).abs() - half, min=0.0).sum(dim=1)


def undesired_contacts(force_w: torch.Tensor, threshold: float) -> torch.Tensor:
    """How many shapes (n, b, 3) are pressed by more than the threshold [N]."""
    return (torch.linalg.norm(force_w, dim=-1) > threshold).float().sum(dim=1)


def feet_slide(contacts: torch.Tensor, feet_vel_w: torch.Tensor) -> torch.Tensor:
    """Horizontal speed of the feet that touch, summed [m/s]."""
    return (torch.linalg.norm(feet_vel_w[..., :2], dim=-1) * contacts).sum(dim=1)


def feet_force(feet_force_w: torch.Tensor) -> torch.Tensor:
    """What the norm of the feet's vertical forces is beyond FORCE_SOFT, at most FORCE_SPAN [N]."""
    return torch.clamp(torch.linalg.norm(feet_force_w[..., 2], dim=1) - FORCE_SOFT, 0.0, FORCE_SPAN)


def feet_too_near(feet_pos_w: torch.Tensor) -> torch.Tensor:
    """How much nearer than FEET_APART the feet are [m]."""
    return torch.clamp(FEET_APART - torch.linalg.norm(feet_pos_w[:, 0] - feet_pos_w[:, 1], dim=1), min=0.0)


def feet_stumble(feet_force_w: torch.Tensor) -> torch.Tensor:
    """1 where a foot is pushed more than five times as much sideways as up."""
    sideways = torch.linalg.norm(feet_force_w[..., :2], dim=-1)
    return (sideways > 5.0 * feet_force_w[..., 2].abs()).any(dim=1).float()


def feet_lateral_distance(command: torch.Tensor, lateral_gap: torch.Tensor) -> torch.Tensor:
    """How far the feet's lateral distance in the yaw frame [m] is from FEET_APART, unless told to go sideways."""
    return torch.abs(lateral_gap.abs() - FEET_APART) * (command[:, 1].abs() < 0.1)


def standing_still(
    command: torch.Tensor, contacts: torch.Tensor, joint_vel: torch.Tensor, right_more: float = 0.0
) -> torch.Tensor:
    """Feet in the air, the right one counted by `right_more` more, and a twentieth of the joints' speed [rad/s] while
    the command is to stand. Contacts (n, 2) are those of the left and the right foot."""
    stands = ~told_to_move(command)
    left, right = (~contacts.bool()).float().unbind(dim=1)
    lifted = left + (1.0 + right_more) * right
    return stands * (lifted + 0.05 * torch.linalg.norm(joint_vel, dim=1))


def single_stance(
    command: torch.Tensor, contacts: torch.Tensor, stance_time: torch.Tensor, end_s: float = 0.0
) -> torch.Tensor:
    """How long the robot has been on one foot [s], up to STANCE_TIME, while told to move; 0 after `end_s`, if that is
    not 0."""
    time = stance_time.amin(dim=1)
    single = (contacts.sum(dim=1) == 1) & (time <= (end_s or torch.inf))
    return torch.clamp(time, max=STANCE_TIME) * (single & told_to_move(command))


def long_step(
    command: torch.Tensor, step_s: torch.Tensor, wanted_s: torch.Tensor, least: float, full: float
) -> torch.Tensor:
    """The time (n,) [s] of steps that end now, while told to move, times how far they got from the share `least` to
    the share `full` of the wanted time (n,); 0 where none ends. No step is paid for more than LONGEST_SHARE of that."""
    share = step_s / wanted_s.clamp(min=1e-6)
    got = ((share - least) / (full - least)).clamp(0.0, 1.0)
    return step_time(command, step_s, wanted_s) * got


def step_time(command: torch.Tensor, step_s: torch.Tensor, wanted_s: torch.Tensor) -> torch.Tensor:
    """The time (n,) [s] of steps that end now, while told to move; at most LONGEST_SHARE of the wanted one (n,)."""
    return torch.minimum(step_s, LONGEST_SHARE * wanted_s) * told_to_move(command)


def double_stance(double_s: torch.Tensor, step_s: torch.Tensor, share: torch.Tensor) -> torch.Tensor:
    """The time on both feet (n,) [s] of steps (n,) [s], by FULL_DOUBLE of the clips' share (n,) of them; at most 1."""
    return (double_s / (FULL_DOUBLE * share * step_s).clamp(min=1e-6)).clamp(max=1.0)


def full_swing(moved: torch.Tensor, wanted: torch.Tensor) -> torch.Tensor:
    """How far hip and knee (n, 2) got from LEAST_SWING to FULL_SWING of the wanted movement (n, 2), on average."""
    return ((moved / wanted - LEAST_SWING) / (FULL_SWING - LEAST_SWING)).clamp(0.0, 1.0).mean(dim=1)


def saturation(torque: torch.Tensor, limit: torch.Tensor) -> torch.Tensor:
    """Torque beyond .85 of the limits, as a share of them and at most .5, summed over joints."""
    return torch.clamp(torque.abs() / limit - 0.85, 0.0, 0.5).sum(dim=1)


def motor_limit(
    torque: torch.Tensor, joint_vel: torch.Tensor, limit: torch.Tensor, stall: torch.Tensor, no_load: torch.Tensor
) -> torch.Tensor:
    """What motors can give at their speed in the direction of their torque [N m], at least a tenth of the limit.

    The line goes from the stall torque at standstill to 0 at the no-load speed; infinite: the limit at every speed.
    """
    slack = 1.0 - torch.sign(torque) * joint_vel / no_load
    return torch.minimum(torch.maximum(stall * slack, 0.1 * limit), limit)
