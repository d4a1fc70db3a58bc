"""Every number of a training run. `presets.py` says which of them are the paper's, `reasons.py` why others differ."""

from __future__ import annotations

import dataclasses
import math
from dataclasses import dataclass
from typing import Any

from pipeline.learning.training_error import TrainingError

WORDS = {
    "terrain": ("plane", "rough"),
    "motors": ("line", "box"),
    "mixture": ("paper", "balanced"),
    "joint_limit": ("indicator", "excess"),
    "slide_of": ("centre", "lowest"),
    "tracking_of": ("instant", "mean"),
    "saturation_of": ("limit", "line"),
    "init_posture": ("default", "clips"),
    "recovery_of": ("effort", "steps"),
    "keep_of": ("ahead", "unpushed"),
}
"""Options that are one of some words."""


@dataclass(frozen=True, kw_only=True)
class Options:
    """The defaults are the paper's where it states a number, else those of its references."""

    # The run
    captured: bool = True
    """Whether a GPU replays the parts of a control step instead of being told each launch; the same work."""
    run_iterations: int = 0
    """Iterations that all schedules are written for: they stretch to the minutes of a run that is bound by minutes. 0:
    they go by iterations."""

    # The world
    terrain: str = "plane"
    """`plane`, or `rough`: a heightfield of random roughness."""
    roughness_m: float = 0.03
    """Height range of the rough terrain [m]."""
    slope_share: float = 0.0
    """Of the environments, whose ground slopes (`slopes.py`), each by up to …"""
    slope_deg: float = 0.0
    """… this angle."""
    slope_iterations: tuple[int, int] = (0, 0)
    """Slopes grow from level ground to that between these iterations."""
    motors: str = "line"
    """`line`: torque falls above the knee speed as the torque-speed curve does; `box`: a constant limit."""
    action_lag_steps: int = 0
    """A joint target arrives up to this many physics steps of .005 s late, at most two control steps."""
    episode_s: float = 20.0
    """Length of an episode [s]."""

    # Commands
    mixture: str = "paper"
    """`paper`: standing, normal, fast. `balanced`: also shares of turning on the spot, sideways, straight and slow."""
    standing_share: float = 0.10
    """Of the commands."""
    fast_share: float = 0.35
    """Of the commands."""
    slow_share: float = 0.0
    """Of the commands, in the balanced mixture: .2 to .4 m/s forward, back or sideways, nothing else."""
    alone_shares: tuple[float, float, float] = (0.15, 0.10, 0.10)
    """Of the commands, in the balanced mixture: forward or back, sideways, or turning alone. What is left beside these,
    standing, fast and slow ones is on all axes."""
    ahead_share: float = 0.0
    """Of the commands, in the balanced mixture: forward at …"""
    ahead_speeds: tuple[float, float] = (0.5, 1.8)
    """… these speeds [m/s], half of them straight, the others with a little to the side and of turning."""
    slew_share: float = 0.0
    """Of the environments, in which a command comes at 1 m/s (rad/s) a second, as robots are told it; else at once."""
    resample_s: tuple[float, float] = (8.0, 12.0)
    """Time between commands [s]."""

    # Rewards
    sigma2: float = 0.25
    """Width of the tracking kernels [m^2/s^2]."""
    penalty_start: float = 1.0
    """Factor of all penalties but the termination's at the start …"""
    penalty_iterations: int = 0
    """… grows to 1 over this many iterations."""
    joint_limit: str = "indicator"
    """`indicator`: joints beyond their limit count 1; `excess`: by how much they are beyond .97 of the range [rad]."""
    energy_factor: float = 1.0
    """Of the paper's energy weight."""
    ang_vel_factor: float = 1.0
    """Of the paper's ang_vel_xy weight."""
    lean: float = 0.0
    """Weight of the trunk leaning otherwise than the clips do at that command (`trunk_lean.py`)."""
    power: float = 0.0
    """Weight of the motors' power, summed over the joints [1/W]."""
    power_share: float = 0.0
    """Weight of that power over what is usual at the command (`reward_terms.power_share`)."""
    power_free: float = 0.0
    """Of what is usual: how much costs nothing there, averaged over .4 s (`power_excess.py`); 0: all of it costs, by
    the moment's power."""
    slide_factor: float = 1.0
    """Of the paper's feet-slide weight."""
    slide_of: str = "centre"
    """What slides: the `centre` of the sole, or its `lowest` corner."""
    feet_apart_factor: float = 1.0
    """Of the paper's feet_lateral_distance weight."""
    action_rate_factor: float = 1.0
    """Of the paper's action-rate weight."""
    tracking_product: float = 0.0
    """Share of the three tracking terms' weight that their product has instead of their sum."""
    product_sigma2: float = 0.5
    """Width of the product's kernel: wide, so that it also leads from far off."""
    tracking_of: str = "instant"
    """Velocity that the tracking terms and their product see: `instant`, or `mean`, averaged over about a step."""
    progress: float = 0.0
    """Weight of the share of the commanded speed and yaw rate that is reached: no bell, so it leads from anywhere."""
    mean_tracking: float = 0.0
    """Weight of tracking by the velocity averaged over .4 s, all axes at once."""
    mean_sigma2: float = 0.05
    """Width of that kernel."""
    late_iterations: tuple[int, int] = (200, 500)
    """`mean_tracking` grows in between these iterations."""
    standing_still: float = 0.0
    """Weight of steps and joint speed while the command is to stand."""
    right_more: float = 0.0
    """By how much more the right foot's steps count there: who is alike on both sides can't choose a leg. Takes effect
    with `mirror_standing` off."""
    single_stance: float = 0.0
    """Weight of the time on one foot (up to .4 s) while walking."""
    single_stance_end_s: float = 0.0
    """Who is on one foot for longer [s] is paid nothing; 0: is paid for ever."""
    long_step: float = 0.0
    """Weight of the time walked in steps as long as the clips take at that command, shorter ones by their share."""
    long_step_share: float = 0.0
    """Of the clips' time: shorter steps are paid nothing …"""
    long_step_full: float = 0.75
    """… and those that take as long are paid in full."""
    long_step_sigma2: float = 0.0
    """Steps are paid as far as the averaged velocity is the command's, in a kernel of this width; 0: whatever it is."""
    double_stance: float = 0.0
    """Weight of what `long_step` pays, in steps with both feet on the ground as long as in the clips
    (`double_stance.py`)."""
    full_swing: float = 0.0
    """Weight of the time walked in strides in which hip and knee move as far as the clips' (`leg_swings.py`)."""
    saturation: float = 0.0
    """Weight of torque beyond .85 of a joint's limit."""
    saturation_of: str = "limit"
    """`limit`: of the constant one; `line`: of what the motor can give at its speed."""
    cost_start: float = 1.0
    """Factor of `power`, `power_share` and `saturation` at the start …"""
    cost_iterations: tuple[int, int] = (0, 0)
    """… grows to 1 between these iterations: what they cost less is free to be learnt first."""
    recovery_s: float = 0.0
    """For this long [s] after a push begins they cost nothing: to catch it takes effort, and may fail."""
    recovery_of: str = "effort"
    """`effort`: they alone; `steps`: nor do `feet_slide` and `standing_still`."""

    # Terminations
    fall_factor: float = 1.0
    """Of what the paper takes for a fall."""
    max_tilt_deg: float = 60.0
    min_height_m: float = 0.45
    stall: bool = False
    """End an episode, without the penalty, in which the robot stands though it is told to move."""
    stall_speed: float = 0.2
    """Commanded speed [m/s] above which standing is a stall …"""
    stall_yaw: float = 0.3
    """… and yaw rate [rad/s]."""
    stall_share: float = 0.3
    """Less than this share of the command is standing."""
    stall_either: bool = False
    """Of a command to move and to turn, whether following one half is not enough."""
    stall_s: float = 0.8
    """For this long [s], and not within this time of a new command."""
    stall_penalty: float = 0.0
    """What a stall costs, as a share of a fall."""

    # Where episodes start
    reference_share: float = 0.85
    """Episodes that start at an expert frame; the others near the default pose."""
    reference_command_share: float = 0.0
    """Of these, how many get the frame's own command."""
    reference_by_cell: bool = False
    """Frames drawn so that their commands are distributed as the policy's."""

    tracked: float = 0.0
    """Share of all episodes that track a clip (`tracked_clip.py`) at first; 0: none ever."""
    tracked_end: float = 0.0
    """It falls to this …"""
    tracked_iterations: tuple[int, int] = (200, 700)
    """… between these iterations."""
    track_clip: float = 10.0
    """Weight of being near the clip that is tracked."""
    track_joints: float = 0.0
    """Weight of each joint's own nearness to that clip's, on average: what one joint lacks hides no other."""
    tracked_pushed: bool = True
    """Whether who tracks a clip is pushed as others are: a foot that catches a push leaves the clip."""
    tracked_by_clip: bool = False
    """Whether nearness is measured by how far joints and ends move in the clip, else alike in all."""
    tracked_trunk: bool = False
    """Whether it counts for nearness how the trunk leans; joints, hands and feet are seen from the trunk."""

    # Randomization
    friction: tuple[float, float] = (0.4, 1.2)
    gain_range: tuple[float, float] = (0.9, 1.1)
    """Factor of stiffness and damping, each joint."""
    rotor_link_share: float = 0.0
    """Of the environments, which have some of the rotors' inertia on the links (`rotors.py`), a fourth to all."""
    trunk_density: tuple[float, float] = (-0.05, 0.1)
    """Half the logarithm of the factor of the trunk's mass and inertia."""
    noise: tuple[float, float, float, float] = (0.2, 0.05, 0.01, 0.5)
    """Uniform noise of gyro [rad/s], gravity, joint positions [rad] and velocities [rad/s]."""
    quiet_share: float = 0.0
    """Environments without this noise, and without pushes but for …"""
    quiet_pushed: float = 0.0
    """… this share of them."""

    # Pushes
    push_interval_s: tuple[float, float] = (4.0, 8.0)
    push_speed: tuple[float, float] = (0.3, 1.5)
    """Largest change of the base's horizontal velocity [m/s], at the start and at the end of the ramp."""
    push_impulse: tuple[float, float] = (0.0, 0.0)
    """Largest impulse of a .1 s force on the trunk [N s], at the start and the end of the ramp; 0: no such pushes."""
    push_least: float = 0.2
    """A push is at least this share of the largest one."""
    push_sagittal: float = 0.0
    """Share of the pushes that come straight from ahead or from behind."""
    push_iterations: int = 1000
    """Length of the ramp."""

    # Help
    assist: float = 0.0
    """Share of the full help by a hand that holds the trunk (`trunk_forces.py`) at the start; 0: no hand."""
    assist_iterations: tuple[int, int] = (100, 700)
    """It fades to nothing between these iterations."""

    # Adversarial motion prior
    style: float = 0.3
    """Share of the style reward in the blend; 0 trains without a discriminator."""
    style_iterations: tuple[int, int] = (0, 0)
    """The share grows from 0 to its value between these iterations."""
    style_gate: tuple[float, float] = (0.0, 0.0)
    """Nor is it more than it grows to between these shares of the commands that are reached; 0, 0: whatever is."""
    alpha: float = 0.25
    beta: float = 0.1
    """Of r = alpha (1 + tanh(beta D))."""
    window: int = 4
    """Frames the discriminator sees."""
    window_stride: int = 1
    """Control steps between these frames."""
    window_means: bool = False
    """Whether each of them is the mean of the control steps up to the next, else the first of these."""
    joint_vel_floor: float = 1.0
    """Least deviation [rad/s] that joint velocities are divided by before the discriminator sees them."""
    ang_vel_floor: float = 0.3
    """The same of the trunk's angular velocity."""
    discriminator_command: bool = False
    """Whether the discriminator sees the command with each frame."""
    expert_by_cell: bool = False
    """Expert windows drawn so that their commands are distributed as the policy's, else by MotionWeight alone."""
    use_augmented: bool = True
    """Whether mirrored and time-scaled clips are used."""
    expert_windows: int = 200_000
    """Preloaded."""
    discriminator_hidden: tuple[int, ...] = (512, 256)
    discriminator_rate: float = 1e-4
    discriminator_steps: int = 8
    """Gradient steps an iteration …"""
    discriminator_batch: int = 4096
    """… of this many expert and as many policy windows."""
    gradient_penalty: float = 10.0
    drift: float = 0.0
    """Weight of E[D^2], which keeps a score that has no zero from drifting."""
    replay_windows: int = 500_000

    # PPO
    steps: int = 24
    """Control steps of each environment an iteration."""
    epochs: int = 5
    mini_batches: int = 4
    learning_rate: float = 1e-3
    entropy: float = 0.005
    desired_kl: float = 0.01
    """To which the learning rate is held …"""
    final_kl: float = 0.0
    """… until it falls to this; 0: it stays."""
    final_iterations: tuple[int, int] = (1100, 1400)
    """Between these iterations."""
    init_std: float = 0.6
    """Deviation of the actions that exploration begins with."""
    init_posture: str = "default"
    """Around what it begins: the `default` pose, or the posture in which the `clips` walk."""
    std_end: float = 0.0
    """Most that it may be after the last of `std_iterations`, as a share of `init_std`; 0: no bound."""
    std_iterations: tuple[int, int] = (300, 900)
    """The bound sinks from `init_std` between these iterations."""
    hidden: tuple[int, ...] = (512, 256, 128)
    value_clip: bool = True
    """Whether an update moves the critic by at most .2 at a state, as rsl-rl does: one fall changes a return by 25."""
    critic_rate: float = 0.0
    """Learning rate of the critic; 0: the actor's, which the divergence holds down, as in rsl-rl."""
    critic_iterations: int = 0
    """For so many iterations the critic learns alone: of a network that is given, it knows nothing at first."""
    keep: float = 0.0
    """Weight of the divergence [nat] from the policy that is gone on with (`kept_walk.py`) …"""
    keep_of: str = "ahead"
    """… as it is told `ahead`, or as it is `unpushed` for `recovery_s`."""
    foresight: bool = False
    """Whether the critic is told what happens whatever the robot does, the next push first (`foresight.py`)."""
    symmetry: bool = True
    """Mirrored samples beside each mini-batch's own …"""
    mirror_standing: bool = True
    """… those in which the command is to stand among them."""

    def __post_init__(self) -> None:
        for name, words in WORDS.items():
            if getattr(self, name) not in words:
                raise TrainingError(f"option '{name}' is '{getattr(self, name)}'; it must be {' or '.join(words)}.")
        self._hold_to_shares()
        if not 0.0 <= self.push_least <= 1.0:
            raise TrainingError(f"option 'push_least' is {self.push_least:g}; it must be a share, 0 to 1.")
        slowest, fastest = self.ahead_speeds
        if not 0.0 <= slowest <= fastest:
            raise TrainingError(
                f"option 'ahead_speeds' is {slowest:g} to {fastest:g} m/s; it must be forward, the slowest first."
            )
        if not 0.0 <= self.keep < math.inf:
            raise TrainingError(f"option 'keep' is {self.keep:g}; it must be 0 or more.")
        if self.keep and not self.symmetry:
            raise TrainingError("option 'keep' needs option 'symmetry', in whose place in the loss it comes.")
        if self.keep_of == "unpushed" and not (self.recovery_s and self.foresight):
            raise TrainingError("option 'keep_of' is 'unpushed'; it needs 'recovery_s' and 'foresight', who tell when.")
        if not 0.0 <= self.power_free < math.inf:
            raise TrainingError(f"option 'power_free' is {self.power_free:g}; it must be 0 or more.")
        if self.power_free and not self.power_share:
            raise TrainingError("option 'power_free' needs option 'power_share', of which it is free.")
        if self.recovery_of != "effort" and not self.recovery_s:
            raise TrainingError(f"option 'recovery_of' is '{self.recovery_of}'; it needs 'recovery_s', for how long.")

    def _hold_to_shares(self) -> None:
        """Kinds of commands are shares of all of them."""
        shares = {"standing_share": self.standing_share, "fast_share": self.fast_share}
        if self.mixture == "balanced":
            alone = {f"alone_shares[{axis}]": share for axis, share in enumerate(self.alone_shares)}
            shares |= {"slow_share": self.slow_share, "ahead_share": self.ahead_share, **alone}
        told = ", ".join(f"{name} {share:g}" for name, share in shares.items())
        total = sum(shares.values())
        if not (min(shares.values()) >= 0.0 and total <= 1.0 + 1e-9):
            raise TrainingError(
                f"of the commands are {told}, {total:g} together; none may be below 0, nor all above 1."
            )

    def changed(self, **values: Any) -> Options:
        """These options with some changed. Raises TrainingError for a name or value that is none."""
        known = {field.name for field in dataclasses.fields(self)}
        for name in values:
            if name not in known:
                raise TrainingError(f"unknown option '{name}'; there are: {', '.join(sorted(known))}")
        return dataclasses.replace(self, **values)
