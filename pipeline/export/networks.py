"""A policy as ONNX and as TorchScript: observation (n, 720) -> action (n, 21); equal policies give equal bytes.

ONNX: the graph is (observation - mean) / scale, then one Gemm per layer with Elu between, in single precision,
with metadata. TorchScript: the format that booster_deploy loads, also for an observation (720,). Its archive is
rewritten without debug information on the sources (paths of the machine) and with fixed timestamps.
"""

import io
import json
import warnings
import zipfile
from pathlib import Path
from typing import Any

import numpy as np
import onnx
import torch
from onnx import TensorProto, helper, numpy_helper

from pipeline.deployment import DeploymentTask, Policy
from pipeline.deployment.policy import MAX_POLICY_BYTES
from pipeline.errors import FileError
from pipeline.export.card import check_stated
from pipeline.export.metadata import as_texts, from_texts, metadata
from pipeline.files.npz import check_torch_archive

OPSET = 17
IR_VERSION = 8
"""Supported by the older runtimes on robots."""
OPERATORS = frozenset({"Sub", "Div", "Gemm", "Elu"})
"""Operators of an exported graph; files with others are refused."""
MAX_BYTES = 100_000_000


def to_onnx(task: DeploymentTask, policy: Policy) -> bytes:
    """The ONNX file of a policy."""
    constants = {"mean": policy.mean, "scale": policy.scale}
    nodes = [
        helper.make_node("Sub", ["observation", "mean"], ["centred"]),
        helper.make_node("Div", ["centred", "scale"], ["normalized"]),
    ]
    value = "normalized"
    last = len(policy.layers) - 1
    for index, (weight, bias) in enumerate(policy.layers):
        constants |= {f"L{index}_w": weight, f"L{index}_b": bias}
        out = "action" if index == last else f"layer{index}"
        nodes.append(helper.make_node("Gemm", [value, f"L{index}_w", f"L{index}_b"], [out], transB=1))
        value = out
        if index < last:
            nodes.append(helper.make_node("Elu", [value], [f"elu{index}"], alpha=1.0))
            value = f"elu{index}"
    graph = helper.make_graph(
        nodes,
        "policy",
        [helper.make_tensor_value_info("observation", TensorProto.FLOAT, ["n", policy.observation_size])],
        [helper.make_tensor_value_info("action", TensorProto.FLOAT, ["n", policy.action_size])],
        [numpy_helper.from_array(np.ascontiguousarray(each, np.float32), name) for name, each in constants.items()],
    )
    model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", OPSET)], ir_version=IR_VERSION)
    model.producer_name = "booster-lab"
    helper.set_model_props(model, as_texts(metadata(task, policy)))
    onnx.checker.check_model(model, full_check=True)
    return model.SerializeToString(deterministic=True)


def read_onnx(path: Path) -> tuple[onnx.ModelProto, dict[str, Any]]:
    """The model in a self-contained file, and its metadata.

    Raises FileError for a file that is unreadable, not an ONNX model, larger than `MAX_BYTES`, keeps tensors in another
    file, has operators that no exported policy has, or differs from the digest in a card beside it.
    """
    if not path.is_file():
        raise FileError(path, "there is no such file.", "Name the ONNX file of an exported policy.")
    if path.stat().st_size > MAX_BYTES:
        raise FileError(path, f"is larger than {MAX_BYTES} bytes.")
    check_stated(path)
    try:
        content = path.read_bytes()
    except OSError as error:
        raise FileError(path, f"can't be read ({error.strerror or error}).") from error
    try:
        model = onnx.load_model_from_string(content)
        outside = [each.name for each in _tensors(model) if each.data_location == TensorProto.EXTERNAL]
        if outside:
            raise FileError(path, f"keeps {', '.join(outside)} in another file.", "Export it again, in one file.")
        onnx.checker.check_model(model, full_check=True)
        facts = from_texts({each.key: each.value for each in model.metadata_props})
    except (FileError, MemoryError):
        raise
    except Exception as error:  # the errors of protobuf and the checker have no common base class
        raise FileError(path, f"is not a valid ONNX model ({type(error).__name__}: {error}).") from error
    unknown = sorted({node.op_type for node in model.graph.node if node.domain or node.op_type not in OPERATORS})
    if unknown or model.functions:
        known = ", ".join(sorted(OPERATORS))
        raise FileError(path, f"has the operators {', '.join(unknown) or 'of its own'}; a policy has only {known}.")
    return model, facts


def _tensors(model: onnx.ModelProto) -> list[TensorProto]:
    """All tensors of the graph, including node attributes."""
    found = list(model.graph.initializer)
    for node in model.graph.node:
        for attribute in node.attribute:
            found += [attribute.t] if attribute.HasField("t") else []
            found += list(attribute.tensors)
    return found


FACTS = "metadata.json"
"""Name of the archive's extra file with the metadata."""
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


def read_torch_script(path: Path) -> tuple[Any, dict[str, Any]]:
    """The module and its metadata, loaded as booster_deploy does.

    Raises FileError for a file that is not a TorchScript archive, or too large when inflated. A checkpoint is a pickle,
    which can execute code when it is read, and is refused.
    """
    if not path.is_file():
        raise FileError(path, "there is no such file.", "Name the TorchScript file of an exported policy.")
    if not any("/code/" in name for name in check_torch_archive(path, MAX_POLICY_BYTES)):
        raise FileError(path, "is a checkpoint or another archive without code/.", "Export the policy as TorchScript.")
    extra = {FACTS: ""}
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", DeprecationWarning)
            module = torch.jit.load(str(path), map_location="cpu", _extra_files=extra)
    except RuntimeError as error:
        raise FileError(path, f"is not a TorchScript module ({str(error).splitlines()[0]}).") from error
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
