"""A policy as an npz of numbers: normalizer, layers, joint names and gains.

Arrays of the file: `mean, std, eps` and layers `L0_w, L0_b, …` (ELU between layers, linear output); optionally gains
`joint_names, kp, kd, default_joint_pos` of its training, and examples `golden_observation, golden_action`.
"""

import io
import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from jaxtyping import Float

from pipeline.errors import FileError
from pipeline.files import atomic
from pipeline.files import digest as digests
from pipeline.files.npz import read_npz_header

GAINS = ("kp", "kd", "default_joint_pos")
GOLDEN = ("golden_observation", "golden_action")
LAYER = re.compile(r"L[0-9]+_[wb]")
MAX_POLICY_BYTES = 64_000_000
"""Largest file; a network of three layers of 512 has 2 MB."""
FULL_TURN = 2.0 * np.pi
"""Bound of default joint positions [rad]."""
EXAMPLE_TOLERANCE = 1e-3
"""Largest deviation from the file's example actions, relative to the largest action or 1 if that is larger; networks
in single precision are within 1e-5."""


@dataclass(frozen=True, kw_only=True)
class PolicyGains:
    """Gains and default pose of a policy's training, joints in the order of `joint_names`."""

    joint_names: tuple[str, ...]
    kp: Float[np.ndarray, " j"]
    """[N m/rad]"""
    kd: Float[np.ndarray, " j"]
    """[N m s/rad]"""
    default_joint_pos: Float[np.ndarray, " j"]
    """[rad]"""


def gains_by_joint(joint_names: Sequence[str], kp: np.ndarray, kd: np.ndarray) -> dict[str, dict[str, float]]:
    """Convert `kp` (j,) [N m/rad] and `kd` (j,) [N m s/rad] to JSON types, by joint name."""
    pairs = zip(kp.tolist(), kd.tolist(), strict=True)
    return {name: {"kp": kp, "kd": kd} for name, (kp, kd) in zip(joint_names, pairs, strict=True)}


@dataclass(frozen=True, kw_only=True)
class Golden:
    """Example observations with the policy's actions."""

    observation: Float[np.ndarray, "g n"]
    action: Float[np.ndarray, "g a"]


@dataclass(frozen=True, kw_only=True)
class Policy:
    """A multilayer perceptron with its observation normalizer."""

    mean: Float[np.ndarray, " n"]
    scale: Float[np.ndarray, " n"]
    """Divisor of the centred observation."""
    layers: tuple[tuple[np.ndarray, np.ndarray], ...]
    """Weight (out, in) and bias (out,) of each layer."""
    gains: PolicyGains | None = None
    golden: Golden | None = None

    @property
    def observation_size(self) -> int:
        return len(self.mean)

    @property
    def action_size(self) -> int:
        return len(self.layers[-1][1])

    def act(self, observation: Float[np.ndarray, "*b n"]) -> Float[np.ndarray, "*b a"]:
        """Evaluate the network: actions for observation histories."""
        value = (observation - self.mean) / self.scale
        for index, (weight, bias) in enumerate(self.layers):
            value = value @ weight.T + bias
            if index < len(self.layers) - 1:
                value = np.where(value > 0.0, value, np.expm1(np.minimum(value, 0.0)))
        return value


def load_policy(path: Path) -> Policy:
    """Read a policy. Raises FileError if an array is missing, has a wrong shape, or contradicts the examples."""
    arrays, names = _arrays(path)
    count = sum(name.startswith("L") and name.endswith("_w") for name in arrays)
    expected = ["mean", "std", "eps", *(f"L{index}_{part}" for index in range(count) for part in "wb")]
    missing = [name for name in expected if name not in arrays]
    if missing or count == 0:
        raise FileError(path, f"lacks the arrays {', '.join(missing) or 'L0_w, L0_b'}.")
    stray = sorted(name for name in arrays if LAYER.fullmatch(name) and name not in expected)
    if stray:
        raise FileError(path, f"has incomplete layers: {', '.join(stray)}.")
    layers = tuple((arrays[f"L{index}_w"], arrays[f"L{index}_b"]) for index in range(count))
    flat = [name for name in expected if name.endswith("_b") and arrays[name].ndim != 1]
    if flat:
        raise FileError(path, f"has a bias that is not one-dimensional: {', '.join(flat)}.")
    shapes = [weight.shape for weight, _ in layers]
    sizes = [arrays["mean"].size, *(bias.size for _, bias in layers)]
    if shapes != list(zip(sizes[1:], sizes[:-1], strict=True)):
        raise FileError(path, f"has layers of the shapes {shapes}, which do not match each other.")
    if arrays["mean"].shape != arrays["std"].shape or arrays["mean"].ndim != 1:
        raise FileError(path, f"has a mean of shape {arrays['mean'].shape} and a std of {arrays['std'].shape}.")
    if arrays["eps"].shape not in ((), (1,), arrays["std"].shape):
        raise FileError(path, f"has an eps of shape {arrays['eps'].shape}, expected one number.")
    bad = [name for name, value in arrays.items() if not np.isfinite(value).all()]
    if bad:
        raise FileError(path, f"has numbers that are not finite in {', '.join(bad)}.")
    scale = arrays["std"] + arrays["eps"]
    if not (scale > 0.0).all():
        raise FileError(path, "has a std that is not above 0, which observations are divided by.")
    policy = Policy(
        mean=arrays["mean"],
        scale=scale,
        layers=layers,
        gains=_gains(path, arrays, names),
        golden=_golden(path, arrays, sizes[0], sizes[-1]),
    )
    _check_examples(path, policy)
    return policy


def _arrays(path: Path) -> tuple[dict[str, np.ndarray], tuple[str, ...]]:
    """Read the numeric arrays as float, and the joint names."""
    if not path.is_file():
        raise FileError(path, "there is no such file.", "Give the npz of a policy.")
    try:
        header = read_npz_header(path, MAX_POLICY_BYTES)
        names = header.texts("joint_names") if header.has("joint_names") else ()
        return {name: header.array(name) for name in sorted(header.numeric)}, names
    except FileError as error:
        raise FileError(path, f"is not an npz of numbers: {error.problem}", error.do) from error


def _gains(path: Path, arrays: dict[str, np.ndarray], names: tuple[str, ...]) -> PolicyGains | None:
    present = [name for name in GAINS if name in arrays]
    if not present and not names:
        return None
    if len(present) < len(GAINS) or not names:
        raise FileError(path, f"has only some of the arrays joint_names, {', '.join(GAINS)}.", "Write all or none.")
    if any(arrays[name].shape != (len(names),) for name in GAINS):
        raise FileError(path, f"has {len(names)} joint names, but another number of gains or default positions.")
    if (arrays["kp"] < 0.0).any() or (arrays["kd"] < 0.0).any():
        raise FileError(path, "has a kp or kd below 0, which drives a joint away from its target.", "Write 0 or more.")
    largest = float(np.abs(arrays["default_joint_pos"]).max(initial=0.0))
    if largest > FULL_TURN:
        problem = f"has a default position of {largest:.1f} rad; at most {FULL_TURN:.2f} rad is allowed."
        raise FileError(path, problem, "Convert degrees to radians.")
    return PolicyGains(joint_names=names, **{name: arrays[name] for name in GAINS})


def _golden(path: Path, arrays: dict[str, np.ndarray], observations: int, actions: int) -> Golden | None:
    examples = [arrays[name] for name in GOLDEN if name in arrays]
    if not examples:
        return None
    fits = [part.shape[1:] for part in examples] == [(observations,), (actions,)]
    if not fits or len(examples[0]) != len(examples[1]):
        raise FileError(path, f"has {' and '.join(GOLDEN)} that do not fit its layers.")
    return Golden(observation=examples[0], action=examples[1])


def _check_examples(path: Path, policy: Policy) -> None:
    """Raises FileError if the network's actions differ from the file's examples."""
    if policy.golden is None or not len(policy.golden.action):
        return
    with np.errstate(over="ignore", invalid="ignore"):
        error = np.abs(policy.act(policy.golden.observation) - policy.golden.action).max()
    allowed = EXAMPLE_TOLERANCE * max(1.0, float(np.abs(policy.golden.action).max()))
    if not error <= allowed:
        problem = f"its network's actions deviate by up to {error:.2g} from its own examples ({', '.join(GOLDEN)})."
        raise FileError(path, problem, "The file was edited or is damaged; export the policy again.")


def save_policy(path: Path, policy: Policy) -> None:
    """Write a policy as an npz; equal policies give equal bytes."""
    arrays: dict[str, np.ndarray] = {"mean": policy.mean, "std": policy.scale, "eps": np.array(0.0)}
    for index, (weight, bias) in enumerate(policy.layers):
        arrays |= {f"L{index}_w": weight, f"L{index}_b": bias}
    if policy.gains is not None:
        arrays["joint_names"] = np.array(policy.gains.joint_names)
        arrays |= {name: getattr(policy.gains, name) for name in GAINS}
    if policy.golden is not None:
        arrays |= {"golden_observation": policy.golden.observation, "golden_action": policy.golden.action}
    stream = io.BytesIO()
    np.savez(stream, **arrays)  # pyright: ignore[reportArgumentType]
    atomic.write_bytes(path, stream.getvalue())


def find_policy(paths: Iterable[Path], policy_digest: str) -> Path | None:
    """Find the first policy file with a digest, of its bytes or of network and gains. Other npz files are skipped."""
    for path in paths if policy_digest else ():
        try:
            candidates = (digests.of_file(path), digest(load_policy(path)))
        except FileError:
            continue
        if policy_digest in candidates:
            return path
    return None


def digest(policy: Policy) -> str:
    """Digest of network and gains in their stored precision."""
    parts = [policy.mean, policy.scale, *(part for layer in policy.layers for part in layer)]
    names: tuple[str, ...] = ()
    if policy.gains is not None:
        names = policy.gains.joint_names
        parts += [getattr(policy.gains, name) for name in GAINS]
    texts = [digests.of_bytes(np.ascontiguousarray(part, dtype="<f8").tobytes()) for part in parts]
    return digests.of_json([texts, [list(part.shape) for part in parts], list(names)])
