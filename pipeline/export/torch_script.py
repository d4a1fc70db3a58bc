"""A policy as TorchScript, the form that booster_deploy loads: observation (720,) or (n, 720) -> action.

The archive is written again without what TorchScript notes of the sources it was compiled from (paths of the machine)
and with fixed times, so that equal policies give equal bytes.
"""

from __future__ import annotations

import io
import json
import warnings
import zipfile
from pathlib import Path
from typing import Any

import numpy as np
import torch

from pipeline.deployment import DeploymentTask, Policy
from pipeline.errors import FileError
from pipeline.export.metadata import metadata
from pipeline.files import atomic
from pipeline.files.npz import NpzCaps
from pipeline.files.torch_archive import check_torch_archive

FACTS = "metadata.json"
"""Name of the archive's extra file with the metadata."""
CAPS = NpzCaps(members=200, member_bytes=64_000_000, total_bytes=64_000_000, ratio=1_000)
"""Of a TorchScript archive, as of a policy's npz."""
_ALIGNMENT = 64
"""Alignment of tensors in an archive that torch maps into memory [bytes]."""


class Network(torch.nn.Module):
    """The policy's network in single precision."""

    def __init__(self, policy: Policy):
        super().__init__()
        self.register_buffer("mean", _tensor(policy.mean))
        self.register_buffer("scale", _tensor(policy.scale))
        parts: list[torch.nn.Module] = []
        for weight, bias in policy.layers:
            layer = torch.nn.Linear(weight.shape[1], weight.shape[0])
            layer.weight, layer.bias = (torch.nn.Parameter(_tensor(each), False) for each in (weight, bias))
            parts += [layer, torch.nn.ELU()]
        self.layers = torch.nn.Sequential(*parts[:-1])

    def forward(self, observation: torch.Tensor) -> torch.Tensor:
        return self.layers((observation - self.mean) / self.scale)  # pyright: ignore[reportOperatorIssue], buffers


def _tensor(values: np.ndarray) -> torch.Tensor:
    return torch.from_numpy(np.array(values, np.float32))


def to_torch_script(task: DeploymentTask, policy: Policy) -> bytes:
    """The TorchScript archive of a policy."""
    stream = io.BytesIO()
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", DeprecationWarning)  # booster_deploy loads this format
        facts = json.dumps(metadata(task, policy), sort_keys=True)
        torch.jit.save(torch.jit.script(Network(policy).eval()), stream, _extra_files={FACTS: facts})
    return _without_sources(stream.getvalue())


def write_torch_script(path: Path, task: DeploymentTask, policy: Policy) -> None:
    """Write the TorchScript archive of a policy, whole or not at all."""
    atomic.write_bytes(path, to_torch_script(task, policy))


def read_torch_script(path: Path) -> tuple[Any, dict[str, Any]]:
    """The module and its metadata, loaded as booster_deploy does.

    Raises FileError for what is no TorchScript archive, or is larger than `CAPS` when inflated. A checkpoint is a
    pickle, which may hold code that runs when it is read, and is not opened here.
    """
    if not path.is_file():
        raise FileError(path, "there is no such file.", "Name the TorchScript file of an exported policy.")
    if not any("/code/" in name for name in check_torch_archive(path, CAPS)):
        raise FileError(path, "is a checkpoint or another archive without code/.", "Export the policy as TorchScript.")
    extra = {FACTS: ""}
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", DeprecationWarning)
            module = torch.jit.load(str(path), map_location="cpu", _extra_files=extra)
    except RuntimeError as error:
        raise FileError(path, f"is no TorchScript module ({str(error).splitlines()[0]}).") from error
    return module.eval(), json.loads(extra[FACTS]) if extra[FACTS] else {}


def _without_sources(data: bytes) -> bytes:
    """The archive without source paths, with fixed times and aligned tensors."""
    stream = io.BytesIO()
    with zipfile.ZipFile(io.BytesIO(data)) as old, zipfile.ZipFile(stream, "w", zipfile.ZIP_STORED) as new:
        for entry in old.infolist():
            if entry.filename.endswith(".debug_pkl"):
                continue
            fresh = zipfile.ZipInfo(entry.filename)
            start = stream.tell() + zipfile.sizeFileHeader + len(entry.filename) + 4
            padding = -start % _ALIGNMENT
            fresh.extra = b"FB" + padding.to_bytes(2, "little") + b"Z" * padding
            new.writestr(fresh, old.read(entry))
    return stream.getvalue()
