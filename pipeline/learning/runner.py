"""rsl_rl's runner, asked for one iteration at a time."""

from rsl_rl.runners import OnPolicyRunner


def learn_once(runner: OnPolicyRunner) -> None:
    """One iteration; at the first one all processes take over the first one's parameters.

    rsl_rl would do that, and print a line, at each call of `learn`. From the second call on it fails, since normalizers
    then hold tensors of inference mode, and gradients are averaged anyway.
    """
    runner.learn(1)
    runner.is_distributed = False
