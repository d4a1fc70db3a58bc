"""Named settings of a run. `paper` is what the paper states; every deviation is an option with its reason."""

from __future__ import annotations

from pipeline.training.options import Options
from pipeline.training.training_error import TrainingError

REASONS = {
    "stall": "the paper's rewards with reference starts stood still: tracking in y and yaw pays 6 of 9 for standing",
    "mixture": "turning on the spot and side steps alone are rare in draws on all axes",
    "mean_tracking": "a speed error of .05 costs the wide kernel 1 %; this term makes it worth removing",
    "standing_still": "stepping on the spot is paid as standing is",
    "penalty_start": "full penalties from the start make standing the first thing that is learned",
    "push_impulse": "a force on the trunk tips the robot, a change of the base's velocity does not",
    "reference_command_share": "a state at 1.5 m/s with the command to stand teaches falling",
    "expert_by_cell": "drawn by weight alone, the discriminator compares slow policies with fast clips",
    "joint_limit": "an indicator has no gradient before the limit is crossed",
    "style_iterations": "a robot that falls is paid too little for style to see more in it than a reward for standing",
    "tracking_product": "as stall: standing is paid two sums of three, but little of the product",
    "single_stance": "half the stride at twice the cadence was the fault of earlier runs",
    "beta": "|D| reaches 7 to 30, where tanh(.1 D) is flat",
    "drift": "a score without a zero drifts",
    "entropy": "with .005 and a KL of .01 learning stopped at iteration 500 to 675",
    "action_lag_steps": "targets on a robot arrive late",
    "energy_factor": "power is a bar of the evaluation",
    "slide_factor": "slip is a bar of the evaluation",
}
"""Why an option differs from the paper's value in presets other than `paper`."""

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

PRESETS: dict[str, tuple[str, Options]] = {
    "paper": ("the paper's setting: heightfield, torque-speed motors, its rewards and pushes", PAPER),
    "paper_flat": ("the same on a plane", FLAT),
    "tracking_amp": ("tracking first, style grows in, forces on the trunk", TRACKING_AMP),
    "strong_style": (
        "the same with half of the reward for style, over longer windows; trained what ships",
        STRONG_STYLE,
    ),
    "strict_stall": (
        "stalls told more strictly and a sharper product; left standing earlier, not trained out",
        STRICT_STALL,
    ),
    "no_amp": ("the same without the discriminator, for comparison", TRACKING_AMP.changed(style=0.0)),
}
"""Name of a preset: what it is, and its options."""


def preset(name: str) -> Options:
    """The options of a preset. Raises TrainingError for a name that is none."""
    if name not in PRESETS:
        raise TrainingError(f"unknown preset '{name}'; there are: {', '.join(PRESETS)}")
    return PRESETS[name][1]
