"""`exported_policy`: the policy for validation and deployment, trained here or shipped with the project.

`evaluated_policy` returns the policy that a validation evaluates: the exported one, or an npz file of the run config.
"""

from collections.abc import Collection, Sequence
from pathlib import Path
from typing import Any

import dagster as dg
import numpy as np

from assets.plan import Plan, key_of
from assets.report import check_result, result_of, robot_asset
from assets.training_process import curves_of
from pipeline.batch import Manifest
from pipeline.deployment import load_policy
from pipeline.errors import PipelineError
from pipeline.export.card import page
from pipeline.project import DEFAULT_ROBOT, PROJECT, Project
from pipeline.validation.bars import ValidationSettings
from pipeline.validation.deployed import Deployed, deployed

EXACT = "gives_the_networks_actions"
MAY_SHIP = "may_ship"
TRAINED, SHIPPED = "trained here", "ships with the project"
"""Origin of an exported policy."""


VERDICT = "verdict"
"""Key of a validation's result in its manifest."""


class NoPolicyError(PipelineError):
    """There is no policy to export."""


class ExportConfig(dg.Config):
    """Whether the policy is marked as shippable."""

    shippable: bool = False
    """Mark a policy that was trained here as shippable. Refused if the licence of its database forbids it."""


@robot_asset(
    "onnx",
    deps=["amp_policy", "robot_model"],
    checks={MAY_SHIP: "The policy is marked as shippable, which the licence of its expert database must allow."},
    blocking={EXACT: "ONNX and TorchScript give the actions of the network within the tolerance."},
)
def exported_policy(context: dg.AssetExecutionContext, config: ExportConfig, plan: Plan):
    """Exported walking policy: ONNX, TorchScript, golden vectors, model card, booster_deploy task.

    It is the policy of the last full training here, or without one the policy shipped with the project.
    """
    from pipeline.export.folder import read_export

    robot = plan.robot or DEFAULT_ROBOT
    folder, origin = export_current_policy(PROJECT, robot, shippable=config.shippable)
    export = read_export(folder, PROJECT.robot(robot))
    card = export.card
    context.log.info(f"policy '{card.name}' of run '{card.run.get('name')}': {origin}")
    facts = {
        "stage": plan.name,
        "robot": robot,
        "name": card.name,
        "origin": origin,
        "run": card.run.get("name", "not stated"),
        "digest": card.digest,
        "database": card.data.get("digest", "not stated"),
        "shippable": card.shippable,
        "folder": folder.relative_to(PROJECT.root).as_posix(),
        "files": card.files,
    }
    return result_of(plan, {card.digest: facts}, _export_metadata(export, origin), _export_checks(plan, card))


def export_current_policy(project: Project, robot: str, *, shippable: bool) -> tuple[Path, str]:
    """Export the policy of the last full training here, else the shipped one. Returns its folder and its origin.

    Raises NoPolicyError if there is neither, ExportError if it can't be marked as shippable.
    """
    from pipeline.export.folder import complete_export, export_policy, source_of_run

    trained = key_of("amp_policy", robot).to_user_string()
    facts = full_training(project, trained)
    folder, rng = project.exported_policy(robot), np.random.default_rng(0)
    if facts is None:
        shipped = project.shipped_policies(robot) / "walk"
        if not (shipped / "card.json").is_file():
            command = f"dagster asset materialize --select {trained}"
            raise NoPolicyError(
                f"there is no policy for '{robot}': none is shipped in {shipped.relative_to(project.root)}, and no "
                f"full training was done here. On a machine with a GPU, run: {command}"
            )
        complete_export(shipped, folder, project.robot(robot), rng)
        return folder, SHIPPED
    run = project.root / facts["folder"]
    source = source_of_run(run, run / facts["policy"])
    adapted = project.robot(robot)
    export_policy(folder, facts["run"], adapted, source, rng, shippable=shippable)
    return folder, TRAINED


def full_training(project: Project, trained: str) -> dict[str, Any] | None:
    """Facts of the last run of `amp_policy`; None without a run, after a trial, or if the network file is gone."""
    if not project.store.manifest_path(trained).is_file():
        return None
    (facts,) = project.store.load(trained).settings.values()
    exists = (project.root / facts["folder"] / facts["policy"]).is_file()
    return None if facts["trial"] or not exists else facts


def export_facts(manifest: Manifest) -> dict[str, Any]:
    """Facts that `exported_policy` recorded: `robot, name, origin, run, digest, database, shippable, folder, files`."""
    (facts,) = manifest.settings.values()
    return facts


def stored_policy(manifest: Manifest) -> Any:
    """The network of `exported_policy` (`pipeline.deployment.Policy`)."""
    from pipeline.export.folder import POLICY

    return load_policy(PROJECT.root / export_facts(manifest)["folder"] / POLICY)


def _export_metadata(export: Any, origin: str) -> dict[str, Any]:
    card = export.card
    metadata: dict[str, Any] = {
        "policy": card.name,
        "origin": origin,
        "training run": str(card.run.get("name", "not stated")),
        "digest": card.digest,
        "expert database": str(card.data.get("digest", "not stated")),
        "may ship": card.shippable,
        "reason": card.why,
        "largest action difference of ONNX": float(card.parity["onnx"]),
        "largest action difference of TorchScript": float(card.parity["torch_script"]),
        "card": dg.MetadataValue.md(page(card)),
        "dagster/uri": dg.MetadataValue.path(str(export.folder)),
    }
    curves = curves_of(export.folder)
    return metadata | ({"training curves": curves["curves"]} if curves else {})


def _export_checks(plan: Plan, card: Any) -> list[dg.AssetCheckResult]:
    from pipeline.export.parity import TOLERANCE

    worst = max(card.parity["onnx"], card.parity["torch_script"])
    exact = f"largest difference {worst:.1e} over {card.parity['observations']} observations, allowed {TOLERANCE:.0e}"
    ships = f"{'marked' if card.shippable else 'not marked'} as shippable. {card.why}"
    return [
        check_result(plan, EXACT, card.parity["times_allowed"] <= 1.0, exact, warn=False),
        check_result(plan, MAY_SHIP, card.shippable, ships),
    ]


class EvaluatedPolicyConfig(dg.Config):
    """The policy to evaluate."""

    policy: str = ""
    """Path of an npz file to evaluate instead of the exported policy. The release report then marks the result as
    that of another policy."""


def evaluated_policy(
    config: EvaluatedPolicyConfig, exported: Manifest, robot: str
) -> tuple[Deployed, ValidationSettings]:
    """The configured policy on the adapted robot, and the robot's thresholds. Raises FileError, SettingsError."""
    bars = PROJECT.validation(robot)
    policy = load_policy(Path(config.policy)) if config.policy else stored_policy(exported)
    return deployed(PROJECT.adapted_robot(robot), policy), bars


def remove_earlier_logs(folder: Path, logs: Sequence[Path], tried: Collection[Path] | None = None) -> None:
    """Remove failure logs of an earlier verdict, so that feedback does not use failures of cells that pass now.

    Args:
        folder: folder of the logs
        logs: logs of this verdict, which are kept
        tried: paths of the logs of all tried cells; other logs are kept. None: all cells were tried
    """
    for old in set(folder.glob("*.mcap")) - set(logs):
        if tried is None or old in tried:
            old.unlink()
