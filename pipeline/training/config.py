"""Options of a training run, in groups. Defaults are the preset `recipe`; `paper` has the published values."""

from __future__ import annotations

import dataclasses
import sys
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

from pipeline.learning.training_error import TrainingError

PAPER_TEXT = "paper"
"""Source of values that the paper states (docs/training.md names it)."""
BARS = "data/validation.yaml"
"""Source of values that follow from thresholds of the validation suite."""
AFTER_CHANGE_S = 1.0
"""The discriminator ignores windows for this long after a push or, if it observes commands, a new command [s]."""


def option(
    default: Any,
    text: str,
    unit: str,
    source: str,
    least: float | None = None,
    most: float | None = None,
    words: tuple[str, ...] = (),
) -> Any:
    """A field with its meaning, unit, source, and allowed range or choices."""
    facts = {"text": text, "unit": unit, "source": source, "least": least, "most": most, "words": words}
    return dataclasses.field(default=default, metadata=facts)


def share(default: Any, text: str, *, source: str) -> Any:
    """A field of one or two fractions, 0 to 1."""
    return option(default, text, "share", source, 0.0, 1.0)


@dataclass(frozen=True, kw_only=True)
class SimulationConfig:
    """Environments, and start and end of episodes."""

    num_envs: int = option(4096, "environments of each process", "count", "fills one H100", 1, 65536)
    terrain: str = option("plane", "ground: a plane or a heightfield", "word", PAPER_TEXT, words=("plane", "rough"))
    reference_share: float = share(
        0.85, "episodes that begin at an expert frame; the others at the default pose", source=PAPER_TEXT
    )
    stall_s: float = option(
        0.8, "an episode ends once the command was ignored for so long; 0: never", "s", "else robots stand", 0.0, 20.0
    )


@dataclass(frozen=True, kw_only=True)
class CommandsConfig:
    """Distribution of velocity commands; commands outside the shares are drawn on all axes."""

    standing_share: float = share(0.20, "commands to stand", source="paper: 0.10; pushes at standing need more")
    single_axis_share: float = share(0.45, "commands on one axis alone", source="the suite's single commands")
    fast_share: float = share(0.20, "commands of 1 to 2 m/s forward", source="paper: 0.35")
    fast_yaw: float = option(
        0.5, "largest yaw rate in half of the fast commands", "rad/s", "curves of the suite", 0.0, 3.0
    )
    slew_share: float = share(
        0.5, "environments with rate-limited commands (1 m/s^2, 1 rad/s^2); others: steps", source=f"{BARS}: commands"
    )

    def __post_init__(self) -> None:
        total = self.standing_share + self.single_axis_share + self.fast_share
        if total > 1.0 + 1e-9:
            raise TrainingError(
                f"commands.standing_share, single_axis_share and fast_share sum to {total:g}; at most 1 is allowed."
            )


@dataclass(frozen=True, kw_only=True)
class RewardsConfig:
    """Reward weights that differ between recipe and paper; `mdp/rewards.py` has all weights."""

    track_axes: float = option(0.0, "kernel of the velocity error on each axis", "1/s", "paper: 3", 0.0)
    track_all: float = option(
        9.0, "kernel of the averaged velocity error on all axes at once", "1/s", "sum of the paper's three weights", 0.0
    )
    track_mean: float = option(
        8.0, "narrow kernel of the averaged velocity error", "1/s", "with 4 the K1 walked 0.14 m/s too fast", 0.0
    )
    progress: float = option(
        3.0, "share of the commanded velocity that is reached", "1/s", "kernels are flat at large errors", 0.0
    )
    stand_still: float = option(
        -1.0, "feet off the ground when commanded to stand", "1/s", f"{BARS}: no step", most=0.0
    )
    power: float = option(-0.018, "mechanical power of the joints", "1/J", "power of the references", most=0.0)
    final_power: float = option(2.0, "factor of rewards.power at the end of the run", "-", f"{BARS}: power", 0.0, 10.0)
    feet_slide: float = option(-2.0, "slip of feet in contact", "1/m", "paper: -0.25", most=0.0)
    saturation: float = option(-3.0, "torque beyond 0.85 of the motor's limit", "1/s", f"{BARS}: saturation", most=0.0)
    joint_limits: str = option(
        "excess",
        "penalty at joint limits: excess in rad, or number of joints beyond",
        "word",
        "paper: indicator",
        words=("excess", "indicator"),
    )


@dataclass(frozen=True, kw_only=True)
class RandomizationConfig:
    """Domain randomization over environments and episodes."""

    friction: tuple[float, float] = option((0.3, 1.2), "friction of the ground", "-", "paper: 0.4 to 1.2", 0.0, 3.0)
    gains: tuple[float, float] = option((0.9, 1.1), "factor of stiffness and of damping", "-", PAPER_TEXT, 0.1, 3.0)
    trunk_density: tuple[float, float] = option(
        (-0.05, 0.1),
        "alpha: the trunk's mass and inertia are multiplied by exp(2 alpha)",
        "-",
        PAPER_TEXT,
        -1.0,
        1.0,
    )
    noise: float = option(1.0, "factor of the paper's sensor noise", "-", PAPER_TEXT, 0.0, 10.0)
    delay_s: float = option(0.04, "largest delay of joint targets", "s", f"{BARS}: delays", 0.0, 0.04)
    slope_deg: float = option(
        8.0, "steepest slope, in a third of the environments", "deg", f"{BARS}: slopes", 0.0, 20.0
    )
    rotor_link_share: float = share(
        0.2, "environments with part of the rotors' inertia on the links", source="avoids falls in DART"
    )


@dataclass(frozen=True, kw_only=True)
class PushesConfig:
    """Pushes; the two numbers of a magnitude are its maximum before and after the disturbance ramp."""

    interval_s: tuple[float, float] = option((4.0, 8.0), "time between pushes", "s", PAPER_TEXT, 0.02, 1000.0)
    kick_m_s: tuple[float, float] = option(
        (0.0, 1.8), "sudden change of the base's velocity, scaled from the T1", "m/s", "60 N s on 32 kg", 0.0, 5.0
    )
    impulse_n_s: tuple[float, float] = option(
        (0.0, 60.0), "impulse of a 0.1 s force on the trunk, scaled from the T1", "N s", BARS, 0.0, 200.0
    )


@dataclass(frozen=True, kw_only=True)
class DiscriminatorConfig:
    """The adversarial motion prior."""

    style: float = share(0.5, "style reward as a share of the total; 0: no discriminator", source="paper: 0.3")
    loss: str = option(
        "bce", "loss of the discriminator", "word", "with bce D stayed within 1.6", words=("wasserstein", "bce")
    )
    frames: int = option(10, "consecutive control steps in a window", "count", "paper: 4", 2, 50)
    learning_rate: float = option(5e-5, "learning rate of Adam", "-", "with 1e-4 D drifted to 1.7", 1e-7, 1e-1)
    gradient_penalty: float = option(20.0, "weight of the gradient penalty", "-", "R1; paper: 10", 0.0, 1000.0)
    largest_difference: float = option(
        1.4, "bce: no gradient step while E[D expert] - E[D policy] is larger", "-", "bar: 1.5", 0.0, 1000.0
    )
    by_command: bool = option(
        True,
        "sample most expert windows and start frames by the policy's commands; D observes the command",
        "yes/no",
        "paper: by MotionWeight alone",
    )
    use_augmented: bool = option(
        True, "use mirrored, time-scaled and perturbed clips", "yes/no", "benchmarks/ablation.py"
    )


@dataclass(frozen=True, kw_only=True)
class PpoConfig:
    """Options of rsl_rl's PPO; other values are rsl_rl's defaults or in `runner.py`."""

    entropy: float = option(0.002, "weight of the entropy bonus", "-", "paper: 0.005", 0.0, 1.0)
    desired_kl: float = option(0.02, "target KL divergence of the learning rate", "nat", "paper: 0.01", 1e-5, 1.0)
    final_kl: float = option(0.004, "target KL at the end of the run", "nat", "last checkpoints differ less", 1e-5, 1.0)
    init_std: float = option(
        0.3, "standard deviation of actions at the start", "-", "calmer steps; paper: 0.6", 1e-3, 3.0
    )
    final_std: float = share(
        0.33, "largest standard deviation at the end, as a share of init_std; 1: no bound", source="calmer steps"
    )


@dataclass(frozen=True, kw_only=True)
class ScheduleConfig:
    """Length of AMP + PPO, and ramps as fractions of it."""

    iterations: int = option(5800, "iterations of 24 control steps", "count", "47 minutes of one H100", 1, 1_000_000)
    style_ramp: tuple[float, float] = share(
        (0.02, 0.06), "start and end of the style reward's ramp", source="after the critic has learned"
    )
    disturbance_ramp: tuple[float, float] = share(
        (0.02, 0.25), "start and end of the ramp of delays, slopes, pushes", source="small pushes teach the wrong step"
    )
    final_ramp: tuple[float, float] = share(
        (0.6, 0.9), "start and end of the ramp to final KL, std and power", source="calmer steps"
    )


@dataclass(frozen=True, kw_only=True)
class DistillationConfig:
    """DAgger from the tracker."""

    iterations: int = option(
        500, "iterations of 24 control steps; 0: no distilled start", "count", "4 minutes of one H100", 0, 1_000_000
    )
    speed_tolerance: float = option(
        0.2,
        "clips whose rollout differs more from the reference's mean speed are left out",
        "m/s",
        "one rollout had 0.19 m/s, its reference 0.40 m/s",
        0.0,
        10.0,
    )


@dataclass(frozen=True, kw_only=True)
class Config:
    """Options of a training run; the defaults are the recipe."""

    simulation: SimulationConfig = SimulationConfig()
    commands: CommandsConfig = CommandsConfig()
    rewards: RewardsConfig = RewardsConfig()
    randomization: RandomizationConfig = RandomizationConfig()
    pushes: PushesConfig = PushesConfig()
    discriminator: DiscriminatorConfig = DiscriminatorConfig()
    ppo: PpoConfig = PpoConfig()
    schedule: ScheduleConfig = ScheduleConfig()
    distillation: DistillationConfig = DistillationConfig()

    def __post_init__(self) -> None:
        for name, value, facts in self.options():
            _check(name, value, facts)
        pushes = self.pushes
        pushed = max(pushes.kick_m_s[1], pushes.impulse_n_s[1]) > 0.0
        if self.discriminator.style > 0.0 and pushed and pushes.interval_s[1] <= AFTER_CHANGE_S:
            raise TrainingError(
                f"pushes.interval_s is at most {pushes.interval_s[1]:g} s, but the discriminator ignores windows for "
                f"{AFTER_CHANGE_S:g} s after a push. Raise it, or train without style: discriminator.style=0."
            )

    def options(self) -> Iterator[tuple[str, Any, Mapping[str, Any]]]:
        """Iterate over options: name `group.field`, value, and metadata (`text, unit, source`, limits)."""
        for group in dataclasses.fields(self):
            values = getattr(self, group.name)
            for field in dataclasses.fields(values):
                yield f"{group.name}.{field.name}", getattr(values, field.name), field.metadata

    def values(self) -> dict[str, Any]:
        """Option values by name `group.field`."""
        return {name: value for name, value, _ in self.options()}

    def changed(self, values: Mapping[str, Any]) -> Config:
        """Copy with changed options. Raises TrainingError for an unknown name or a value that is not allowed."""
        known = self.values()
        groups: dict[str, dict[str, Any]] = {}
        for name, value in values.items():
            if name not in known:
                raise TrainingError(f"unknown option '{name}'; the options are: {', '.join(known)}")
            group, field = name.split(".")
            groups.setdefault(group, {})[field] = value
        return dataclasses.replace(
            self, **{name: dataclasses.replace(getattr(self, name), **fields) for name, fields in groups.items()}
        )


def _check(name: str, value: Any, facts: Mapping[str, Any]) -> None:
    if facts["words"] and value not in facts["words"]:
        raise TrainingError(f"option '{name}' is '{value}'; it must be {' or '.join(facts['words'])}.")
    least = -sys.float_info.max if facts["least"] is None else facts["least"]
    most = sys.float_info.max if facts["most"] is None else facts["most"]
    numbers = value if isinstance(value, tuple) else (value,)
    if not facts["words"] and not all(least <= number <= most for number in numbers):
        shown = " to ".join(f"{number:g}" for number in numbers)
        allowed = f"{least:g} to {most:g}"
        if None in (facts["least"], facts["most"]):
            allowed = f"a finite number of at {f'most {most:g}' if facts['least'] is None else f'least {least:g}'}"
        raise TrainingError(f"option '{name}' is {shown}; {allowed} is allowed [{facts['unit']}].")
    if isinstance(value, tuple) and value[0] > value[1]:
        raise TrainingError(f"option '{name}' is {value[0]:g} to {value[1]:g}; the smaller number comes first.")


RECIPE = Config()

PAPER = RECIPE.changed(
    {
        "simulation.terrain": "rough",
        "simulation.stall_s": 0.0,
        "commands.standing_share": 0.10,
        "commands.single_axis_share": 0.0,
        "commands.fast_share": 0.35,
        "commands.fast_yaw": 0.0,
        "commands.slew_share": 0.0,
        "rewards.track_axes": 3.0,
        "rewards.track_all": 0.0,
        "rewards.track_mean": 0.0,
        "rewards.progress": 0.0,
        "rewards.stand_still": 0.0,
        "rewards.power": 0.0,
        "rewards.feet_slide": -0.25,
        "rewards.saturation": 0.0,
        "rewards.joint_limits": "indicator",
        "randomization.friction": (0.4, 1.2),
        "randomization.delay_s": 0.0,
        "randomization.slope_deg": 0.0,
        "randomization.rotor_link_share": 0.0,
        "pushes.kick_m_s": (0.3, 1.5),
        "pushes.impulse_n_s": (0.0, 0.0),
        "discriminator.style": 0.3,
        "discriminator.loss": "wasserstein",
        "discriminator.frames": 4,
        "discriminator.learning_rate": 1e-4,
        "discriminator.gradient_penalty": 10.0,
        "discriminator.by_command": False,
        "ppo.entropy": 0.005,
        "ppo.desired_kl": 0.01,
        "ppo.final_kl": 0.01,
        "ppo.init_std": 0.6,
        "ppo.final_std": 1.0,
        "schedule.style_ramp": (0.0, 0.0),
        "schedule.disturbance_ramp": (0.0, 0.66),
        "distillation.iterations": 0,
    }
)

PRESETS: dict[str, Config] = {"recipe": RECIPE, "paper": PAPER}
DEFAULT = "recipe"


def preset(name: str) -> Config:
    """Get a preset by name. Raises TrainingError for an unknown name."""
    if name not in PRESETS:
        raise TrainingError(f"unknown preset '{name}'; the presets are: {', '.join(PRESETS)}")
    return PRESETS[name]


def changed_from(name: str, config: Config) -> dict[str, Any]:
    """The options that differ from a preset."""
    known = preset(name).values()
    return {option: value for option, value in config.values().items() if value != known[option]}


def changed_by_texts(config: Config, texts: Mapping[str, str]) -> Config:
    """Copy of the configuration with options parsed from texts such as `0.5`, `true`, `1,2`.

    Raises TrainingError for an unknown name, or a text or value that is not allowed.
    """
    known = config.values()
    return config.changed({name: _value(name, text, known.get(name)) for name, text in texts.items()})


def texts_of(values: Mapping[str, Any]) -> list[str]:
    """Format options as `group.field=value`, the inverse of `changed_by_texts`."""
    return [f"{name}={_text(value)}" for name, value in sorted(values.items())]


def _text(value: Any) -> str:
    if isinstance(value, bool):
        return str(value).lower()
    return ",".join(_text(each) for each in value) if isinstance(value, (list, tuple)) else str(value)


def _value(name: str, text: str, current: Any) -> Any:
    try:
        if isinstance(current, bool):
            return {"true": True, "false": False}[text.lower()]
        if isinstance(current, tuple):
            first, last = text.split(",")
            return float(first), float(last)
        return type(current)(text) if current is not None else text
    except (KeyError, ValueError) as error:
        raise TrainingError(f"option '{name}' is '{text}'; it must look like '{_text(current)}'.") from error
