"""`exported_policy`: the policy that validation and robot take, trained here or shipped with the project.

`evaluated_policy` is the policy that a validation evaluates: the exported one, or an npz given by path.
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
"""Where an exported policy comes from; the two are never confused."""


VERDICT = "verdict"
"""Key of a validation's result in its manifest."""


class NoPolicyError(PipelineError):
    """There is no policy to serve."""


class ExportConfig(dg.Config):
    """How the policy is marked."""

    shippable: bool = False
    """Mark a policy that was trained here as one that may ship. Refused where its database's licence forbids it."""


@robot_asset(
    "onnx",
    deps=["amp_policy", "robot_model"],
    checks={MAY_SHIP: "The licence of its expert database lets it ship."},
    blocking={EXACT: "ONNX and TorchScript are the network's."},
)
def exported_policy(context: dg.AssetExecutionContext, config: ExportConfig, plan: Plan):
    """The policy as ONNX, TorchScript, golden vectors, model card and booster_deploy task; trained or shipped."""
    from pipeline.export.folder import read_export

    robot = plan.robot or DEFAULT_ROBOT
    folder, origin = serve(PROJECT, robot, shippable=config.shippable)
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


def serve(project: Project, robot: str, *, shippable: bool) -> tuple[Path, str]:
    """Folder of the policy to take, and where it comes from: a full training here, else the one that ships.

    Raises NoPolicyError where there is neither, ExportError where it is to be marked shippable and may not.
    """
    from pipeline.export.folder import complete_export, export_policy, source_of_run

    trained = key_of("amp_policy", robot).to_user_string()
    facts = full_training(project, trained)
    folder, rng = project.exported_policy(robot), np.random.default_rng(0)
    if facts is None:
        shipped = project.shipped_policies(robot) / "walk"
        if not (shipped / "card.json").is_file():
            do = f"dagster asset materialize --select {trained}"
            raise NoPolicyError(
                f"there is no policy of '{robot}': {shipped.relative_to(project.root)} ships none, and none was "
                f"trained here in full. On a machine with a GPU: {do}"
            )
        complete_export(shipped, folder, project.robot(robot), rng)
        return folder, SHIPPED
    run = project.root / facts["folder"]
    source = source_of_run(run, run / facts["policy"])
    adapted = project.robot(robot)
    export_policy(folder, facts["run"], adapted, source, rng, shippable=shippable)
    return folder, TRAINED


def full_training(project: Project, trained: str) -> dict[str, Any] | None:
    """The training that `amp_policy` recorded, if that was one and not a trial, and its network is still there."""
    if not project.store.manifest_path(trained).is_file():
        return None
    (facts,) = project.store.load(trained).settings.values()
    there = (project.root / facts["folder"] / facts["policy"]).is_file()
    return None if facts["trial"] or not there else facts


def served(manifest: Manifest) -> dict[str, Any]:
    """What `exported_policy` recorded: `robot, name, origin, run, digest, database, shippable, folder, files`."""
    (facts,) = manifest.settings.values()
    return facts


def served_policy(manifest: Manifest) -> Any:
    """The network that `exported_policy` serves (`pipeline.deployment.Policy`)."""
    from pipeline.export.folder import POLICY

    return load_policy(PROJECT.root / served(manifest)["folder"] / POLICY)


def _export_metadata(export: Any, origin: str) -> dict[str, Any]:
    card = export.card
    metadata: dict[str, Any] = {
        "policy": card.name,
        "origin": origin,
        "made by run": str(card.run.get("name", "not stated")),
        "digest": card.digest,
        "expert database": str(card.data.get("digest", "not stated")),
        "may ship": card.shippable,
        "why": card.why,
        "largest difference of ONNX": float(card.parity["onnx"]),
        "largest difference of TorchScript": float(card.parity["torch_script"]),
        "card": dg.MetadataValue.md(page(card)),
        "dagster/uri": dg.MetadataValue.path(str(export.folder)),
    }
    curves = curves_of(export.folder)
    return metadata | ({"curves of the run that made it": curves["curves"]} if curves else {})


def _export_checks(plan: Plan, card: Any) -> list[dg.AssetCheckResult]:
    from pipeline.export.parity import TOLERANCE

    worst = max(card.parity["onnx"], card.parity["torch_script"])
    exact = f"{worst:.1e} over {card.parity['observations']} observations, allowed {TOLERANCE:.0e}"
    ships = f"{'marked' if card.shippable else 'not marked'} as one that may ship. {card.why}"
    return [
        check_result(plan, EXACT, card.parity["times_allowed"] <= 1.0, exact, warn=False),
        check_result(plan, MAY_SHIP, card.shippable, ships),
    ]


class EvaluatedPolicyConfig(dg.Config):
    """The policy to evaluate."""

    policy: str = ""
    """An npz to evaluate in place of the exported policy. The release report then calls it another policy's result."""


def evaluated_policy(
    config: EvaluatedPolicyConfig, exported: Manifest, robot: str
) -> tuple[Deployed, ValidationSettings]:
    """The policy that is meant on the adapted robot, and the robot's bars. Raises FileError, SettingsError."""
    bars = PROJECT.validation(robot)
    policy = load_policy(Path(config.policy)) if config.policy else served_policy(exported)
    return deployed(PROJECT.adapted_robot(robot), policy), bars


def remove_earlier_logs(folder: Path, logs: Sequence[Path], tried: Collection[Path] | None = None) -> None:
    """Remove the logs of an earlier verdict: feedback would learn from a cell that passes now.

    Args:
        folder: where logs are
        logs: those of this verdict
        tried: logs that its cells would have if they failed; others stay. None: all cells were tried
    """
    for old in set(folder.glob("*.mcap")) - set(logs):
        if tried is None or old in tried:
            old.unlink()
