"""A policy as ONNX: `observation` (n, 720) -> `action` (n, 21) in single precision, with metadata.

The graph is (observation - mean) / scale, then a Gemm a layer with Elu between, written node by node: equal policies
give equal bytes.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import onnx
from onnx import TensorProto, helper, numpy_helper

from pipeline.deployment import DeploymentTask, Policy
from pipeline.errors import FileError
from pipeline.export.card import check_stated
from pipeline.export.metadata import as_texts, from_texts, metadata
from pipeline.files import atomic

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


def write_onnx(path: Path, task: DeploymentTask, policy: Policy) -> None:
    """Write the ONNX file of a policy, whole or not at all."""
    atomic.write_bytes(path, to_onnx(task, policy))


def read_onnx(path: Path) -> tuple[onnx.ModelProto, dict[str, Any]]:
    """The model in a self-contained file, and its metadata.

    Raises FileError for what can't be read, is no ONNX model, is larger than `MAX_BYTES`, keeps its numbers in another
    file, has operators that no exported policy has, or is not the one that a card beside it states.
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
    except Exception as error:  # protobuf and the checker have errors of their own without a common base
        raise FileError(path, f"is no valid ONNX model ({type(error).__name__}: {error}).") from error
    strange = sorted({node.op_type for node in model.graph.node if node.domain or node.op_type not in OPERATORS})
    if strange or model.functions:
        known = ", ".join(sorted(OPERATORS))
        raise FileError(path, f"has the operators {', '.join(strange) or 'of its own'}; a policy has only {known}.")
    return model, facts


def _tensors(model: onnx.ModelProto) -> list[TensorProto]:
    """All tensors of the graph, including node attributes."""
    found = list(model.graph.initializer)
    for node in model.graph.node:
        for attribute in node.attribute:
            found += [attribute.t] if attribute.HasField("t") else []
            found += list(attribute.tensors)
    return found
