"""Rows of the task reward that take something for effort beyond the paper's: power and saturated motors."""

from __future__ import annotations

from collections.abc import Callable

from pipeline.training import reward_terms as terms
from pipeline.training.options import Options
from pipeline.training.reward_row import COST, Term


def effort_rows(options: Options) -> tuple[Term, ...]:
    """The rows under these options; while a push is caught they cost nothing."""
    return (
        Term(
            name="power",
            equation="sum |tau dq|",
            weight=-options.power,
            value=lambda env: terms.power(env.readings.torque, env.readings.joint_vel),
            added="power is a bar of the evaluation, in sum; the norm over joints hardly sees small ones",
            ramp=COST,
            spared=True,
        ),
        Term(
            name="power_share",
            equation=_power_share_equation(options),
            weight=-options.power_share,
            value=_power_share(options),
            added="by the watt a run of 2 m/s is hardly worth being alive, and steps to the side cost little",
            ramp=COST,
            spared=True,
        ),
        Term(
            name="saturation",
            equation="sum max(0, |tau| / limit - .85)",
            weight=-options.saturation,
            value=lambda env: terms.saturation(env.readings.torque, env.motor_limit(options.saturation_of)),
            added="leaves the motors a reserve",
            ramp=COST,
            spared=True,
        ),
    )


def _power_share_equation(options: Options) -> str:
    beyond = f" - {options.power_free:g} of what is usual" if options.power_free else ""
    share = f"(sum |tau dq|{beyond}) / (what is usual at the command + {terms.NOISE_W:g} W)"
    return f"max(0, mean {share})" if options.power_free else share


def _power_share(options: Options) -> Callable:
    if options.power_free:
        return lambda env: env.power_excess.share
    return lambda env: terms.power_share(env.readings.torque, env.readings.joint_vel, env.command)
