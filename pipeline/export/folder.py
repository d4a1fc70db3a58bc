"""An exported policy as one folder, and the check that such a folder is whole.

policy.npz             the network as numbers, with its gains (`pipeline.deployment`)
policy.onnx            the same as ONNX, facts as metadata
booster_deploy/        a task folder for Booster's deployment program; the TorchScript file lies there
golden.npz             sensor readings, observations, actions and targets of a second
curves.csv             the training run's curves, where it has them
card.json, CARD.md     what it is; written last
"""

from __future__ import annotations

from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

from pipeline.deployment import DeploymentTask, Policy, digest, load_policy
from pipeline.errors import FileError
from pipeline.export import booster_deploy, card
from pipeline.export.golden import golden_vectors, write_golden
from pipeline.export.licence import refuse_unless_allowed, shipping
from pipeline.export.metadata import metadata
from pipeline.export.onnx_model import write_onnx
from pipeline.export.parity import measure_parity, observations_to_compare
from pipeline.export.trained_task import trained_task
from pipeline.files import atomic
from pipeline.files import digest as digests
from pipeline.robot import Robot

POLICY, ONNX, GOLDEN, CURVES = "policy.npz", "policy.onnx", "golden.npz", "curves.csv"
DEPLOY = "booster_deploy"
TORCH_SCRIPT = f"{DEPLOY}/{booster_deploy.FOLDER.as_posix()}/{booster_deploy.MODEL}"


@dataclass(frozen=True, kw_only=True)
class Source:
    """What an export is made from."""

    policy: Path
    """npz of a trained policy, with its gains."""
    run: dict[str, Any]
    """The training run, see `ModelCard.run`."""
    data: dict[str, Any]
    """The expert database, see `ModelCard.data`; with its `licence` as the database's manifest has it."""
    curves: Path | None = None
    figures: dict[str, Any] | None = None


def export_policy(
    folder: Path, name: str, robot: Robot, source: Source, rng: np.random.Generator, *, shippable: bool
) -> card.ModelCard:
    """Write the folder of a policy; its card.

    Args:
        folder: where to
        name: of the policy
        robot: the robot it is for
        source: network, run and data
        rng: draws the observations at which exported files are held against the network
        shippable: mark it as one that may ship with the project

    Raises ExportError where the licence of its data forbids to mark it so, where it has no gains, and where an exported
    file doesn't give the network's actions.
    """
    allowed = shipping(source.data)
    if shippable:
        refuse_unless_allowed(allowed, name)
    policy = load_policy(source.policy)
    task = trained_task(robot, policy)
    folder.mkdir(parents=True, exist_ok=True)
    (folder / card.FILE).unlink(missing_ok=True)
    atomic.write_bytes(folder / POLICY, source.policy.read_bytes())
    write_onnx(folder / ONNX, task, policy)
    booster_deploy.write_task_folder(folder / DEPLOY, task, policy, robot.default_root_height)
    golden = golden_vectors(robot, task, policy)
    write_golden(folder / GOLDEN, golden)
    observations = observations_to_compare(policy, golden.observation, rng)
    parity = measure_parity(policy, folder / ONNX, folder / TORCH_SCRIPT, observations)
    if source.curves is not None:
        atomic.write_bytes(folder / CURVES, source.curves.read_bytes())
    written = card.ModelCard(
        name=name,
        robot=robot.name,
        digest=digest(policy),
        run=source.run,
        data=source.data,
        shippable=shippable,
        why=allowed.reason,
        network={"sizes": _sizes(policy), "activation": "ELU", "precision": "single"},
        parity=asdict(parity),
        task=metadata(task, policy),
        files=_files(folder),
        figures=source.figures or {},
    )
    card.write_card(folder, written)
    return written


@dataclass(frozen=True, kw_only=True)
class Export:
    """An exported policy that is whole."""

    folder: Path
    card: card.ModelCard
    policy: Policy
    task: DeploymentTask


def read_export(folder: Path, robot: Robot) -> Export:
    """The policy of a folder, each file of which is the one that its card states. Raises FileError."""
    found = card.read_card(folder)
    wrong = [
        name
        for name, content in sorted(found.files.items())
        if not (folder / name).is_file() or digests.of_file(folder / name) != content
    ]
    if wrong:
        raise FileError(folder, f"{', '.join(wrong)}: missing or not what the card states.", "Export the policy again.")
    policy = load_policy(folder / POLICY)
    if digest(policy) != found.digest:
        raise FileError(folder / POLICY, "is not the network that the card states.", "Export the policy again.")
    return Export(folder=folder, card=found, policy=policy, task=trained_task(robot, policy))


def _files(folder: Path) -> dict[str, str]:
    known = [folder / POLICY, folder / ONNX, folder / GOLDEN, folder / CURVES]
    known += sorted(path for path in (folder / DEPLOY).rglob("*") if path.suffix in {".py", ".pt", ".md"})
    return {path.relative_to(folder).as_posix(): digests.of_file(path) for path in known if path.is_file()}


def _sizes(policy: Policy) -> list[int]:
    return [policy.observation_size, *(len(bias) for _, bias in policy.layers)]
