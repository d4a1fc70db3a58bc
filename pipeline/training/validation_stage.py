"""The last stage of the chain: choose a checkpoint, evaluate it in MuJoCo and DART, and measure it. It needs no GPU.

<folder>/checkpoints/model_000100.npz   the last checkpoints as policies
<folder>/sweep.json      metrics of each on development trials, and the chosen iteration
<folder>/policy.npz      the chosen policy
<folder>/mujoco.json     verdict of the full suite
<folder>/dart.json       verdict of the walks in DART and across the bridge
<folder>/figures.json    metrics of the chosen policy (`policy_figures.py`), and its digest
<folder>/done.json       written last

Repeating the command continues with the first missing file. The sweep and the suite share no trial.
"""

import importlib
import json
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pipeline
from pipeline.batch.reporting_pool import ReportingPool
from pipeline.deployment import digest, load_policy
from pipeline.errors import PipelineError
from pipeline.export.booster_deploy import vendor_robot
from pipeline.files import atomic, settings
from pipeline.learning.checkpoint import load_checkpoint
from pipeline.learning.policy_file import policy_arrays, write_policy
from pipeline.learning.robot_facts import CURE, read_head
from pipeline.learning.run_command import write_json
from pipeline.learning.training_error import TrainingError
from pipeline.training import policy_figures
from pipeline.training.bundle import SCHEMA, Bundle
from pipeline.training.stage import CHECKPOINTS, CURVES, DONE, POLICY
from pipeline.validation.bars import read_validation
from pipeline.validation.cross_engine import cross_engine
from pipeline.validation.cross_engine_walk import CrossEngineSettings
from pipeline.validation.deployed import Deployed, deployed
from pipeline.validation.figures import measure
from pipeline.validation.suites import cells_of
from pipeline.validation.sweep import best, sweep_checkpoints
from pipeline.validation.verdict import judge

ROOT = Path(pipeline.__file__).resolve().parents[1]
"""Checkout that provides settings and thresholds."""
CANDIDATES = 10
"""Number of last checkpoints from which the best on development trials is chosen."""
SUITE = "full"
SKIP_HINT = "leave validation out: --stages distillation amp."
SWEEP, MUJOCO, DART, FIGURES = "sweep.json", "mujoco.json", "dart.json", "figures.json"


class ValidationStage:
    """Choose, validate and measure a checkpoint; `trained` is the folder of the last training stage."""

    def __init__(self, bundle: Bundle, folder: Path, trained: Path):
        """Raises TrainingError if anything the stage needs is missing, so that the run fails before training."""
        self.bundle, self.folder, self._trained = bundle, folder, trained
        if not bundle.robot_folder.is_dir():
            raise TrainingError(f"{bundle.robot_folder}: there is no such folder. {CURE}")
        bars = ROOT / "robots" / bundle.robot.name / "validation.yaml"
        if not bars.is_file():
            problem = "the file is missing, so validation has no thresholds for this robot."
            raise TrainingError(f"{bars}: {problem} Add it, or {SKIP_HINT}")
        try:
            importlib.import_module("pipeline.dart.plant")
            vendor_robot(bundle.robot.name)
        except PipelineError as error:
            raise TrainingError(f"{error} Or {SKIP_HINT}") from error
        self._bars = read_validation(ROOT / "data" / "validation.yaml", bars)
        self._walks = settings.read(ROOT / "data" / "cross_engine.yaml", CrossEngineSettings)

    def run(self) -> None:
        """Create the missing files. Raises TrainingError if the bundle was rewritten since the run began."""
        began = time.monotonic()
        if read_head(self.bundle.folder, SCHEMA)[1] != self.bundle.digest:
            problem = "was rewritten after this run began, so the policy can't be evaluated with it."
            raise TrainingError(f"{self.bundle.folder}: {problem} Restore it and repeat the command, or train again.")
        sweep = self._file(SWEEP, self._sweep)
        chosen = self.folder / CHECKPOINTS / f"model_{sweep['iteration']:06d}.npz"
        atomic.write_bytes(self.folder / POLICY, chosen.read_bytes())
        mujoco, dart = self._file(MUJOCO, self._mujoco), self._file(DART, self._dart)
        self._file(FIGURES, lambda: self._figures(mujoco, dart))
        write_json(self.folder / DONE, {"seconds": time.monotonic() - began, "chosen": sweep["iteration"]})

    def _file(self, name: str, make: Callable[[], dict[str, Any]]) -> dict[str, Any]:
        """Read a file of the stage, after creating it if it is missing."""
        path = self.folder / name
        if not path.is_file():
            write_json(path, make())
        return json.loads(path.read_text())

    def _sweep(self) -> dict[str, Any]:
        """Convert the last checkpoints to policies and choose the best one."""
        files: dict[int, Path] = {}
        for state in sorted((self._trained / CHECKPOINTS).glob("model_*.pt"))[-CANDIDATES:]:
            path = self.folder / CHECKPOINTS / f"{state.stem}.npz"
            write_policy(path, policy_arrays(load_checkpoint(state, "cpu"), self.bundle.robot))
            files[int(state.stem.split("_")[1])] = path
        if not files:
            raise TrainingError(f"{self._trained}: is done but has no checkpoint. Remove the folder.")
        policies = {number: self._deployed(path) for number, path in files.items()}
        results = sweep_checkpoints(policies, self._bars, _pool("sweep"))
        return {"iteration": best(results).iteration, "checkpoints": [each.to_dict() for each in results]}

    def _mujoco(self) -> dict[str, Any]:
        policy = self._deployed(self.folder / POLICY)
        measured = measure(policy, cells_of(SUITE, policy.robot), _pool("trials in MuJoCo"))
        verdict = judge(measured, self._bars, suite=SUITE, policy=digest(policy.policy), robot=policy.robot.digest)
        figures = policy_figures.as_json(policy_figures.suite_figures(verdict))
        required = sum(cell.bars.required for cell in verdict.cells)
        return {"figures": figures, "required": required, "verdict": verdict.to_dict()}

    def _dart(self) -> dict[str, Any]:
        policy = self._deployed(self.folder / POLICY)
        verdict = cross_engine(policy, self._walks, self._bars, pool=_pool("walks in DART"))
        required = sum(cell.required for cell in verdict.cells)
        return {"passed": required - len(verdict.failed_cells), "required": required, "verdict": verdict.to_dict()}

    def _figures(self, mujoco: dict[str, Any], dart: dict[str, Any]) -> dict[str, Any]:
        bundle, policy = self.bundle.folder, self.folder / POLICY
        figures = {
            **policy_figures.from_json(mujoco["figures"]),
            "required cells in DART": float(dart["passed"]),
            **policy_figures.style_figures(bundle, policy),
            **policy_figures.walk_figures(bundle, policy),
            **policy_figures.discriminator_figures(self._trained / CURVES),
        }
        passed = f"{figures['required cells']:.0f} of {mujoco['required']} required cells in MuJoCo"
        summary = f"{passed}, {dart['passed']} of {dart['required']} in DART"
        print(f"validation: {summary}", flush=True)
        policy_digest = mujoco["verdict"]["policy"]
        return {"policy": policy_digest, "summary": summary, "figures": policy_figures.as_json(figures)}

    def _deployed(self, policy: Path) -> Deployed:
        return deployed(self.bundle.robot_folder, load_policy(policy))


def _pool(what: str) -> ReportingPool:
    """Worker processes on all cores that report their progress."""
    return ReportingPool(workers=0, what=f"validation: {what} done")
