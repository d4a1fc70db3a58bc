"""Run rsl_rl's runner one iteration at a time."""

from rsl_rl.runners import OnPolicyRunner


def learn_once(runner: OnPolicyRunner) -> None:
    """Run one iteration; the first call broadcasts the parameters of rank 0.

    rsl_rl broadcasts, and prints a line, at each call of `learn`. From the second call on this fails, because the
    normalizers then hold inference-mode tensors; it is not needed either, because gradients are averaged.
    """
    runner.learn(1)
    runner.is_distributed = False
