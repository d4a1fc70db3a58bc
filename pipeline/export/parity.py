"""Compare exported networks with the original over golden and random observations."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from jaxtyping import Float

from pipeline.deployment import Policy
from pipeline.export.export_error import ExportError
from pipeline.export.onnx_model import read_onnx
from pipeline.export.torch_script import read_torch_script

TOLERANCE = 1e-5
"""Largest allowed difference of an action [1]; a quarter of it in a joint target [rad]."""
LARGE = 10.0
"""Magnitude of an action above which a relative 1e-6 is allowed, for single precision."""
RANDOM = 256
"""Number of random observations."""


@dataclass(frozen=True, kw_only=True)
class Parity:
    """Largest absolute differences from the network in double precision."""

    onnx: float
    torch_script: float
    times_allowed: float
    """Largest difference over its tolerance, of both forms."""
    runtime: str
    """The runtime of the ONNX file."""
    observations: int

    @property
    def holds(self) -> bool:
        return self.times_allowed <= 1.0


def observations_to_compare(
    policy: Policy, golden: Float[np.ndarray, "g n"], rng: np.random.Generator
) -> Float[np.ndarray, "m n"]:
    """Golden observations, then random ones with the mean and scale of the normalizer."""
    random = policy.mean + policy.scale * rng.normal(size=(RANDOM, policy.observation_size))
    return np.concatenate([golden, random])


def measure_parity(
    policy: Policy, onnx_path: Path, torch_script_path: Path, observations: Float[np.ndarray, "m n"]
) -> Parity:
    """Run both files on observations. Raises ExportError if either exceeds the tolerance."""
    import torch

    wanted = policy.act(observations)
    single = observations.astype(np.float32)
    runtime, action = _run_onnx(onnx_path, single)
    module, _ = read_torch_script(torch_script_path)
    with torch.no_grad():
        scripted = module(torch.from_numpy(single)).numpy()
    allowed = TOLERANCE * np.maximum(1.0, np.abs(wanted) / LARGE)
    off = [np.abs(each - wanted) for each in (action, scripted)]
    parity = Parity(
        onnx=float(off[0].max()),
        torch_script=float(off[1].max()),
        times_allowed=float(max((each / allowed).max() for each in off)),
        runtime=runtime,
        observations=len(observations),
    )
    if not parity.holds:
        raise ExportError(
            f"exported networks are not the policy: over {len(observations)} observations actions differ by "
            f"{parity.onnx:.2e} (ONNX, {runtime}) and {parity.torch_script:.2e} (TorchScript); "
            f"allowed is {TOLERANCE:.0e}, or a millionth of an action beyond {LARGE:g}; the largest is "
            f"{np.abs(wanted).max():.1f}. Export it again from the trained network."
        )
    return parity


def _run_onnx(path: Path, observations: np.ndarray) -> tuple[str, np.ndarray]:
    """Actions of the ONNX file, by onnxruntime if installed, else by ONNX's reference evaluator."""
    model, _ = read_onnx(path)
    try:
        import onnxruntime
    except ImportError:
        from onnx.reference import ReferenceEvaluator

        (action,) = ReferenceEvaluator(model).run(None, {"observation": observations})  # pyright: ignore
        return "onnx.reference", np.asarray(action)
    session = onnxruntime.InferenceSession(model.SerializeToString(), providers=["CPUExecutionProvider"])
    (action,) = session.run(None, {"observation": observations})
    return "onnxruntime", np.asarray(action)
