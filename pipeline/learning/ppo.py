"""rsl_rl's PPO for a run that calls the runner's `learn` once an iteration, also in several processes."""

from contextlib import redirect_stdout

from rsl_rl.algorithms import PPO
from rsl_rl.runners import OnPolicyRunner


def learn_once(runner: OnPolicyRunner) -> None:
    """One iteration, without the line that each process would print beside our own progress."""
    with redirect_stdout(None):
        runner.learn(1)


class StepwisePpo(PPO):
    """PPO whose processes take over the first one's parameters once.

    rsl_rl's runner asks for that at each call of `learn`. From the second call on it would fail, since normalizers then
    hold tensors of inference mode, and gradients are averaged anyway.
    """

    _synchronized = False

    def broadcast_parameters(self) -> None:
        """Give every process the first one's parameters, at the first call only."""
        if not self._synchronized:
            super().broadcast_parameters()
            self._synchronized = True
