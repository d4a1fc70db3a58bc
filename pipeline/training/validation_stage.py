"""The last stage of the chain: a checkpoint is chosen, evaluated in MuJoCo and DART, and gets a card. It needs no GPU.

<folder>/checkpoints/model_000100.npz   the last checkpoints as policies
<folder>/sweep.json      figures of each on development trials, and the chosen iteration
<folder>/policy.npz      the chosen policy
<folder>/mujoco.json     verdict of the full suite
<folder>/dart.json       verdict of the walks in DART and across the bridge
<folder>/figures.json    figures of the chosen policy (`policy_figures.py`), and its digest
<folder>/done.json       written last

Repeating the command continues with the first file that is missing. No trial of the sweep is one of the suite.
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
"""The checkout whose settings and thresholds are used."""
CANDIDATES = 10
"""The last checkpoints, of which the best on development trials is chosen."""
SUITE = "full"
WITHOUT = "leave validation out: --stages distillation amp."
SWEEP, MUJOCO, DART, FIGURES = "sweep.json", "mujoco.json", "dart.json", "figures.json"


class ValidationStage:
    """Chooses a checkpoint, validates it and measures it; `trained` is the folder of the last training stage."""

    def __init__(self, bundle: Bundle, folder: Path, trained: Path):
        """Raises TrainingError where something that the stage needs is missing, so that it shows before training."""
        self.bundle, self.folder, self._trained = bundle, folder, trained
        if not bundle.robot_folder.is_dir():
            raise TrainingError(f"{bundle.robot_folder}: there is no such folder. {CURE}")
        bars = ROOT / "robots" / bundle.robot.name / "validation.yaml"
        if not bars.is_file():
            problem = "there is none, so validation has no thresholds for this robot."
            raise TrainingError(f"{bars}: {problem} Add it, or {WITHOUT}")
        try:
            importlib.import_module("pipeline.dart.plant")
            vendor_robot(bundle.robot.name)
        except PipelineError as error:
            raise TrainingError(f"{error} Or {WITHOUT}") from error
        self._bars = read_validation(ROOT / "data" / "validation.yaml", bars)
        self._walks = settings.read(ROOT / "data" / "cross_engine.yaml", CrossEngineSettings)

    def run(self) -> None:
        """Make the files that are missing. Raises TrainingError where the bundle was written again meanwhile."""
        began = time.monotonic()
        if read_head(self.bundle.folder, SCHEMA)[1] != self.bundle.digest:
            problem = "was written again while this run trained from it, so the policy can't be evaluated with it."
            raise TrainingError(f"{self.bundle.folder}: {problem} Put it back and repeat the command, or train again.")
        sweep = self._file(SWEEP, self._sweep)
        chosen = self.folder / CHECKPOINTS / f"model_{sweep['iteration']:06d}.npz"
        atomic.write_bytes(self.folder / POLICY, chosen.read_bytes())
        mujoco, dart = self._file(MUJOCO, self._mujoco), self._file(DART, self._dart)
        self._file(FIGURES, lambda: self._figures(mujoco, dart))
        write_json(self.folder / DONE, {"seconds": time.monotonic() - began, "chosen": sweep["iteration"]})

    def _file(self, name: str, make: Callable[[], dict[str, Any]]) -> dict[str, Any]:
        """The content of a file of the stage, which is made where it is missing."""
        path = self.folder / name
        if not path.is_file():
            write_json(path, make())
        return json.loads(path.read_text())

    def _sweep(self) -> dict[str, Any]:
        """The last checkpoints as policies, and which of them is the best."""
        files: dict[int, Path] = {}
        for state in sorted((self._trained / CHECKPOINTS).glob("model_*.pt"))[-CANDIDATES:]:
            path = self.folder / CHECKPOINTS / f"{state.stem}.npz"
            write_policy(path, policy_arrays(load_checkpoint(state, "cpu"), self.bundle.robot))
            files[int(state.stem.split("_")[1])] = path
        if not files:
            raise TrainingError(f"{self._trained}: is done but has no checkpoint. Remove the folder.")
        policies = {number: self._deployed(path) for number, path in files.items()}
        found = sweep_checkpoints(policies, self._bars, _pool("sweep"))
        return {"iteration": best(found).iteration, "checkpoints": [each.to_dict() for each in found]}

    def _mujoco(self) -> dict[str, Any]:
        one = self._deployed(self.folder / POLICY)
        measured = measure(one, cells_of(SUITE, one.robot), _pool("trials in MuJoCo"))
        verdict = judge(measured, self._bars, suite=SUITE, policy=digest(one.policy), robot=one.robot.digest)
        figures = policy_figures.as_json(policy_figures.suite_figures(verdict))
        required = sum(cell.bars.required for cell in verdict.cells)
        return {"figures": figures, "required": required, "verdict": verdict.to_dict()}

    def _dart(self) -> dict[str, Any]:
        one = self._deployed(self.folder / POLICY)
        found = cross_engine(one, self._walks, self._bars, pool=_pool("walks in DART"))
        required = sum(cell.required for cell in found.cells)
        return {"passed": required - len(found.failed_cells), "required": required, "verdict": found.to_dict()}

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
        made_of = mujoco["verdict"]["policy"]
        return {"policy": made_of, "summary": summary, "figures": policy_figures.as_json(figures)}

    def _deployed(self, policy: Path) -> Deployed:
        return deployed(self.bundle.robot_folder, load_policy(policy))


def _pool(what: str) -> ReportingPool:
    """Processes on all cores that report what is done."""
    return ReportingPool(workers=0, what=f"validation: {what} done")
