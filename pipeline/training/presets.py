"""Named settings of a run. `paper` is what the paper states; every deviation is an option with its reason."""

from __future__ import annotations

from pipeline.training.options import Options
from pipeline.training.training_error import TrainingError

REASONS = {
    "long_step_full": "steps of three quarters of the clips' time are paid in full; that is a third too many a minute",
    "slew_share": "robots are told commands at 1 m/s a second: seen_kl, trained with jumps, fell so, not at once",
    "rotor_link_share": "walks that fall in no command of MuJoCo's sweep fell with the rotors' inertia on the links",
    "lean": "policies leant 9 to 11 degrees back at .6 m/s, the clips lean 3 ahead: pushed back they go over",
    "ang_vel_factor": "trunks rocked from side to side by 4 to 5 degrees, the clips' by 1",
    "feet_apart_factor": "at 1.0 m/s feet of kept are .12 m apart, of the clips .18, of t1_walk .22; it falls sideways",
    "tracked_by_clip": "who stands is paid .7 for tracking steps to the side, of which kept takes 1.7 times as many",
    "tracked_trunk": "as lean: seen from the trunk, who leans back as a whole is where the clip is",
    "cost_start": "kept and plain, whose effort costs twice seen_kl's, bear fewer pushes; what else differs may be why",
    "cost_iterations": "as cost_start",
    "recovery_s": "to catch a push costs up to 14 a second in power; what sparing it does was not told apart",
    "double_stance": "on one foot for all of a long step, 20 N s to a side fell walks of .6 m/s; clips are on both",
    "full_swing": "knees of kept moved by .53 to .70 of what the clips' do, hips by .63 to .84",
    "slope_share": "down 5 degrees walks were .13 m/s off, where .09 are allowed",
    "slope_deg": "as slope_share",
    "slope_iterations": "as slope_share, and clips are level",
    "critic_iterations": "a policy file has no critic; by a new one's errors a policy that walks was lost in 3 updates",
    "critic_rate": "at the rate that small batches leave an actor critics lag (explained .6)",
    "late_iterations": "a policy that is gone on with walks already",
    "foresight": "returns differ by pushes, whatever robots do; early it made no difference, late it was not compared",
    "value_clip": "moved by .2 at most at a state, a critic is slow to learn a fall; as foresight, not shown to matter",
    "long_step_sigma2": "long steps were paid at any speed, ahead more than the command from 1 m/s on",
    "power_share": "bars go by command: by the watt kept spends 1.2 times what it may sideways, and 2 m/s pays little",
    "power": "power in sum is a bar of the evaluation; the norm over joints hardly sees that of quick side steps",
    "assist": "by the clip's own joints robots stay near it for .7 s; longer with a hand at the trunk",
    "assist_iterations": "as assist",
    "tracked": "held, but not made to track, robots took 303 to 560 steps a minute: what is paid leads there",
    "tracked_end": "let go sooner and to a tenth, steps went from 120 to 245 a minute within 150 iterations",
    "tracked_iterations": "as tracked",
    "tracked_pushed": "pushed, a robot steps where no clip does",
    "long_step_share": "at .5 quick steps pay as little as lifting no foot; from steps of a sixth nothing leads (.1)",
    "init_std": "a deviation of .6 alone quickens steps, those of a policy that never saw it too",
    "mirror_standing": "who is alike on both sides can't choose a leg to step with",
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
    "product_sigma2": "a wide bell pays standing at slow commands nearly as well as walking",
    "single_stance": "half the stride at twice the cadence was the fault of earlier runs",
    "beta": "|D| reaches 7 to 30, where tanh(.1 D) is flat",
    "drift": "a score without a zero drifts",
    "entropy": "with .005 and a KL of .01 learning stopped at iteration 500 to 675",
    "action_lag_steps": "targets on a robot arrive late",
    "energy_factor": "power is a bar of the evaluation",
    "slide_factor": "slip is a bar of the evaluation",
    "progress": "bells are flat far from the command: nothing led from rest to 2 m/s, and little from standing to .3",
    "stall_penalty": "standing until the stall ends it was paid more than trying to walk and falling",
    "long_step": "steps took a third to half of the clips' time; single_stance pays t1_walk's .13 a second more",
    "std_iterations": "as std_end; at a bound of .24 from iteration 280 on pushes were not learnt",
    "std_end": "noise of .4 hides from the discriminator, and from the rewards, what the policy does without it",
    "push_interval_s": "pushes are a bar of the evaluation",
    "single_stance_end_s": "who stands on one leg is not walking",
    "saturation_of": "a fast joint saturates far below the constant limit",
    "slow_share": "commands of .3 m/s were stood through or half followed",
    "init_posture": "the default pose has hips .25 and knees .4 rad straighter than the clips' walk",
    "quiet_pushed": "a robot alike on both sides moves both legs alike: 50 N s ahead fell 6 of 6 without noise, 2 with",
    "quiet_share": "noise and pushes kick a policy out of standing, which then stands where there are none",
    "style_gate": "style pulled robots that did not walk yet into standing, which many clips show",
    "discriminator_command": "a discriminator that does not see the command likes standing at every command",
    "tracking_of": "hips turn by .4 to .7 rad/s as people run: by the moment's yaw rate a run is paid .3 to .5",
    "slide_of": "the centre of a foot that rolls over its toes moves though nothing slides",
    "joint_vel_floor": "noise of exploration shakes joints by 1 to 2 rad/s, by which alone the discriminator told them",
    "window": "windows of .18 s hold neither the length nor the time of a step",
    "final_kl": "networks 75 iterations apart differed by half in the sweep, and their mean was better",
    "desired_kl": "as entropy",
    "discriminator_rate": "at 1e-4 it lags behind a policy that learns at a KL of .02",
    "fast_share": "makes room for turning, sideways and slow commands",
    "standing_share": "drift and pushes while standing are bars of the evaluation",
    "penalty_iterations": "as penalty_start",
    "push_iterations": "pushes are at their full size when walking has been learnt",
    "push_speed": "as push_impulse, which takes its place",
    "reference_by_cell": "as expert_by_cell",
    "saturation": "saturation of the legs is a bar of the evaluation",
    "stall_either": "half of a command could be stood through",
    "style": "at .3 the gait hardly followed the clips",
    "window_means": "as joint_vel_floor: noise that differs from step to step is gone from a mean",
    "window_stride": "as window",
    "run_iterations": "how many iterations 20 minutes have depends on how many runs share a GPU",
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

REFINED_STEPS = LONG_STEPS.changed(
    critic_iterations=60,
    critic_rate=5e-4,
    foresight=True,
    value_clip=False,
    mirror_standing=False,
    quiet_pushed=0.5,
    slew_share=0.5,
    action_lag_steps=4,
    rotor_link_share=0.2,
    slope_share=0.3,
    slope_deg=10.0,
    slope_iterations=(200, 700),
    power_share=2.0,
    saturation=6.0,
    cost_start=0.3,
    cost_iterations=(60, 700),
    slide_factor=36.0,
    progress=9.0,
    mean_tracking=4.0,
    late_iterations=(0, 0),
    penalty_start=1.0,
    push_iterations=300,
    style_iterations=(0, 200),
    init_std=0.24,
    std_end=0.6,
    std_iterations=(900, 1300),
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
        "the same paid for the velocity over a step and for long steps, exploring less at last; trained what ships",
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
        "cheap_steps with pushes caught at no cost of effort, and legs that swing as the clips'; not trained yet",
        CAUGHT_STEPS,
    ),
    "upright_steps": (
        "cheap_steps with the trunk held as the clips have it: slow and side steps are longer, pushes fell it standing",
        UPRIGHT_STEPS,
    ),
    "refined_steps": (
        "long_steps gone on with from a policy: effort, slip, slopes, delays, rotors; not trained on a GPU yet",
        REFINED_STEPS,
    ),
    "no_amp": ("the same without the discriminator, for comparison", TRACKING_AMP.changed(style=0.0)),
}
"""Name of a preset: what it is, and its options."""


DEFAULT = "long_steps"
"""What is trained where nothing else is asked for: the setting that gave the best policy so far."""


def preset(name: str) -> Options:
    """The options of a preset. Raises TrainingError for a name that is none."""
    if name not in PRESETS:
        raise TrainingError(f"unknown preset '{name}'; there are: {', '.join(PRESETS)}")
    return PRESETS[name][1]
