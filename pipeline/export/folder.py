"""An exported policy as one folder, and the check that such a folder is complete.

policy.npz             the network and its gains (`pipeline.deployment`)
golden.npz             sensor readings, observations, actions and targets of one second
curves.csv             curves of the training run, if it has any: at most CURVE_ROWS rows
card.json, CARD.md     model card; written last
policy.onnx            derived: the network as ONNX, with metadata
booster_deploy/        derived: task folder for Booster's deployment program, with the TorchScript file

A policy that ships with the project is stored compact, without the derived files; `complete_export` makes them.
"""

import dataclasses
import shutil
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

from pipeline.deployment import DeploymentTask, Policy, digest, load_policy
from pipeline.errors import FileError
from pipeline.export import booster_deploy, card
from pipeline.export.card import HELD_OUT, OTHER_SEEDS
from pipeline.export.evidence import FIGURES, held_out, other_seeds
from pipeline.export.metadata import (
    SHIPPABLE,
    ExportError,
    metadata,
    read_json,
    shipping,
    trained_task,
    training_data,
    training_run,
)
from pipeline.export.networks import to_onnx
from pipeline.export.parity import (
    GoldenVectors,
    Parity,
    golden_vectors,
    measure_parity,
    observations_to_compare,
    read_golden,
    write_golden,
)
from pipeline.files import atomic
from pipeline.files import digest as digests
from pipeline.robot import Robot

POLICY, ONNX, GOLDEN, CURVES = "policy.npz", "policy.onnx", "golden.npz", "curves.csv"
CURVE_ROWS = 200
"""Maximum number of rows of curves.csv: a long run has thousands of rows of 0.5 kB each."""
DEPLOY = "booster_deploy"
TORCH_SCRIPT = f"{DEPLOY}/{booster_deploy.FOLDER.as_posix()}/{booster_deploy.MODEL}"


@dataclass(frozen=True, kw_only=True)
class Source:
    """Inputs of an export."""

    policy: Path
    """npz of a trained policy, with its gains."""
    run: dict[str, Any]
    """The training run, see `ModelCard.run`."""
    data: dict[str, Any]
    """The expert database, see `ModelCard.data`; including the `licence` of the database's manifest."""
    curves: Path | None = None
    figures: dict[str, Any] | None = None


def source_of_run(
    run: Path,
    policy: Path | None = None,
    stated: Mapping[str, Any] | None = None,
    figures: Path | None = None,
    beside: Sequence[Path] = (),
    unseen: Path | None = None,
) -> Source:
    """The inputs of an export from a training run.

    Args:
        run: the run's folder: policy.npz, config.json, curves.csv, done.json, validation/figures.json
        policy: npz of a chosen checkpoint; None: the run's policy
        stated: facts that replace those of the run, as `commit`
        figures: JSON with measured figures; None: those of the run's validation, if it validated this
            policy
        beside: runs of the same recipe with other seeds, whose figures the card lists too
        unseen: verdict on the policy by the suite `held-out`, which the card lists too

    Raises FileError for a missing file or one without JSON, ExportError if `beside` or `unseen` is of another recipe
    or policy.
    """
    network, curves = policy or run / POLICY, run / CURVES
    measured = None
    if figures is not None:
        measured = read_json(figures, do="Name a JSON file with figures.")
    elif (run / FIGURES).is_file():
        found = read_json(run / FIGURES)
        measured = found if found.get("policy") == digest(load_policy(network)) else None
    if beside:
        measured = {**(measured or {}), OTHER_SEEDS: other_seeds(run, beside)}
    if unseen is not None:
        measured = {**(measured or {}), HELD_OUT: held_out(unseen, load_policy(network))}
    return Source(
        policy=network,
        run=training_run(run, stated),
        data=training_data(run),
        curves=curves if curves.is_file() else None,
        figures=measured,
    )


def export_policy(
    folder: Path,
    name: str,
    robot: Robot,
    source: Source,
    rng: np.random.Generator,
    *,
    shippable: bool,
    compact: bool = False,
) -> card.ModelCard:
    """Write the folder of a policy and return its card.

    Args:
        folder: output folder
        name: name of the policy
        robot: the robot it is for
        source: network, run and data
        rng: draws the observations on which the exported files are compared with the network
        shippable: mark it as a policy that may ship with the project
        compact: leave out the derived files once they are verified

    Raises ExportError if the licence of its data forbids shipping and `shippable` is set, if the policy has no gains,
    if `folder` holds anything but an export, and if an exported file does not reproduce the network's actions.
    """
    allowed, why = shipping(source.data)
    if shippable and not allowed:
        known = f"Allowed are {', '.join(SHIPPABLE)}. Train it on a database of such motions."
        raise ExportError(f"policy '{name}' can't be marked shippable: {why} {known}")
    policy = load_policy(source.policy)
    task = trained_task(robot, policy)
    booster_deploy.vendor_robot(task.robot)  # refused before an earlier export is removed
    _check_out(folder)
    _clear(folder)
    atomic.write_bytes(folder / POLICY, source.policy.read_bytes())
    golden = golden_vectors(robot, task, policy)
    write_golden(folder / GOLDEN, golden)
    if source.curves is not None:
        atomic.write_text(folder / CURVES, thinned(source.curves.read_text()))
    parity = _write_derived(folder, robot, task, policy, golden, rng)
    if compact:
        _remove_derived(folder)
    sizes = [policy.observation_size, *(len(bias) for _, bias in policy.layers)]
    written = card.ModelCard(
        name=name,
        robot=robot.name,
        digest=digest(policy),
        run=source.run,
        data=source.data,
        shippable=shippable,
        why=why,
        network={"sizes": sizes, "activation": "ELU", "precision": "single"},
        parity=asdict(parity),
        task=metadata(task, policy),
        files=_files(folder),
        figures=source.figures or {},
    )
    card.write_card(folder, written)
    return written


def thinned(curves: str) -> str:
    """Thin a CSV to at most CURVE_ROWS evenly spaced rows, including the last one."""
    header, *rows = curves.splitlines(keepends=True) or [""]
    step = -(-len(rows) // CURVE_ROWS) or 1
    return header + "".join(rows[::-step][::-1])


def complete_export(folder: Path, out: Path, robot: Robot, rng: np.random.Generator) -> card.ModelCard:
    """Copy the export in `folder` to `out`, derive ONNX and the booster_deploy task there, and return the new card.

    The card keeps everything but `files` and `parity`, which describe what was derived here.

    Raises FileError if `folder` is not an export whose files match its card, ExportError if `out` is `folder` or a
    derived file does not reproduce the network's actions.
    """
    if out.resolve() == folder.resolve():
        raise ExportError(f"{folder} can't be completed in place; name another output folder.")
    export = read_export(folder, robot)
    golden = read_golden(folder / GOLDEN)
    booster_deploy.vendor_robot(export.task.robot)
    _check_out(out)
    _clear(out)
    for name in (POLICY, GOLDEN, CURVES):
        if (folder / name).is_file():
            atomic.write_bytes(out / name, (folder / name).read_bytes())
    parity = _write_derived(out, robot, export.task, export.policy, golden, rng)
    completed = dataclasses.replace(export.card, parity=asdict(parity), files=_files(out))
    card.write_card(out, completed)
    return completed


@dataclass(frozen=True, kw_only=True)
class Export:
    """An exported policy whose files match its card."""

    folder: Path
    card: card.ModelCard
    policy: Policy
    task: DeploymentTask


def read_export(folder: Path, robot: Robot) -> Export:
    """The policy in a folder. Raises FileError if a file is missing or differs from the digest in its card."""
    found = card.read_card(folder)
    wrong = [
        name
        for name, content in sorted(found.files.items())
        if not (folder / name).is_file() or digests.of_file(folder / name) != content
    ]
    if wrong:
        raise FileError(
            folder,
            f"{', '.join(wrong)}: missing, or different from the digest in the card.",
            "Export the policy again.",
        )
    policy = load_policy(folder / POLICY)
    if digest(policy) != found.digest:
        raise FileError(folder / POLICY, "does not match the digest in the card.", "Export the policy again.")
    return Export(folder=folder, card=found, policy=policy, task=trained_task(robot, policy))


def _check_out(folder: Path) -> None:
    """Raise ExportError for a folder without a card that holds anything but files of an interrupted export."""
    if not folder.is_dir() or (folder / card.FILE).is_file():
        return
    ours = {POLICY, ONNX, GOLDEN, CURVES, card.PAGE, f"{DEPLOY}/README.md"}
    task = f"{DEPLOY}/{booster_deploy.FOLDER.as_posix()}/"
    found = (path.relative_to(folder).as_posix() for path in folder.rglob("*") if path.is_file())
    strange = next((name for name in found if name not in ours and not name.startswith(task)), None)
    if strange is not None:
        raise ExportError(f"{folder} holds other files ({strange}) and no earlier export. Name an empty folder.")


def _clear(folder: Path) -> None:
    """Remove an earlier export, the card first: a folder with a card is complete at any moment."""
    folder.mkdir(parents=True, exist_ok=True)
    (folder / card.FILE).unlink(missing_ok=True)
    (folder / CURVES).unlink(missing_ok=True)
    _remove_derived(folder)


def _remove_derived(folder: Path) -> None:
    (folder / ONNX).unlink(missing_ok=True)
    (folder / DEPLOY / "README.md").unlink(missing_ok=True)
    shutil.rmtree(folder / DEPLOY / booster_deploy.FOLDER, ignore_errors=True)
    for empty in (folder / DEPLOY / booster_deploy.FOLDER.parent, folder / DEPLOY):
        if empty.is_dir() and not any(empty.iterdir()):
            empty.rmdir()


def _write_derived(
    folder: Path, robot: Robot, task: DeploymentTask, policy: Policy, golden: GoldenVectors, rng: np.random.Generator
) -> Parity:
    """Write ONNX and the booster_deploy task, and compare both with the network."""
    atomic.write_bytes(folder / ONNX, to_onnx(task, policy))
    booster_deploy.write_task_folder(folder / DEPLOY, task, policy, robot.default_root_height)
    observations = observations_to_compare(policy, golden.observation, rng)
    return measure_parity(policy, folder / ONNX, folder / TORCH_SCRIPT, observations)


def _files(folder: Path) -> dict[str, str]:
    known = [folder / POLICY, folder / ONNX, folder / GOLDEN, folder / CURVES]
    known += sorted(path for path in (folder / DEPLOY).rglob("*") if path.suffix in {".py", ".pt", ".md"})
    return {path.relative_to(folder).as_posix(): digests.of_file(path) for path in known if path.is_file()}
