"""What a run begins with: nothing, or a policy that is gone on with, and what that asks of its options."""

from __future__ import annotations

from pathlib import Path

from pipeline.learning.training_error import TrainingError
from pipeline.training.options import Options


def check_start(options: Options, start_from: Path | None, going: bool) -> None:
    """A policy that is gone on with needs a critic that learns alone first, and nothing else does; who keeps a walk
    needs it at every start. `going`: there is a checkpoint to go on from. Raises TrainingError."""
    alone = options.critic_iterations
    if start_from is not None and not alone:
        raise TrainingError(
            f"{start_from}: has no critic, and by a new one's errors the policy would be lost. Take --preset "
            "refined_steps, or --set critic_iterations=60."
        )
    if options.keep and start_from is None:
        raise TrainingError(
            f"option 'keep' is {options.keep:g}, of a policy that is gone on with: name it by --start-from, also with "
            "--resume."
        )
    if alone and start_from is None and not going:
        raise TrainingError(
            f"option 'critic_iterations' is {alone}, for a policy that is gone on with: name one by --start-from."
        )
