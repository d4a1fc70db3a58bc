"""Mutated policies, golden vectors, ONNX and TorchScript files, cards and checkpoints, and whether what was read
contradicts digests, checksums or examples."""

from __future__ import annotations

import dataclasses
import functools
import io
import json
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import torch

from pipeline.deployment import deployment_task, load_policy, save_policy
from pipeline.deployment.policy import Golden
from pipeline.errors import PipelineError
from pipeline.export.card import FILE, read_card
from pipeline.export.folder import GOLDEN, ONNX, POLICY, TORCH_SCRIPT, Source, export_policy, read_export
from pipeline.export.networks import read_onnx, read_torch_script
from pipeline.export.parity import read_golden
from pipeline.files import digest
from pipeline.learning.checkpoint import STATES, load_checkpoint, save_checkpoint
from pipeline.learning.training_error import TrainingError
from pipeline.readers.restricted_pickle import load_torch
from pipeline.robot import load_robot
from tests.factories import mutations
from tests.factories.campaign import CRASHED, REFUSED, RIGHT, WRONG, Case, Verdict, is_sentence
from tests.factories.policies import random_policy

CHECKPOINT = "model_000005.pt"
EXAMPLES = 4
TOLERANCE = 1e-3
"""Largest deviation of an action from the example's that is none: the arrays may be in single precision."""


@dataclass(frozen=True)
class _Target:
    """A file that is mutated, alone or in its export, and its check."""

    file: str
    alone: bool
    check: Callable[[Path], list[str]]
    """Reads the folder; contradictions. Raises PipelineError."""


def policy_cases(seed: int, count: int, folder: Path) -> Iterator[Case]:
    """`count` mutated files: alone, and as parts of an exported policy."""
    robot = load_robot("t1")
    rng = np.random.default_rng(seed)
    policy = random_policy(deployment_task(robot), rng, gains=True)
    calm = tuple((0.02 * weight, 0.1 * bias) for weight, bias in policy.layers)  # its own actions are observations
    policy = dataclasses.replace(policy, layers=calm)
    observation = rng.normal(size=(EXAMPLES, policy.observation_size))
    policy = dataclasses.replace(policy, golden=Golden(observation=observation, action=policy.act(observation)))
    save_policy(folder / "trained.npz", policy)
    data = {"digest": "ab" * 32, "clips": 1, "seconds": 1.0, "licence": {"strictest": "CC0-1.0", "allowed_use": "any"}}
    source = Source(policy=folder / "trained.npz", run={"name": "campaign"}, data=data)
    export_policy(folder / "export", "campaign", robot, source, rng, shippable=False)
    files = {name: (folder / "export" / name).read_bytes() for name in (POLICY, GOLDEN, ONNX, TORCH_SCRIPT, FILE)}
    states = {name: {"mlp.0.weight": torch.full((40, 30), 1.0 + part)} for part, name in enumerate(STATES)}
    files[CHECKPOINT] = save_checkpoint(folder, 5, states, 120).read_bytes()
    for index in range(count):
        target = TARGETS[index % len(TARGETS)]
        drawn = np.random.default_rng([seed, 4, index])
        content, what = _mutated(target, files[target.file], drawn)
        if content != files[target.file]:
            where = "alone" if target.alone else "in its export"
            run = functools.partial(_judge, target, files, content)
            yield Case(f"policy {index} {target.file} {where}: {what}", run)


def _mutated(target: _Target, content: bytes, rng: np.random.Generator) -> tuple[bytes, str]:
    if target.file == FILE:
        return _mutated_card(content, rng) if rng.random() < 0.5 else mutations.mutated_text(content, rng)
    if target.file in (POLICY, GOLDEN) and rng.random() < 0.7:
        return _mutated_arrays(content, rng)
    return mutations.mutated_bytes(content, rng)


def _mutated_arrays(content: bytes, rng: np.random.Generator) -> tuple[bytes, str]:
    """One array of an archive changed, whole and with right checksums."""
    with np.load(io.BytesIO(content)) as archive:
        arrays = {name: archive[name] for name in archive.files}
    name = str(rng.choice(sorted(arrays)))
    value = arrays[name]
    number = value.dtype.kind == "f"
    kinds = [
        "left out",
        "type",
        "row removed",
        "axis added",
        *(["scaled", "negated", "nan", "entry"] if number else []),
    ]
    kind = str(rng.choice(kinds))
    if kind == "left out":
        del arrays[name]
    elif kind == "row removed":
        arrays[name] = value[:-1] if value.ndim else value[None][:0]
    elif kind == "axis added":
        arrays[name] = value[None]
    elif kind == "type":
        arrays[name] = [value.astype(str), value.astype(str).astype(object), np.array(1.0)][int(rng.integers(3))]
    else:
        changed = np.array(value)
        place = tuple(int(rng.integers(length)) for length in changed.shape)
        if kind == "entry":
            changed[place] += 10.0
        elif kind == "nan":
            changed[place] = np.nan
        else:
            changed = changed * (2.0 if kind == "scaled" else -1.0)
        arrays[name] = changed
    stream = io.BytesIO()
    np.savez(stream, allow_pickle=True, **arrays)
    return stream.getvalue(), f"{kind} {name}"


def _mutated_card(content: bytes, rng: np.random.Generator) -> tuple[bytes, str]:
    """A card with one field of another kind, sealed again."""
    value = json.loads(content)
    value.pop("sha256", None)
    name = str(rng.choice(sorted(value)))
    odd = [None, [], {}, 3, "x", True, {"a": None}, "\n|<script>", -1.5, [[]]]
    value[name] = odd[int(rng.integers(len(odd)))]
    return json.dumps({**value, "sha256": digest.of_json(value)}).encode(), f"{name} is {value[name]!r}, sealed again"


def _judge(target: _Target, files: dict[str, bytes], content: bytes, folder: Path) -> Verdict:
    for name, data in files.items():
        if name == target.file or not target.alone:
            (folder / name).parent.mkdir(parents=True, exist_ok=True)
            (folder / name).write_bytes(content if name == target.file else data)
    try:
        faults = target.check(folder)
    except (PipelineError, TrainingError) as error:
        whole = is_sentence(str(error), folder.name)
        return Verdict(REFUSED if whole else CRASHED, f"{'' if whole else 'no sentence: '}{error}", len(content))
    return Verdict(WRONG if faults else RIGHT, "; ".join(faults), len(content))


def _policy_alone(folder: Path) -> list[str]:
    """The network gives the actions of the examples that the file carries."""
    policy = load_policy(folder / POLICY)
    if policy.golden is None:
        return []
    off = np.abs(policy.act(policy.golden.observation) - policy.golden.action).max()
    return [f"actions are {off:.2g} off the examples"] if not off < TOLERANCE else []


def _golden_alone(folder: Path) -> list[str]:
    vectors = read_golden(folder / GOLDEN)
    lengths = {len(value) for value in vars(vectors).values()}
    return ["arrays of unequal length"] if len(lengths) > 1 else []


def _onnx_alone(folder: Path) -> list[str]:
    """The sizes that the metadata states are those of the graph."""
    model, facts = read_onnx(folder / ONNX)
    width = model.graph.output[0].type.tensor_type.shape.dim[-1].dim_value
    named = facts.get("policy_joints", [])
    return [f"{len(named)} joints are named and {width} actions come out"] if len(named) != width else []


def _torch_script_alone(folder: Path) -> list[str]:
    """The sizes that the metadata states are those of the last layer."""
    module, facts = read_torch_script(folder / TORCH_SCRIPT)
    *_, bias = (value for name, value in module.named_parameters() if name.endswith("bias"))
    named = facts.get("policy_joints", [])
    return [f"{len(named)} joints are named and {len(bias)} actions come out"] if len(named) != len(bias) else []


def _checkpoint(folder: Path) -> list[str]:
    """torch and the reader of motions, which compares checksums, find the same numbers."""
    state, other = load_checkpoint(folder / CHECKPOINT, "cpu"), load_torch(folder / CHECKPOINT)
    differ = [
        f"{part} {name} differs"
        for part in STATES
        for name, value in state[part].items()
        if not np.array_equal(value.numpy(), other[part][name])
    ]
    return differ + (["another iteration"] if state["iteration"] != other["iteration"] else [])


def _export(folder: Path) -> list[str]:
    """An export of which a file was changed is refused by what reads that file."""
    found = read_export(folder, load_robot("t1"))
    read_golden(folder / GOLDEN)
    read_onnx(folder / ONNX)
    names = [name for name in (POLICY, GOLDEN, ONNX) if digest.of_file(folder / name) != found.card.files.get(name)]
    return [f"{', '.join(names)} differ from the digests of the card"] if names else []


def _card(folder: Path) -> list[str]:
    """A card that is read carries the digest of its content, and every field has its kind."""
    text = (folder / FILE).read_bytes()
    card = read_card(folder)
    value = json.loads(text)
    seal = value.pop("sha256", None)
    faults = [] if seal == digest.of_json(value) or seal is None else ["the card's digest is not that of its content"]
    kinds = {"name": str, "robot": str, "digest": str, "why": str, "shippable": bool}
    return faults + [name for name, each in vars(card).items() if not isinstance(each, kinds.get(name, dict))]


TARGETS = (
    _Target(POLICY, True, _policy_alone),
    _Target(GOLDEN, True, _golden_alone),
    _Target(ONNX, True, _onnx_alone),
    _Target(TORCH_SCRIPT, True, _torch_script_alone),
    _Target(CHECKPOINT, True, _checkpoint),
    _Target(FILE, True, _card),
    _Target(POLICY, False, _export),
    _Target(GOLDEN, False, _export),
    _Target(ONNX, False, _export),
    _Target(FILE, False, _export),
)
