"""A walking policy given as numbers: normalizer, layers, and the observation it reads.

The form is that of Booster's published T1 policy: 10 steps of 72 numbers, the oldest first, each
[gyro 3, gravity in the root frame 3, command 3, q - q0 21, dq 21, last action 21]; ELU between layers;
joint targets q0 + 0.25 action.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from jaxtyping import Float

from pipeline.errors import FileError

HISTORY = 10
ACTION_SCALE = 0.25

JOINT_ORDER: tuple[str, ...] = (
    "Left_Shoulder_Pitch",
    "Right_Shoulder_Pitch",
    "Waist",
    "Left_Shoulder_Roll",
    "Right_Shoulder_Roll",
    "Left_Hip_Pitch",
    "Right_Hip_Pitch",
    "Left_Elbow_Pitch",
    "Right_Elbow_Pitch",
    "Left_Hip_Roll",
    "Right_Hip_Roll",
    "Left_Elbow_Yaw",
    "Right_Elbow_Yaw",
    "Left_Hip_Yaw",
    "Right_Hip_Yaw",
    "Left_Knee_Pitch",
    "Right_Knee_Pitch",
    "Left_Ankle_Pitch",
    "Right_Ankle_Pitch",
    "Left_Ankle_Roll",
    "Right_Ankle_Roll",
)
"""Breadth-first order in which the published T1 policy has its 21 joints."""


@dataclass(frozen=True, kw_only=True)
class Policy:
    """A multilayer perceptron with its observation normalizer."""

    mean: Float[np.ndarray, " n"]
    scale: Float[np.ndarray, " n"]
    """What a centred observation is divided by."""
    layers: tuple[tuple[np.ndarray, np.ndarray], ...]
    """Weight (out, in) and bias (out,) of each layer."""

    def act(self, observation: Float[np.ndarray, "*b n"]) -> Float[np.ndarray, "*b a"]:
        """Action for an observation history."""
        value = (observation - self.mean) / self.scale
        for index, (weight, bias) in enumerate(self.layers):
            value = value @ weight.T + bias
            if index < len(self.layers) - 1:
                value = np.where(value > 0.0, value, np.expm1(np.minimum(value, 0.0)))
        return value


def load_policy(path: Path) -> Policy:
    """The policy in an npz with `mean, std, eps` and layers `L0_w, L0_b, ...`.

    Raises FileError where an array is missing, sizes do not follow on each other or a number isn't finite.
    """
    try:
        with np.load(path, allow_pickle=False) as arrays:
            named = {name: np.asarray(arrays[name], dtype=float) for name in arrays.files}
    except (OSError, ValueError) as error:
        raise FileError(path, f"is no npz of numbers ({error}).") from error
    count = sum(name.startswith("L") and name.endswith("_w") for name in named)
    wanted = ["mean", "std", "eps", *(f"L{index}_{part}" for index in range(count) for part in "wb")]
    missing = [name for name in wanted if name not in named]
    if missing or count == 0:
        raise FileError(path, f"lacks the arrays {', '.join(missing) or 'L0_w, L0_b'}.")
    layers = tuple((named[f"L{index}_w"], named[f"L{index}_b"]) for index in range(count))
    sizes = [len(named["mean"]), *(len(bias) for _, bias in layers)]
    shapes = [weight.shape for weight, _ in layers]
    if shapes != list(zip(sizes[1:], sizes[:-1], strict=True)):
        raise FileError(path, f"has layers of the shapes {shapes}, which do not follow on each other.")
    if not all(np.isfinite(value).all() for value in named.values()):
        raise FileError(path, "has numbers that are not finite.")
    return Policy(mean=named["mean"], scale=named["std"] + named["eps"], layers=layers)
