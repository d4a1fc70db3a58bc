"""Named settings of a run. `paper` is what the paper states; `reasons.py` has the reason of every deviation."""

from __future__ import annotations

import dataclasses
from typing import Any

from pipeline.learning.training_error import TrainingError
from pipeline.training.options import Options

PAPER = Options(terrain="rough", motors="line")

FLAT = Options()

TRACKING_AMP = Options(
    action_lag_steps=2,
    mixture="balanced",
    standing_share=0.15,
    fast_share=0.30,
    penalty_start=0.25,
    penalty_iterations=400,
    joint_limit="excess",
    energy_factor=2.0,
    slide_factor=4.0,
    tracking_product=0.5,
    mean_tracking=2.0,
    standing_still=1.0,
    single_stance=1.5,
    saturation=0.5,
    stall=True,
    reference_command_share=0.8,
    reference_by_cell=True,
    push_speed=(0.0, 0.0),
    push_impulse=(0.0, 68.0),
    push_iterations=600,
    style=0.35,
    style_iterations=(150, 400),
    window_stride=2,
    beta=0.03,
    expert_by_cell=True,
    discriminator_rate=3e-4,
    drift=1e-3,
    entropy=0.001,
    desired_kl=0.02,
)

STRONG_STYLE = TRACKING_AMP.changed(style=0.5, window_stride=3, style_iterations=(200, 600))

STRICT_STALL = TRACKING_AMP.changed(stall_either=True, tracking_product=0.7, product_sigma2=0.25)

GATED_STYLE = STRICT_STALL.changed(
    run_iterations=1500,
    standing_share=0.10,
    slow_share=0.10,
    progress=3.0,
    single_stance=4.0,
    single_stance_end_s=0.6,
    slide_factor=8.0,
    saturation=3.0,
    saturation_of="line",
    stall_penalty=0.5,
    quiet_share=0.15,
    style=0.5,
    style_iterations=(150, 500),
    style_gate=(0.45, 0.75),
    window_stride=3,
    discriminator_command=True,
    final_kl=0.005,
)

WIDE_STYLE = GATED_STYLE.changed(joint_vel_floor=4.0, window=6, window_stride=4)

LONG_STEPS = WIDE_STYLE.changed(
    tracking_of="mean",
    slide_of="lowest",
    slide_factor=24.0,
    long_step=4.0,
    window_means=True,
    std_end=0.4,
    std_iterations=(600, 1200),
    push_interval_s=(3.0, 6.0),
    push_impulse=(0.0, 80.0),
    standing_share=0.15,
)

CALM_STEPS = LONG_STEPS.changed(init_posture="clips", long_step=12.0, quiet_pushed=0.5)

TRACKED_STEPS = CALM_STEPS.changed(
    assist=1.0,
    assist_iterations=(100, 450),
    tracked=1.0,
    tracked_end=0.2,
    tracked_iterations=(250, 800),
    long_step_share=0.5,
    init_std=0.3,
    std_end=0.7,
    push_iterations=1100,
    style_iterations=(20, 150),
    mirror_standing=False,
)

FORESEEN_STEPS = TRACKED_STEPS.changed(
    foresight=True,
    value_clip=False,
    long_step=8.0,
    long_step_sigma2=0.25,
    mean_tracking=4.0,
    power=0.005,
    saturation=6.0,
    push_impulse=(0.0, 75.0),
    push_iterations=1000,
    desired_kl=0.03,
    assist_iterations=(100, 380),
    tracked_iterations=(220, 650),
    tracked_end=0.1,
    init_std=0.35,
    std_end=0.43,
    std_iterations=(1000, 1350),
)

KEPT_STEPS = FORESEEN_STEPS.changed(
    tracked_end=0.4,
    tracked_pushed=False,
    long_step_full=0.9,
    power=0.01,
    saturation=10.0,
    action_lag_steps=4,
    slew_share=0.5,
    rotor_link_share=0.4,
)

CHEAP_STEPS = KEPT_STEPS.changed(
    lean=20.0,
    power=0.0,
    power_share=2.0,
    cost_start=0.3,
    cost_iterations=(900, 1300),
    action_lag_steps=2,
    rotor_link_share=0.25,
)

UPRIGHT_STEPS = CHEAP_STEPS.changed(
    ang_vel_factor=5.0,
    feet_apart_factor=5.0,
    tracked_trunk=True,
    tracked_by_clip=True,
    long_step_share=0.1,
    slope_share=0.3,
    slope_deg=6.0,
    slope_iterations=(900, 1200),
)

CAUGHT_STEPS = CHEAP_STEPS.changed(
    power_share=2.5,
    cost_start=0.25,
    recovery_s=2.0,
    push_impulse=(0.0, 80.0),
    full_swing=4.0,
    single_stance=0.0,
    double_stance=4.0,
    long_step_share=0.1,
    slope_share=0.3,
    slope_deg=8.0,
    slope_iterations=(500, 1000),
)

GOING_ON: dict[str, Any] = {
    "critic_iterations": 60,
    "critic_rate": 5e-4,
    "epochs": 3,
    "entropy": 0.0,
    "final_iterations": (1000, 1450),
    "init_std": 0.2,
    "std_iterations": (300, 1100),
    "right_more": 4.0,
    "quiet_share": 0.5,
    "quiet_pushed": 0.45,
    "push_impulse": (0.0, 85.0),
    "push_iterations": 1,
    "push_sagittal": 0.25,
    "recovery_s": 2.0,
    "standing_share": 0.22,
    "fast_share": 0.15,
    "slow_share": 0.05,
    "slew_share": 0.5,
    "action_lag_steps": 5,
    "rotor_link_share": 0.2,
    "slope_share": 0.3,
    "slope_deg": 10.0,
    "slope_iterations": (0, 1),
    "saturation": 12.0,
    "slide_factor": 130.0,
    "progress": 9.0,
    "late_iterations": (0, 0),
    "penalty_start": 1.0,
    "style_iterations": (60, 200),
}
"""What going on from a policy takes, whatever its gait: it walks, and is to be exact, frugal and hard to push over."""

REFINED_STEPS = LONG_STEPS.changed(
    **GOING_ON,
    keep=0.01,
    desired_kl=0.008,
    final_kl=0.002,
    std_end=0.4,
    foresight=True,
    value_clip=False,
    mirror_standing=False,
    alone_shares=(0.18, 0.12, 0.18),
    power_share=5.0,
    mean_tracking=18.0,
    style=0.3,
)

SETTLED_STEPS = CAUGHT_STEPS.changed(
    **GOING_ON,
    keep=0.002,
    desired_kl=0.01,
    final_kl=0.003,
    std_end=0.5,
    recovery_of="steps",
    fall_factor=4.0,
    alone_shares=(0.16, 0.16, 0.16),
    power_share=20.0,
    power_free=1.1,
    cost_start=1.0,
    cost_iterations=(0, 0),
    mean_tracking=14.0,
    penalty_iterations=0,
    style=0.6,
    assist=0.0,
    tracked=0.25,
    tracked_end=0.25,
    long_step=12.0,
    double_stance=10.0,
    full_swing=12.0,
)

BRACED_STEPS = REFINED_STEPS.changed(
    keep=0.5,
    keep_of="unpushed",
    desired_kl=0.015,
    final_kl=0.003,
    init_std=0.3,
    recovery_of="steps",
    fall_factor=6.0,
    push_impulse=(70.0, 75.0),
    push_iterations=400,
    push_interval_s=(2.0, 4.5),
    push_sagittal=0.3,
    quiet_share=0.3,
    quiet_pushed=0.8,
    standing_share=0.2,
    fast_share=0.05,
    slow_share=0.25,
    alone_shares=(0.35, 0.05, 0.05),
    action_lag_steps=4,
    rotor_link_share=0.15,
    slope_share=0.1,
    slope_deg=5.0,
    power_share=0.0,
    saturation=3.0,
    slide_factor=20.0,
    mean_tracking=10.0,
    style=0.0,
)

TRACED_STEPS = CAUGHT_STEPS.changed(
    **{
        **GOING_ON,
        "standing_share": 0.08,
        "fast_share": 0.05,
        "slow_share": 0.02,
        "quiet_share": 0.3,
        "init_std": 0.35,
        "std_iterations": (700, 1350),
        "push_impulse": (0.0, 25.0),
        "action_lag_steps": 6,
        "slope_share": 0.15,
        "slope_deg": 6.0,
        "saturation": 4.0,
        "slide_factor": 40.0,
    },
    alone_shares=(0.02, 0.02, 0.02),
    ahead_share=0.75,
    desired_kl=0.02,
    final_kl=0.003,
    std_end=0.3,
    power_share=5.0,
    power_free=1.1,
    cost_start=1.0,
    cost_iterations=(0, 0),
    mean_tracking=8.0,
    penalty_iterations=0,
    style=0.4,
    assist=0.0,
    tracked=0.75,
    tracked_end=0.75,
    track_clip=5.0,
    track_joints=25.0,
)

PRESETS: dict[str, tuple[str, Options]] = {
    "paper": ("the paper's setting: heightfield, torque-speed motors, its rewards and pushes", PAPER),
    "paper_flat": ("the same on a plane", FLAT),
    "tracking_amp": ("tracking first, style grows in, forces on the trunk", TRACKING_AMP),
    "strong_style": (
        "the same with half of the reward for style, over longer windows",
        STRONG_STYLE,
    ),
    "strict_stall": (
        "stalls told more strictly and a sharper product; left standing earlier, not trained out",
        STRICT_STALL,
    ),
    "gated_style": (
        "walking is paid before all else, style as far as commands are followed; for 20 minutes",
        GATED_STYLE,
    ),
    "wide_style": (
        "the same with style over half a step, its eye off how much joints shake",
        WIDE_STYLE,
    ),
    "long_steps": (
        "the same paid for the velocity over a step and for long steps, exploring less at last",
        LONG_STEPS,
    ),
    "calm_steps": (
        "the same, begun in the clips' posture and paid more for long steps, pushed without noise too",
        CALM_STEPS,
    ),
    "tracked_steps": (
        "the same, begun by tracking clips while a hand holds the trunk: the longest steps, slower so far",
        TRACKED_STEPS,
    ),
    "foreseen_steps": (
        "the same with a critic that knows pushes and commands ahead; steps are paid as far as commands are followed",
        FORESEEN_STEPS,
    ),
    "kept_steps": (
        "the same, two fifths of the episodes tracking clips to the end, rotors on links: the clips' cadence ahead",
        KEPT_STEPS,
    ),
    "cheap_steps": (
        "kept_steps with effort priced by what is usual at the command, less at first; the same cadence",
        CHEAP_STEPS,
    ),
    "caught_steps": (
        "cheap_steps with both feet down longer, pushes caught at no cost of effort, and legs that swing as the clips'",
        CAUGHT_STEPS,
    ),
    "settled_steps": (
        "going on from caught_steps: effort beyond what is usual, slip, pushes, strides; not trained yet",
        SETTLED_STEPS,
    ),
    "upright_steps": (
        "cheap_steps with the trunk held as the clips have it: slow and side steps are longer, pushes fell it standing",
        UPRIGHT_STEPS,
    ),
    "refined_steps": (
        "going on from a policy: effort, slip, slopes, delays, pushes; after long_steps it made refined_j",
        REFINED_STEPS,
    ),
    "braced_steps": (
        "going on from a policy that walks as it should: pushes alone are learnt, the walk of the unpushed is kept",
        BRACED_STEPS,
    ),
    "traced_steps": (
        "going on from caught_steps: nothing but the clips' walk ahead, each joint held to theirs, for a teacher of it",
        TRACED_STEPS,
    ),
    "no_amp": ("the same without the discriminator, for comparison", TRACKING_AMP.changed(style=0.0)),
}
"""Name of a preset: what it is, and its options."""


DEFAULT = "long_steps"
"""What is trained where nothing else is asked for: policies that ship began so, and `refined_steps` went on."""


def changed_from(name: str, options: Options) -> dict[str, Any]:
    """The options that differ from a preset's."""
    of_preset, given = dataclasses.asdict(preset(name)), dataclasses.asdict(options)
    return {key: value for key, value in given.items() if value != of_preset[key]}


def preset(name: str) -> Options:
    """The options of a preset. Raises TrainingError for a name that is none."""
    if name not in PRESETS:
        raise TrainingError(f"unknown preset '{name}'; there are: {', '.join(PRESETS)}")
    return PRESETS[name][1]
